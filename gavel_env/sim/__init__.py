"""The hidden world: what happens in a house during an episode. Agents never import it."""
