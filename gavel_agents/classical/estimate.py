"""How many primitives a goal is away: the search's heuristic, wish by wish and thing by thing.

For every thing the estimate counts what it takes to fetch it, have an appliance work on it and bring it where it
belongs, doors on the way included; then what has to be shut and switched off. A thing that still needs an appliance
counts as not yet delivered, wherever it is: so that what must come first is done first. One run of an appliance serves
all that lies in it; otherwise things are counted apart from each other: the estimate is informed, not admissible.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from gavel_agents.classical.needs import MADE, Needs
from gavel_agents.classical.wishes import Unplannable, Wish, wishes
from gavel_env.world_model.conditions import ON_FLOOR, WITHIN
from gavel_env.world_model.goals import Predicate
from gavel_env.world_model.graph import Flag, Relation, SceneGraph

__all__ = ["HOPELESS", "estimate"]

HOPELESS = 10_000.0
"""Price of what no action brings about."""

_ON, _IN = Predicate.ON_TOP.value, Predicate.INSIDE.value


def estimate(needs: Needs, graph: SceneGraph, handy: frozenset[str]) -> float:
    """Return how many primitives a state is away from the goal, about.

    Args:
        needs: the goal, with what it may need.
        graph: the state.
        handy: what can be worked on without driving.
    """
    steps = _Steps(graph, handy, needs)
    try:
        asked = wishes(needs.goal, graph, steps.price)
    except Unplannable:
        return HOPELESS
    by_thing: dict[str, list[Wish]] = {}
    for wish in _where_all_will_be(asked):
        by_thing.setdefault(wish.subject, []).append(wish)
    total = sum(steps.thing(thing, about) for thing, about in by_thing.items()) + steps.running()
    doors = {w.subject for w in asked if w.predicate == "open" and w.negated}
    in_the_way = graph.holding is not None and graph.holding not in by_thing
    return total + in_the_way - steps.within_reach + _restoring(needs, graph, handy, doors)


def _restoring(needs: Needs, graph: SceneGraph, handy: frozenset[str], counted: set[str]) -> float:
    """Return the steps that shut and switch off what the plan opened and switched on."""
    total = 0.0
    for flag in (Flag.OPEN, Flag.TOGGLED):
        for obj in graph.flags[flag] - needs.start.flags[flag] - needs.wanted[flag]:
            if flag is Flag.TOGGLED and not graph.category(obj).safety_critical:
                continue
            if not (flag is Flag.OPEN and obj in counted):
                total += 1 if obj in handy else 2
    return total


def _where_all_will_be(asked: Sequence[Wish]) -> Iterator[Wish]:
    """Yield wishes; beside what shall be brought to a piece means on or in that piece too."""
    going = {w.subject: w for w in asked if w.predicate in (_ON, _IN) and not w.negated}
    for wish in asked:
        beside = (
            going.get(wish.object or "") if wish.predicate == Predicate.NEXT_TO.value and not wish.negated else None
        )
        yield wish if beside is None or beside.object == wish.subject else beside._replace(subject=wish.subject)


class _Steps:
    """Counts of primitives in one state."""

    def __init__(self, graph: SceneGraph, handy: frozenset[str], needs: Needs) -> None:
        self.graph, self.handy, self.needs = graph, handy, needs
        self.within_reach = False  # whether something that must be taken can be taken from here
        self._runs: set[str] = set()

    def price(self, wish: Wish) -> float:
        """Return the steps to one wish by itself."""
        alone = _Steps(self.graph, self.handy, self.needs)
        return alone.thing(wish.subject, [wish]) + alone.running()

    def running(self) -> float:
        """Return the steps that run the appliances which the things counted so far need."""
        total = 0.0
        for appliance in self._runs:
            category = self.graph.category(appliance)
            shutting = category.openable and appliance in self.graph.flags[Flag.OPEN]
            total += self.reach(appliance) + shutting + category.toggleable
        return total

    def thing(self, thing: str, about: list[Wish]) -> float:
        """Return the steps to everything that is wished of one thing, appliances being run aside."""
        graph = self.graph
        total = 0.0
        works = [w for w in about if self._work(w) is not None and not w.holds(graph)]
        places = [w for w in about if not w.negated and w.predicate in _PLACING]
        for work in works:
            option = self._work(work)
            assert option is not None
            total += option()
        if works and places:
            total += 3 + max(map(self._doors, places))
        elif places:  # one placement may fulfil several wishes: on the table, beside the plate
            total += max((self._placed(thing, wish) for wish in places if not wish.holds(graph)), default=0.0)
        for wish in about:
            if wish in works or wish in places or wish.holds(graph):
                continue
            total += self._other(thing, wish)
        return total

    # --- fetching and bringing -----------------------------------------------------------------------------------

    def reach(self, thing: str) -> float:
        """Return the steps until a thing is near and no shut door is before it."""
        graph = self.graph
        if thing == graph.holding or (thing in self.handy and graph.closed_container(thing) is None):
            return 0
        shut = [h for relation, h in graph.holders(thing) if relation is Relation.INSIDE and graph.is_shut(h)]
        if not shut:
            return 1
        doors = sum((1 if c in self.handy else 2) for c in shut)
        return doors + (self.needs.hand if graph.holding is not None else 0)

    def take(self, thing: str) -> float:
        """Return the steps until a thing is in the hand, going there included: one hand, one way for each thing."""
        graph = self.graph
        if thing == graph.holding:
            return 0
        shut = [h for relation, h in graph.holders(thing) if relation is Relation.INSIDE and graph.is_shut(h)]
        if graph.holding is None and thing in self.handy and not shut:
            self.within_reach = True
        return 2 + len(shut) * (1 + (self.needs.hand if graph.holding is not None else 0))

    def bring(self, thing: str, relation: Relation, place: str) -> float:
        """Return the steps until a thing is on, in or beside a place."""
        graph = self.graph
        going = self.reach(place) if thing == graph.holding else 1 + self._shut_around(place)
        opening = relation is Relation.INSIDE and graph.is_shut(place)
        return self.take(thing) + going + opening * (1 + self.needs.hand) + 1

    def _shut_around(self, place: str) -> float:
        graph = self.graph
        return 2.0 * sum(r is Relation.INSIDE and graph.is_shut(h) for r, h in graph.holders(place))

    def _doors(self, wish: Wish) -> float:
        return 1.0 if wish.predicate == _IN and wish.object is not None and self.graph.is_shut(wish.object) else 0.0

    def _placed(self, thing: str, wish: Wish) -> float:
        place = wish.object or ""
        category = self.graph.world.nodes[thing]
        if category.fixed or not category.category.liftable:
            return HOPELESS
        if wish.predicate in (Predicate.IN_ROOM.value, ON_FLOOR):
            pieces = self.needs.pieces_of(place)
            return min((self.bring(thing, Relation.FLOOR, piece) for piece in pieces), default=HOPELESS)
        target = self.graph.category(place)
        if wish.predicate == _ON:
            return self.bring(thing, Relation.ON_TOP, place) if target.surface else HOPELESS
        if wish.predicate in (_IN, WITHIN):
            return self.bring(thing, Relation.INSIDE, place) if target.interior else HOPELESS
        if wish.predicate == Predicate.UNDER.value and not target.clearance:
            return HOPELESS
        beside = self.graph.supports.get(place) if wish.predicate == Predicate.NEXT_TO.value else None
        if beside is not None and beside.relation <= Relation.INSIDE:  # on or in the same piece
            return self.bring(thing, beside.relation, beside.holder)
        return self.bring(thing, Relation.FLOOR, place)

    # --- states --------------------------------------------------------------------------------------------------

    def _work(self, wish: Wish) -> Callable[[], float] | None:
        """Return how to count a state that something must be run (or rubbed) for, or None for other wishes."""
        thing = wish.subject
        if wish.predicate == Predicate.DIRTY.value:
            return (lambda: self._cleaned(thing)) if wish.negated else (lambda: HOPELESS)
        flag = MADE.get(wish.predicate)
        if flag is None:
            return None
        if not wish.negated:
            return lambda: self._run(thing, self.needs.workers(thing, flag))
        undone = {Flag.HOT: Flag.FROZEN, Flag.FROZEN: Flag.HOT}.get(flag)
        if undone is None:
            return lambda: HOPELESS
        return lambda: self._run(thing, self.needs.workers(thing, undone))

    def _cleaned(self, thing: str) -> float:
        wiped = min((self.bring(w, Relation.ON_TOP, thing) for w in self.needs.wipers(thing)), default=HOPELESS)
        loading, appliance = self._loading(thing, self.needs.machines(thing))
        if appliance is None or wiped <= loading + 1:
            return wiped
        self._runs.add(appliance)
        return loading

    def _run(self, thing: str, options: tuple[tuple[str, Relation], ...]) -> float:
        """Return the steps until a thing is loaded, and note that its appliance must run."""
        loading, appliance = self._loading(thing, options)
        if appliance is not None:
            self._runs.add(appliance)
        return loading

    def _loading(self, thing: str, options: tuple[tuple[str, Relation], ...]) -> tuple[float, str | None]:
        """Return the steps until a thing lies in or on the cheapest of some appliances, and which that is."""
        graph = self.graph
        costs = []
        for appliance, relation in options:
            loaded = graph.supports.get(thing) == (relation, appliance)
            shutting = 0 if loaded else graph.category(appliance).openable and graph.is_shut(appliance)
            costs.append((0.0 if loaded else self.bring(thing, relation, appliance) + shutting, appliance))
        return min(costs, default=(HOPELESS, None))

    def _other(self, thing: str, wish: Wish) -> float:
        """Return the steps to a door or switch, or away from where a thing shall not be."""
        category = self.graph.category(thing)
        if wish.predicate == "open":
            able = category.openable
        elif wish.predicate == "toggled":
            able = category.toggleable
        else:
            node = self.graph.world.nodes[thing]
            return self.take(thing) + 2 if category.liftable and not node.fixed else HOPELESS
        if not able:
            return HOPELESS
        shut_first = wish.predicate == "toggled" and not wish.negated and category.requires_closed
        return self.reach(thing) + 1 + (shut_first and thing in self.graph.flags[Flag.OPEN])


_PLACING = frozenset(
    (_ON, _IN, WITHIN, ON_FLOOR, *(p.value for p in (Predicate.IN_ROOM, Predicate.NEXT_TO, Predicate.UNDER)))
)
