"""What is found is not what was expected: another kind of thing, or not where it was said to be.

A node named by a concept takes the category of what it is bound to. What is not in the piece where it was said to be is
looked for in the next piece that fits what was said, and taken where it was seen if no other piece was seen.
"""

from __future__ import annotations

from gavel_agents.binding import Binder, Surprise
from gavel_env.exchange import Observed
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.graph import Flag, SceneGraph

__all__ = ["Findings"]


class Findings:
    """What the robot has come to know of the nodes of one believed graph.

    Args:
        binder: what the nodes are bound to.
        graph: the believed graph at the start.
    """

    def __init__(self, binder: Binder, graph: SceneGraph) -> None:
        self._binder = binder
        self._expected = {node.id: node for node in graph.world.nodes.values() if node.others}
        self._shut_early: set[str] = set()

    @property
    def may_differ(self) -> bool:
        """True if some node may turn out to be of another category than the graph says."""
        return bool(self._expected)

    def settle(self, graph: SceneGraph, observed: Observed) -> SceneGraph:
        """Return the believed graph, its bound nodes of the category that they were found to be of."""
        found = {}
        for node, expected in self._expected.items():
            instance = self._binder.bound.get(node)
            if instance is not None and graph.world.nodes[node].others:
                real = observed.graph.world.nodes[instance]
                found[node] = expected._replace(category=real.category, fixed=real.fixed, others=(), weights=())
        return graph.with_nodes(found) if found else graph

    def is_needless(self, action: Action, observed: Observed) -> bool:
        """Return whether a step works the door of what was found to have none, or shuts what is shut already."""
        node = action.target or ""
        instance = self._binder.bound.get(node)
        if instance is None or action.primitive not in (Primitive.OPEN, Primitive.CLOSE):
            return False
        if action.primitive is Primitive.CLOSE and node in self._shut_early:
            return observed.graph.is_shut(instance)
        return node in self._expected and not observed.graph.category(instance).openable

    def after(
        self, surprise: Surprise, action: Action, graph: SceneGraph, observed: Observed
    ) -> tuple[SceneGraph, list[Action]]:
        """Return the believed graph and the steps after a surprise: to the next piece, or to where the thing was seen.

        Args:
            surprise: what is wrong.
            action: the step that it was noticed at; it is the last step returned.
            graph: the believed graph.
            observed: what has been observed.
        """
        holder = surprise.holder
        piece = self._binder.bound[holder]
        leaving: list[Action] = []
        if observed.graph.has(Flag.OPEN, piece):
            leaving = [Action(Primitive.CLOSE, piece)]
            if piece not in observed.graph.near:
                leaving.insert(0, Action(Primitive.NAVIGATE_TO, piece))
        if surprise.elsewhere:
            self._shut_early.add(holder)
            going = Action(Primitive.NAVIGATE_TO, action.target)
            graph = graph.place(action.target or "", None)
            return graph, [*leaving, going] if action == going else [*leaving, going, action]
        self._binder.reject(holder)
        if holder in self._expected:
            graph = graph.with_nodes({holder: self._expected[holder]})
        steps = [*leaving, Action(Primitive.NAVIGATE_TO, holder)]
        if any(category.has_door for category in graph.world.nodes[holder].categories):
            steps.append(Action(Primitive.OPEN, holder))
        return graph, [*steps, action]
