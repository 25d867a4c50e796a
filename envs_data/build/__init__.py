"""Scripts that build the shipped data; they need the extra `data`, nothing at run time does."""
