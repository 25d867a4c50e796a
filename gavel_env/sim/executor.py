"""The executor: one house in one episode, with the hidden graph G*, the robot's body and what it has seen.

`Executor.step` runs one primitive: `dynamics` decides whether it is allowed and what it changes, the geometry decides
whether and how far the robot drives, the sensor decides what becomes known. Only what was observed has a name here; an
id that was not observed is an unknown object, whether it exists or not.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from gavel_env.house.floor_map import Indices, floor_map
from gavel_env.house.robot_config import DEFAULT_ROBOT, RobotConfig
from gavel_env.house.scenes import Scene
from gavel_env.sim.places import Places
from gavel_env.sim.robot import Robot
from gavel_env.sim.room_search import RoomSearch, check_search_prior, next_room
from gavel_env.sim.sensor import observed_part, revealed
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import Profile, Violation, ViolationKind, apply, first_violation
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.ontology import Ontology, default_ontology

__all__ = ["Accepts", "EarlyReturn", "Executor", "ObservedState", "Outcome", "Pose"]

Accepts = Callable[[str], bool]
"""Tells of an observed instance id whether it is what a search is for."""


class EarlyReturn(NamedTuple):
    """When a search comes back before it has found what it is for.

    Attributes:
        sees: tells of an instance that has just come into sight whether the search ends there.
        after_room: it comes back after every room that it has searched in vain, if another is left to search.
    """

    sees: Accepts
    after_room: bool


class Outcome(NamedTuple):
    """What one step did.

    Attributes:
        action: the action, its target bound to the instance that was found.
        violation: why it was refused, or None.
        metres: driven in this step.
        route: (n,) flat cells driven over, start and end included; one cell if the robot stood still.
        observed: ids seen for the first time, in the order seen.
        searched: rooms that came to count as searched.
        returned: whether a search came back early, as it was told to, and reached nothing.
    """

    action: Action
    violation: Violation | None
    metres: float
    route: Indices
    observed: tuple[str, ...]
    searched: tuple[str, ...]
    returned: bool = False

    @property
    def ok(self) -> bool:
        """True if the action was carried out, or came back early as it was told to."""
        return self.violation is None


class Pose(NamedTuple):
    """Where the robot is, how far it came, and the floor that it has seen.

    Attributes:
        cell: flat index of the robot's cell.
        heading: radians, clockwise from x.
        metres: driven so far.
        searched: rooms searched.
        seen: (height, width) bool, read-only copy: floor seen so far.
    """

    cell: int
    heading: float
    metres: float
    searched: frozenset[str]
    seen: NDArray[np.bool_]


class ObservedState(NamedTuple):
    """All that the robot knows after a step; nothing in it leads to what is hidden.

    Attributes:
        graph: the hidden graph as far as it was observed; nodes in the order of first sight.
        seen: (height, width) bool, read-only copy: floor seen so far.
        searched: rooms searched, in order.
        cell: flat index of the robot's cell.
        heading: radians, clockwise from x.
        metres: driven so far.
    """

    graph: SceneGraph
    seen: NDArray[np.bool_]
    searched: tuple[str, ...]
    cell: int
    heading: float
    metres: float


class _Returning:
    """Whether a search is to come back early, and whether it did.

    Attributes:
        after_room: as in `EarlyReturn`.
        returned: whether it came back.
    """

    def __init__(self, observed: Mapping[str, None], early: EarlyReturn | None) -> None:
        self._observed = observed
        self._tested = len(observed)
        self._sees = None if early is None else early.sees
        self.after_room = early is not None and early.after_room
        self.returned = False

    def sees(self) -> bool:
        """Test what has come into sight since the last call; return whether the search ends."""
        if self._sees is None:
            return False
        fresh = itertools.islice(self._observed, self._tested, None)
        self.returned = self.returned or any(map(self._sees, fresh))
        self._tested = len(self._observed)
        return self.returned


class Executor:
    """Runs primitives in a hidden house.

    Args:
        scene: the house.
        hidden: G*_0, with every object of the episode placed.
        robot: body, camera and search habits.
        rng: decides where on the floor of a room the movables lie that start there.
        profile: rules profile.
        ontology: which categories can be searched for; default: the shipped one.
    """

    def __init__(
        self,
        scene: Scene,
        hidden: SceneGraph,
        robot: RobotConfig = DEFAULT_ROBOT,
        rng: np.random.Generator | None = None,
        profile: Profile = Profile.PAPER,
        ontology: Ontology | None = None,
    ) -> None:
        self.floor = floor_map(scene, robot)
        self.profile = profile
        self._ontology = ontology or default_ontology()
        self._robot = Robot(self.floor, self._see)
        self._hidden = msgspec.structs.replace(hidden, robot_room=self._robot.room, near=frozenset())
        self.places = Places(self.floor, hidden, rng or np.random.default_rng(0))
        self._observed: dict[str, None] = {}
        self._unseen_spots = dict(self.places.spots)
        self._searched: list[str] = []
        self._early = _Returning(self._observed, None)
        self._robot.scan()
        self._note_searched()
        self._seen = self._seen_floor()
        self._graph = observed_part(self._hidden, self._observed)

    @property
    def hidden(self) -> SceneGraph:
        """Return G*_t: for judging success, for records, and for the oracle's privileged call only."""
        return self._hidden

    @property
    def observed(self) -> ObservedState:
        """Return what the robot knows now."""
        return ObservedState(
            self._graph, self._seen, tuple(self._searched), self._robot.cell, self._robot.heading, self._robot.metres
        )

    @property
    def pose(self) -> Pose:
        """Return where the robot is, how far it came, and the floor that it has seen."""
        robot = self._robot
        return Pose(robot.cell, robot.heading, robot.metres, frozenset(self._searched), self._seen)

    @property
    def graph(self) -> SceneGraph:
        """Return the observed part of G*_t; nodes in the order of first sight."""
        return self._graph

    def step(
        self,
        action: Action,
        search_prior: Mapping[str, float] | None = None,
        accepts: Accepts | None = None,
        early: EarlyReturn | None = None,
    ) -> Outcome:
        """Run one primitive.

        Args:
            action: its target is an observed instance id, or for `NAVIGATE_TO` also a designator (a category or a
                concept, perhaps with a room).
            search_prior: weights over rooms for a search; default: nearest first.
            accepts: what a `NAVIGATE_TO` searches for; default: any instance that fits the target.
            early: when a search comes back before it has found anything; default: never.

        Returns:
            The outcome; a violation changes nothing, except that a search that failed has driven and seen.

        Raises:
            UnknownObject: `search_prior` names a room that the scene does not have.
            BadSearchPrior: a weight is negative or not finite.
        """
        if search_prior is not None:
            check_search_prior(self.floor, search_prior)
        before = len(self._observed), len(self._searched), self._robot.metres
        self._early = _Returning(self._observed, early)
        if action.primitive is Primitive.NAVIGATE_TO:
            bound, violation = self._navigate(action, search_prior or {}, accepts)
            self._seen = self._seen_floor()
        else:
            bound, violation = action, self._refusal(action)
        moved = self._robot.metres > before[2]
        reached = violation is None and not self._early.returned
        if reached:
            self._change(bound)
        elif moved:
            self._leave_near()
        fresh: tuple[str, ...] = ()
        if len(self._observed) > before[0]:
            fresh = tuple(itertools.islice(self._observed, before[0], None))
            self._graph = observed_part(self._hidden, self._observed)
        elif reached:
            self._graph = apply(self._graph, bound)
        return Outcome(
            bound,
            violation,
            self._robot.metres - before[2],
            self._robot.take_trail(),
            fresh,
            tuple(self._searched[before[1] :]),
            self._early.returned,
        )

    def reveal(self) -> None:
        """Observe everything: what the oracle's privileged call does, and nothing else."""
        self._observe(self._hidden.world.nodes)
        self._graph = observed_part(self._hidden, self._observed)

    def measured_distance_m(self, obj: str) -> float:
        """Return the distance that `near` is measured by, in metres; 0 for what is in the hand."""
        return self.places.distance_m(self._hidden, obj, self._robot.cell)

    def position(self, obj: str) -> tuple[float, float]:
        """Return x, y in metres of what holds an object up: its nearest fixed holder, its floor cell, or the robot."""
        return self.places.position(self._hidden, obj, self._robot.cell)

    def stances(self, obj: str) -> Indices:
        """Return the cells to work on an object from, (n,) flat; empty if the robot cannot get at it."""
        return self.places.stances(self._hidden, obj, self._robot.cell)

    # --- preconditions and effects -------------------------------------------------------------------------------

    def _refusal(self, action: Action) -> Violation | None:
        target = action.target
        known = target is None or target in self._observed or target in self._hidden.world.rooms
        if not known and action.primitive.takes_target:
            return Violation(ViolationKind.UNKNOWN_OBJECT, target or "")
        return first_violation(self._hidden, action, self.profile)

    def _change(self, action: Action) -> None:
        """Apply an allowed action to the hidden graph, note where things lie, and look into what was opened."""
        held = self._hidden.holding
        self._hidden = apply(self._hidden, action)
        if action.primitive is Primitive.GRASP and action.target is not None:
            self.places.spots.pop(action.target, None)
        elif action.primitive is Primitive.RELEASE and held is not None:
            self.places.spots[held] = self._robot.cell
        elif action.primitive is Primitive.OPEN and action.target is not None:
            self._observe(revealed(self._hidden, action.target))

    def _leave_near(self) -> None:
        """Update both graphs after a drive that ended nowhere in particular."""
        held = self._hidden.holding
        near = frozenset() if held is None else frozenset((held, *self._hidden.descendants(held)))
        self._hidden = msgspec.structs.replace(self._hidden, near=near, robot_room=self._robot.room)
        seen_near = frozenset(obj for obj in near if obj in self._observed)
        self._graph = msgspec.structs.replace(self._graph, near=seen_near, robot_room=self._robot.room)

    # --- driving -------------------------------------------------------------------------------------------------

    def _navigate(
        self, action: Action, prior: Mapping[str, float], accepts: Accepts | None
    ) -> tuple[Action, Violation | None]:
        target = action.target or ""
        if accepts is None and target in self._observed:
            return action, self._go_to_one_of((target,))[1]
        if accepts is None and target in self._hidden.world.rooms:
            return action, Violation(ViolationKind.ROOM_TARGET, target)
        category, _, room = target.partition("@")
        if accepts is None and not self._ontology.knows(category):
            return action, Violation(ViolationKind.UNKNOWN_OBJECT, target)
        rooms = [r.id for r in self._hidden.world.rooms.values() if not room or r.fits(room)]
        if accepts is None:
            accepts = self._fits(category, rooms)
        known = [obj for obj in self._observed if accepts(obj)]
        if not any(self.stances(obj).size for obj in known):
            self._search(accepts, prior, rooms)
            known = [obj for obj in self._observed if accepts(obj)]
        if self._early.returned:
            return action, None
        if not known:
            return action, Violation(ViolationKind.NOT_FOUND, target)
        reached, violation = self._go_to_one_of(known)
        return Action(Primitive.NAVIGATE_TO, reached or target), violation

    def _fits(self, category: str, rooms: Collection[str]) -> Accepts:
        """Return the default test of a search: any instance of the category or concept in one of the rooms."""
        return lambda obj: self._hidden.world.nodes[obj].category.is_a(category) and self._hidden.room_of(obj) in rooms

    def _go_to_one_of(self, candidates: Iterable[str]) -> tuple[str | None, Violation | None]:
        """Drive to the nearest stance of any accessible candidate; return which, or why none can be gone to."""
        refused: Violation | None = None
        stances: dict[str, Indices] = {}
        for obj in candidates:
            violation = first_violation(self._hidden, Action(Primitive.NAVIGATE_TO, obj), self.profile)
            if violation is None:
                stances[obj] = self.stances(obj)
            refused = refused or violation
        if not stances:
            return None, refused
        route = self.floor.route(self._robot.cell, np.concatenate(list(stances.values())))
        if route is None:
            obj = next(iter(stances))
            return obj, Violation(ViolationKind.UNREACHABLE, obj)
        reached = next(obj for obj, cells in stances.items() if route.cells[-1] in cells)
        self._robot.drive(route)
        self._robot.scan()
        self._note_searched()
        return reached, None

    def _search(self, accepts: Accepts, prior: Mapping[str, float], rooms: Collection[str]) -> None:
        """Search room after room until an accepted instance that can be got at is seen, or all rooms are searched."""
        tested = len(self._observed)
        found = False

        def is_found() -> bool:
            nonlocal tested, found
            fresh = itertools.islice(self._observed, tested, None)
            found = found or any(accepts(obj) and self.stances(obj).size for obj in fresh)
            tested = len(self._observed)
            return found

        while (room := next_room(self.floor, self._robot.cell, self._searched, prior, rooms)) is not None:
            search = RoomSearch(self._robot.sensor, room)

            def stop(search: RoomSearch = search) -> bool:
                return is_found() or self._early.sees() or search.settled()

            while (route := search.next_route(self._robot.cell)) is not None:
                self._robot.drive(route, stop)
                if not is_found() and not self._early.sees():
                    self._robot.scan()
                    search.looked(self._robot.cell)
                if is_found() or self._early.sees():
                    break
            self._note_searched()
            if found:
                self._early.returned = False
                return
            if self._early.returned:
                return
            if room not in self._searched:
                self._searched.append(room)
            if self._early.after_room:
                left = next_room(self.floor, self._robot.cell, self._searched, prior, rooms)
                self._early.returned = left is not None
                return

    # --- seeing --------------------------------------------------------------------------------------------------

    def _seen_floor(self) -> NDArray[np.bool_]:
        """Copy the floor seen so far; only drives change it."""
        seen = self._robot.sensor.seen.copy()
        seen.flags.writeable = False
        return seen

    def _see(self, pieces: Iterable[str]) -> None:
        """Observe pieces with all that is seen with them, and what lies on floor that has come into view."""
        for piece in pieces:
            for _, holder in self._hidden.holders(piece):
                self._observed.setdefault(holder)
            self._observe(revealed(self._hidden, piece))
        if self._unseen_spots:
            spots = np.array(list(self._unseen_spots.values()), np.int32)
            saw = self._robot.sensor.saw_floor_near(spots)
            for obj in [o for o, shown in zip(self._unseen_spots, saw, strict=True) if shown]:
                del self._unseen_spots[obj]
                self._observe(revealed(self._hidden, obj))

    def _observe(self, objects: Iterable[str]) -> None:
        for obj in objects:
            self._observed.setdefault(obj)

    def _note_searched(self) -> None:
        for room in self.floor.room_ids:
            if room not in self._searched and self._robot.sensor.is_complete(room):
                self._searched.append(room)
