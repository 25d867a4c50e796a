"""Short stretches of plan, written down while the world model carries them out.

Every step is checked and applied with the one transition model, so a stretch is applicable where it begins.
"""

from __future__ import annotations

from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import Profile, apply, first_violation
from gavel_env.world_model.goals import Goal
from gavel_env.world_model.graph import Flag, Relation, SceneGraph
from gavel_env.world_model.verdict import Plan

__all__ = ["Sketch", "outermost_shut"]


def outermost_shut(graph: SceneGraph, obj: str) -> str | None:
    """Return the outermost shut container around `obj`: the one that can be opened first."""
    found = None
    while (container := graph.closed_container(obj)) is not None:
        found = obj = container
    return found


class Sketch:
    """A stretch of plan under construction.

    Every method returns whether it succeeded; after a failure the sketch is not to be used.

    Attributes:
        graph: the state after the steps so far.
        steps: the steps so far.
    """

    def __init__(self, graph: SceneGraph, profile: Profile = Profile.PAPER) -> None:
        self.graph = graph
        self.steps: list[Action] = []
        self._profile = profile
        self._opened: list[str] = []

    @property
    def plan(self) -> Plan:
        """The steps so far."""
        return tuple(self.steps)

    def fork(self) -> Sketch:
        """Return a sketch that goes on from here, for a try."""
        other = Sketch(self.graph, self._profile)
        other.adopt(self)
        return other

    def adopt(self, other: Sketch) -> None:
        """Go on from where another sketch has come to."""
        self.graph, self.steps, self._opened = other.graph, list(other.steps), list(other._opened)

    def do(self, primitive: Primitive, target: str | None = None, *others: str) -> bool:
        """Add one step if it is applicable."""
        action = Action(primitive, target, others)
        if first_violation(self.graph, action, self._profile) is not None:
            return False
        self.graph = apply(self.graph, action)
        self.steps.append(action)
        return True

    def operate(self, primitive: Primitive, target: str) -> bool:
        """Open, close or switch; where the profile wants an empty hand, set down what is held and take it again."""
        held = self.graph.holding
        if held is None or self._profile is Profile.PAPER:
            return self.do(primitive, target)
        return self.set_down() and self.do(primitive, target) and self.do(Primitive.GRASP, held)

    def reach(self, obj: str) -> bool:
        """Make `obj` near and accessible: open the shut containers around it, outermost first."""
        while (container := outermost_shut(self.graph, obj)) is not None:
            if not (self.approach(container) and self.open(container)):
                return False
        return self.approach(obj)

    def approach(self, obj: str) -> bool:
        """Navigate to `obj` unless it is near."""
        if obj in self.graph.near or obj == self.graph.holding:
            return True
        return self.do(Primitive.NAVIGATE_TO, obj)

    def open(self, container: str) -> bool:
        """Open a near container if it is shut, and remember to shut it."""
        if not self.graph.is_shut(container):
            return True
        self._opened.append(container)
        return self.operate(Primitive.OPEN, container)

    def take(self, obj: str) -> bool:
        """Get `obj` into the hand; what the hand held is set down first."""
        graph = self.graph
        if graph.holding == obj:
            return True
        if graph.holding is not None and not self.set_down():
            return False
        return self.reach(obj) and self.do(Primitive.GRASP, obj)

    def put(self, relation: Relation, place: str) -> bool:
        """Bring what is held to `place`: on it, in it, or on the floor beside it."""
        if not self.reach(place):
            return False
        if relation is Relation.ON_TOP:
            return self.do(Primitive.PLACE_ON_TOP, place)
        if relation is Relation.FLOOR:
            return self.do(Primitive.RELEASE)
        return self.open(place) and self.do(Primitive.PLACE_INSIDE, place)

    def bring(self, obj: str, relation: Relation, place: str) -> bool:
        """Take `obj` to `place`, shutting on the way what was opened for it."""
        return self.take(obj) and self.shut(only_near=True, but=place) and self.put(relation, place) and self.shut()

    def set_down(self) -> bool:
        """Put what is held on a near surface that no door can shut away, or on the floor if there is none."""
        graph = self.graph
        for place in sorted(graph.near, key=lambda o: (not graph.world.nodes[o].fixed, o)):
            shut_away = any(graph.category(holder).openable for _, holder in graph.holders(place))
            if graph.category(place).surface and not shut_away and self.do(Primitive.PLACE_ON_TOP, place):
                return True
        return self.do(Primitive.RELEASE)

    def shut(self, *, only_near: bool = False, but: str | None = None) -> bool:
        """Close what this sketch opened, last first.

        Args:
            only_near: leave what would need driving, or a free hand, for later.
            but: leave this container, and those around it, for later.
        """
        later: list[str] = []
        for container in reversed(self._opened):
            if only_near and (
                container not in self.graph.near
                or (but is not None and (but == container or self.graph.contains(container, but)))
                or (self.graph.holding is not None and self._profile is not Profile.PAPER)
            ):
                later.insert(0, container)
                continue
            if self.graph.is_shut(container):
                continue
            if not (self.reach(container) and self.operate(Primitive.CLOSE, container)):
                return False
        self._opened = later
        return True

    def run(self, appliance: str, goal: Goal) -> bool:
        """Switch an appliance on with its door shut, and off again unless the goal wants it on."""
        if not self.reach(appliance):
            return False
        category = self.graph.category(appliance)
        if category.openable and not self.graph.is_shut(appliance) and not self.operate(Primitive.CLOSE, appliance):
            return False
        if not category.toggleable:
            return True
        if not self.operate(Primitive.TOGGLE_ON, appliance):
            return False
        if not category.safety_critical or goal.wants(Flag.TOGGLED, appliance, self.graph):
            return True
        return self.operate(Primitive.TOGGLE_OFF, appliance)
