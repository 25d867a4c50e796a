"""A classical planner in the language model's place: it plans for what was understood, over what is believed."""
