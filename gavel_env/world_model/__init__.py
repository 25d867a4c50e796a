"""The graph world model: actions, ontology, graph, goals, the transition model f(G, a), and verdicts over plans."""
