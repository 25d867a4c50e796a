"""What an agent believes: the believed graph, and a distribution over rooms for what it has not seen."""
