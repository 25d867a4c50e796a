"""The executor: one house in one episode, with the hidden graph G*, the robot's body and what it has seen.

`Executor.step` runs one primitive: `dynamics` decides whether it is allowed and what it changes, the geometry decides
whether and how far the robot drives, the sensor decides what becomes known. Only what was observed has a name here; an
id that was not observed is an unknown object, whether it exists or not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from gavel_env.actions import Action, Primitive
from gavel_env.config import DEFAULT_ROBOT, RobotConfig
from gavel_env.dynamics import Profile, Violation, ViolationKind, apply, first_violation
from gavel_env.geometry import Indices, Route, floor_map
from gavel_env.graph import Relation, SceneGraph, World
from gavel_env.scenes import Scene
from gavel_env.search import RoomSearch, check_search_prior, next_room
from gavel_env.sensor import Sensor, revealed

__all__ = ["Accepts", "Executor", "ObservedState", "Outcome"]

Accepts = Callable[[str], bool]
"""Tells of an observed instance id whether it is what a search is for."""


class Outcome(NamedTuple):
    """What one step did.

    Attributes:
        action: the action, its target bound to the instance that was found.
        violation: why it was refused, or None.
        metres: driven in this step.
        route: (n,) flat cells driven over, start and end included; one cell if the robot stood still.
        observed: ids seen for the first time, in the order seen.
        searched: rooms that came to count as searched.
    """

    action: Action
    violation: Violation | None
    metres: float
    route: Indices
    observed: tuple[str, ...]
    searched: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """True if the action was carried out."""
        return self.violation is None


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


class Executor:
    """Runs primitives in a hidden house.

    Args:
        scene: the house.
        hidden: G*_0, with every object of the episode placed.
        robot: body, camera and search habits.
        rng: decides where on the floor of a room the movables lie that start there.
        profile: rules profile.
    """

    def __init__(
        self,
        scene: Scene,
        hidden: SceneGraph,
        robot: RobotConfig = DEFAULT_ROBOT,
        rng: np.random.Generator | None = None,
        profile: Profile = Profile.PAPER,
    ) -> None:
        self.floor = floor_map(scene, robot)
        self.profile = profile
        self.sensor = Sensor(self.floor)
        self.cell = self.floor.start
        self.heading = 0.0
        self.metres = 0.0
        self.searched: list[str] = []
        self._hidden = msgspec.structs.replace(hidden, robot_room=self._room(), near=frozenset())
        self._spots = self._floor_spots(rng or np.random.default_rng(0))
        self._observed: dict[str, None] = {}
        self._unseen_spots = dict(self._spots)
        self._driven: list[Indices] = []
        self._stand_and_scan()
        self._note_searched()
        self._graph = self._project()

    @property
    def hidden(self) -> SceneGraph:
        """Return G*_t: for judging success, for records, and for the oracle's privileged call only."""
        return self._hidden

    @property
    def observed(self) -> ObservedState:
        """Return what the robot knows now."""
        seen = self.sensor.seen.copy()
        seen.flags.writeable = False
        return ObservedState(self._graph, seen, tuple(self.searched), self.cell, self.heading, self.metres)

    @property
    def graph(self) -> SceneGraph:
        """Return the observed part of G*_t; nodes in the order of first sight."""
        return self._graph

    def step(
        self, action: Action, search_prior: Mapping[str, float] | None = None, accepts: Accepts | None = None
    ) -> Outcome:
        """Run one primitive.

        Args:
            action: its target is an observed instance id, or for `NAVIGATE_TO` also a category.
            search_prior: weights over rooms for a search; default: nearest first.
            accepts: what a `NAVIGATE_TO` searches for; default: any instance of the target's category.

        Returns:
            The outcome; after a violation the graph is unchanged, but a search that failed has driven and seen.

        Raises:
            UnknownObject: `search_prior` names a room that the scene does not have.
            BadSearchPrior: a weight is negative or not finite.
        """
        if search_prior is not None:
            check_search_prior(self.floor, search_prior)
        before = len(self._observed), len(self.searched), self.metres
        self._driven = [np.array([self.cell], np.int32)]
        if action.primitive is Primitive.NAVIGATE_TO:
            bound, violation = self._navigate(action, search_prior or {}, accepts)
        else:
            bound, violation = action, self._refusal(action)
        moved = self.metres > before[2]
        if violation is None:
            self._change(bound)
        elif moved:
            self._leave_near()
        if len(self._observed) > before[0]:
            self._graph = self._project()
        return Outcome(
            bound,
            violation,
            self.metres - before[2],
            np.concatenate([self._driven[0], *(cells[1:] for cells in self._driven[1:])]),
            tuple(self._observed)[before[0] :],
            tuple(self.searched[before[1] :]),
        )

    def measured_distance_m(self, obj: str) -> float | None:
        """Return the distance that `near` is measured by, or None if nothing fixed says where the object is.

        From the robot's centre to the footprint of the object's nearest fixed holder (itself, for furniture), or to its
        spot on the floor; 0 for what is in the hand.
        """
        anchor = self._anchor(obj)
        x, y = self.floor.point(self.cell)
        if anchor is None:
            return 0.0
        if isinstance(anchor, int):
            spot_x, spot_y = self.floor.point(anchor)
            return math.hypot(x - spot_x, y - spot_y)
        cell_m = self.floor.robot.cell_m
        centre_x, centre_y, cosine, sine, half_depth, half_width = self.floor.rectangle(anchor)
        row, column = self.floor.cell(self.cell)
        dx, dy = column + 0.5 - centre_x, row + 0.5 - centre_y
        along = max(0.0, abs(dx * cosine + dy * sine) - half_depth)
        across = max(0.0, abs(dy * cosine - dx * sine) - half_width)
        return math.hypot(along, across) * cell_m

    def stances(self, obj: str) -> Indices:
        """Return the cells to work on an object from, (n,) flat; the robot's own for what is in the hand."""
        anchor = self._anchor(obj)
        if anchor is None:
            return np.array([self.cell], np.int32)
        return self.floor.stances_at(anchor) if isinstance(anchor, int) else self.floor.stances(anchor)

    # --- preconditions and effects -------------------------------------------------------------------------------

    def _refusal(self, action: Action) -> Violation | None:
        target = action.target
        known = target is None or target in self._observed or target in self._hidden.world.rooms
        if not known and action.primitive.takes_target:
            return Violation(ViolationKind.UNKNOWN_OBJECT, target or "")
        return first_violation(self._hidden, action, self.profile)

    def _change(self, action: Action) -> None:
        """Apply an allowed action to the hidden and the observed graph, and look into what was opened."""
        held = self._hidden.holding
        self._hidden = apply(self._hidden, action)
        self._graph = apply(self._graph, action)
        if action.primitive is Primitive.GRASP and action.target is not None:
            self._spots.pop(action.target, None)
        elif action.primitive is Primitive.RELEASE and held is not None:
            self._spots[held] = self.cell
        elif action.primitive is Primitive.OPEN and action.target is not None:
            self._observe(revealed(self._hidden, action.target))

    def _leave_near(self) -> None:
        """Update both graphs after a drive that ended nowhere in particular."""
        held = self._hidden.holding
        near = frozenset() if held is None else frozenset((held, *self._hidden.descendants(held)))
        self._hidden = msgspec.structs.replace(self._hidden, near=near, robot_room=self._room())
        seen_near = frozenset(obj for obj in near if obj in self._observed)
        self._graph = msgspec.structs.replace(self._graph, near=seen_near, robot_room=self._room())

    # --- driving -------------------------------------------------------------------------------------------------

    def _navigate(
        self, action: Action, prior: Mapping[str, float], accepts: Accepts | None
    ) -> tuple[Action, Violation | None]:
        target = action.target or ""
        if accepts is None and target in self._observed:
            return action, self._go_to_one_of((target,))[1]
        if accepts is None and target in self._hidden.world.rooms:
            return action, Violation(ViolationKind.ROOM_TARGET, target)
        if accepts is None:
            accepts = self._category_test(target)
            if accepts is None:
                return action, Violation(ViolationKind.UNKNOWN_OBJECT, target)
        known = [obj for obj in self._observed if accepts(obj)] or self._search(accepts, prior)
        if not known:
            return action, Violation(ViolationKind.NOT_FOUND, target)
        reached, violation = self._go_to_one_of(known)
        return Action(Primitive.NAVIGATE_TO, reached or target), violation

    def _category_test(self, target: str) -> Accepts | None:
        """Return the default test of a search: any instance of the category; None if there is no such category."""
        from gavel_env.ontology import default_ontology

        if target not in default_ontology() and target not in self._hidden.world.by_category:
            return None
        return lambda obj: self._hidden.world.nodes[obj].category.name == target

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
        route = self.floor.route(self.cell, np.concatenate(list(stances.values())))
        if route is None:
            obj = next(iter(stances))
            return obj, Violation(ViolationKind.UNREACHABLE, obj)
        reached = next(obj for obj, cells in stances.items() if route.cells[-1] in cells)
        self._drive(route)
        self._stand_and_scan()
        self._note_searched()
        return reached, None

    def _search(self, accepts: Accepts, prior: Mapping[str, float]) -> list[str]:
        """Search room after room until an accepted instance is seen; return those seen, empty if there is none."""
        tested = len(self._observed)
        found: list[str] = []

        def is_found() -> bool:
            nonlocal tested
            found.extend(obj for obj in tuple(self._observed)[tested:] if accepts(obj))
            tested = len(self._observed)
            return bool(found)

        while (room := next_room(self.floor, self.cell, self.searched, prior)) is not None:
            search = RoomSearch(self.sensor, room)

            def stop(search: RoomSearch = search) -> bool:
                return is_found() or search.settled()

            while (route := search.next_route(self.cell)) is not None:
                self._drive(route, stop)
                if is_found():
                    break
                self._stand_and_scan()
                search.looked(self.cell)
                if is_found():
                    break
            self._note_searched()
            if found:
                return found
            if room not in self.searched:
                self.searched.append(room)
        return found

    def _drive(self, route: Route, stop: Callable[[], bool] | None = None) -> None:
        """Drive along a route with a picture every `camera_every_m`; `stop` may end the drive after each picture."""
        cells = route.cells
        if len(cells) == 1:
            return
        rows, columns = np.divmod(cells, self.floor.shape[1])
        headings = np.arctan2(np.diff(rows), np.diff(columns))
        steps_m = np.hypot(np.diff(rows), np.diff(columns)) * self.floor.robot.cell_m
        driven_m = np.concatenate([[0.0], np.cumsum(steps_m)])
        every_m = self.floor.robot.camera_every_m
        pictures = np.searchsorted(driven_m, np.arange(every_m, driven_m[-1], every_m) - 1e-9)
        end = len(cells) - 1
        for i in pictures:
            if i >= end:
                break
            self._see(self.sensor.look(int(cells[i]), float(headings[i - 1])))
            if stop is not None and stop():
                end = int(i)
                break
        self._driven.append(cells[: end + 1])
        self.metres += self.floor.length_m(cells[: end + 1])
        self.cell = int(cells[end])
        self.heading = float(headings[end - 1])

    # --- seeing --------------------------------------------------------------------------------------------------

    def _stand_and_scan(self) -> None:
        self._see(self.sensor.scan(self.cell, self.heading))

    def _see(self, pieces: Iterable[str]) -> None:
        """Observe pieces with all that is seen with them, and what lies on floor that has come into view."""
        for piece in pieces:
            for _, holder in self._hidden.holders(piece):
                self._observed.setdefault(holder)
            self._observe(revealed(self._hidden, piece))
        if self._unseen_spots:
            for obj in [o for o, spot in self._unseen_spots.items() if self.sensor.saw_floor_near(spot)]:
                del self._unseen_spots[obj]
                self._observe(revealed(self._hidden, obj))

    def _observe(self, objects: Iterable[str]) -> None:
        for obj in objects:
            self._observed.setdefault(obj)

    def _note_searched(self) -> None:
        for room in self.floor.room_ids:
            if room not in self.searched and self.sensor.is_complete(room):
                self.searched.append(room)

    def _project(self) -> SceneGraph:
        """Return the hidden graph restricted to the observed ids."""
        hidden, observed = self._hidden, self._observed
        world = hidden.world
        contents = {
            holder: kept
            for holder, held in hidden.contents.items()
            if holder in observed and (kept := tuple(o for o in held if o in observed))
        }
        return SceneGraph(
            World.of(world.rooms, world.connections, {obj: world.nodes[obj] for obj in observed}),
            {obj: hidden.supports[obj] for obj in observed},
            contents,
            tuple(frozenset(o for o in flagged if o in observed) for flagged in hidden.flags),
            frozenset(o for o in hidden.near if o in observed),
            hidden.holding,
            hidden.robot_room,
            frozenset(pair for pair in hidden.next_to if pair[0] in observed and pair[1] in observed),
        )

    # --- places --------------------------------------------------------------------------------------------------

    def _room(self) -> str | None:
        return self.floor.room_of(self.cell)

    def _anchor(self, obj: str) -> str | int | None:
        """Return what fixes an object's place: its nearest fixed holder or itself, a floor cell, or None = the hand."""
        nodes = self._hidden.world.nodes
        while not nodes[obj].fixed:
            relation, holder = self._hidden.supports[obj]
            if relation is Relation.HELD:
                return None
            if relation is Relation.FLOOR:
                return self._spots[obj]
            obj = holder
        return obj

    def _floor_spots(self, rng: np.random.Generator) -> dict[str, int]:
        """Choose where the movables lie that start on the floor: a reachable cell of their room."""
        spots: dict[str, int] = {}
        for obj, (relation, room) in sorted(self._hidden.supports.items()):
            if relation is Relation.FLOOR and not self._hidden.world.nodes[obj].fixed:
                cells = self.floor.room_cells[room]
                if cells.size == 0:
                    cells = np.nonzero((self.floor.rooms == self.floor.room_index[room]).ravel())[0].astype(np.int32)
                spots[obj] = int(rng.choice(cells))
        return spots
