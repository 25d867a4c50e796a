"""Studies of single parts: beliefs, understanding, the cost model, recordings, speed."""
