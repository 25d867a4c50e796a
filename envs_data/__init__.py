"""Data of the project: ontology, scenes, instructions, recordings; `envs_data.build` makes them from their sources."""
