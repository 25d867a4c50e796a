"""Episode records: their schema, the files that hold them, where they come from."""
