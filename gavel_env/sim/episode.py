"""One episode: an instruction in its house, the executor that runs it, and the judge of the hidden graph.

Whoever holds an `Episode` can reach the hidden world; agents never do. They are given `Episode.observed`.
"""

from __future__ import annotations

import math
import operator
from typing import NamedTuple

import msgspec
import numpy as np

from gavel_env.errors import GavelError, UnknownObject
from gavel_env.exchange import EnvAction, Observed, ReturnWhen
from gavel_env.frozen import frozen
from gavel_env.house.floor_map import FloorMap, known_layout
from gavel_env.house.robot_config import RobotConfig
from gavel_env.house.scenes import Scene, load_scene
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.record import Instruction
from gavel_env.sim.executor import Accepts, EarlyReturn, Executor, Outcome
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import Profile, Violation, unsafe
from gavel_env.world_model.goals import Designator, Goal, fitting, unmet
from gavel_env.world_model.graph import Flag, SceneGraph
from gavel_env.world_model.ontology import Ontology
from gavel_env.world_model.verdict import shortfall

__all__ = ["Episode", "Judgement", "Privileged"]


class Judgement(NamedTuple):
    """Whether the hidden world is as the instruction asks.

    Attributes:
        success: no violation, nothing unmet, nothing unsafe.
        violation: the violation that ended the episode, or None.
        unmet: goal conditions that do not hold, in text form.
        unsafe: what was left open or on, as literals.
        metres: driven.
    """

    success: bool
    violation: Violation | None
    unmet: tuple[str, ...]
    unsafe: tuple[str, ...]
    metres: float


class Privileged(NamedTuple):
    """The hidden state, for the oracle and for records.

    Attributes:
        graph: G*_t.
        instruction: the whole record, with placements and reference plans.
        scene: the house with its furniture.
        floor: the map with its furniture.
        cell: flat map cell of the robot.
        executor: the running executor; stepping it changes the episode.
    """

    graph: SceneGraph
    instruction: Instruction
    scene: Scene
    floor: FloorMap
    cell: int
    executor: Executor


class Episode:
    """A running episode.

    Args:
        instruction: what to do, and where everything starts.
        profile: rules profile.
        robot: body, camera and search habits.
        ontology: affordances.
        rng: decides where on a room's floor the movables lie that start there.

    Raises:
        InstructionError: a placement does not fit, or a goal holds at the start.
        UnknownScene, SceneError: the scene is not there or malformed.
    """

    def __init__(
        self,
        instruction: Instruction,
        *,
        profile: Profile,
        robot: RobotConfig,
        ontology: Ontology,
        rng: np.random.Generator,
    ) -> None:
        self.instruction = instruction
        self.scene = load_scene(instruction.scene)
        hidden = instruction_graph(self.scene, instruction, ontology)
        self.executor = Executor(self.scene, hidden, robot, rng, profile, ontology)
        self.layout = known_layout(self.scene, robot)
        self.goal: Goal = instruction.goal()
        self.start = self.executor.hidden
        self.violation: Violation | None = None
        self._ontology = ontology
        self._doubted = 0
        self._failed_on: tuple[object, ...] | None = None
        self._each = tuple(Goal((literal,)) for literal in self.goal.literals)
        self._positions: dict[str, tuple[float, float]] = {}
        self._plain: SceneGraph | None = None
        self.observed = self._view("", None)

    # --- acting --------------------------------------------------------------------------------------------------

    def step(self, action: EnvAction, excluded_rooms: frozenset[str] = frozenset()) -> Outcome:
        """Run one action; `excluded_rooms` are rooms whose instances a designator does not mean.

        Raises:
            UnknownObject: the search prior names no room of the scene, `return_when` a category of no ontology.
            BadSearchPrior: a weight is negative or not finite.
            MalformedGoal: `return_when` has something else than designators.
        """
        bound, accepts = self._bind(action, excluded_rooms)
        outcome = self.executor.step(bound, action.search_prior, accepts, self._early(action.return_when))
        self.violation = self.violation or outcome.violation
        went = outcome.ok and not outcome.returned and outcome.action.primitive is Primitive.NAVIGATE_TO
        kind = "ok" if outcome.violation is None else outcome.violation.kind.value
        self.observed = self._view(kind, outcome.action.target if went else None)
        return outcome

    def _bind(self, action: EnvAction, excluded_rooms: frozenset[str]) -> tuple[Action, Accepts | None]:
        """Return the action, its target bound if it can be now, and the test of what a search is for."""
        plain = Action(action.primitive, action.target)
        world = self.observed.graph.world
        if action.target is None or action.target in world.nodes or action.target in world.rooms:
            return plain, None
        try:
            designator = Designator.parse(action.target)
        except GavelError:
            return plain, None
        accepts = self._acceptance(designator, action.other_than, excluded_rooms)
        if action.primitive is Primitive.NAVIGATE_TO:
            return plain, accepts if self._ontology.knows(designator.name) else None
        found = [obj for obj in fitting(self.observed.graph, designator) if accepts(obj)]
        found.sort(key=lambda obj: (obj not in self.observed.graph.near, obj == self.observed.graph.holding))
        return (Action(action.primitive, found[0]) if found else plain), None

    def _early(self, when: ReturnWhen | None) -> EarlyReturn | None:
        """Return the tests of an early return.

        Raises:
            UnknownObject: something that should be seen is of no category of the ontology.
            MalformedGoal: or is not of the form of a designator.
        """
        if when is None:
            return None
        designators = [Designator.parse(text) for text in when.seen]
        for wanted in designators:
            if not self._ontology.knows(wanted.name):
                raise UnknownObject(wanted.name, tuple(self._ontology), "return_when.seen (categories)")
        tests = [self._acceptance(wanted, (), frozenset()) for wanted in designators]
        return EarlyReturn(lambda obj: any(fits(obj) for fits in tests), when.room_done)

    def _acceptance(
        self, designator: Designator, other_than: tuple[str, ...], excluded_rooms: frozenset[str]
    ) -> Accepts:
        def accepts(obj: str) -> bool:
            graph = self.executor.hidden
            if not graph.category(obj).is_a(designator.name) or obj in other_than:
                return False
            if designator.room is None and not excluded_rooms:
                return True
            room = graph.room_of(obj)
            if room is None or room in excluded_rooms:
                return False
            return designator.room is None or graph.world.rooms[room].fits(designator.room)

        return accepts

    # --- seeing --------------------------------------------------------------------------------------------------

    def _view(self, outcome: str, reached: str | None) -> Observed:
        pose, graph = self.executor.pose, self.executor.graph
        return Observed(
            instruction=self.instruction.text,
            graph=self._frozen(graph),
            layout=self.layout,
            positions=frozen(self._place(graph)),
            cell=pose.cell,
            heading_deg=math.degrees(pose.heading),
            seen=pose.seen,
            searched=pose.searched,
            metres=pose.metres,
            outcome=outcome,
            reached=reached,
        )

    def _frozen(self, graph: SceneGraph) -> SceneGraph:
        """Return the graph as agents get it: the same, and nothing in it can be changed."""
        if graph is self._plain:
            return self.observed.graph
        last = self.observed.graph if self._plain is not None else None
        unmoved = last is not None and self._plain is not None and graph.supports is self._plain.supports
        self._plain = graph
        return msgspec.structs.replace(
            graph,
            supports=last.supports if unmoved and last is not None else frozen(graph.supports),
            contents=frozen(graph.contents),
        )

    def _place(self, graph: SceneGraph) -> dict[str, tuple[float, float]]:
        """Return where every observed object is; only what is new, carried or just put down is looked up."""
        last = self.observed.graph if self._positions else None
        moved: set[str] = set()
        for held in {graph.holding, None if last is None else last.holding} - {None}:
            assert held is not None
            moved.update((held, *graph.descendants(held)))
        fresh = list(moved)
        if len(graph.world.nodes) > len(self._positions):
            fresh += [obj for obj in graph.world.nodes if obj not in self._positions]
        if fresh:
            self._positions = self._positions | {obj: self.executor.position(obj) for obj in fresh}
        return self._positions

    # --- judging -------------------------------------------------------------------------------------------------

    def judge(self, *, violations_count: bool = True) -> Judgement:
        """Return the judgement of the hidden graph as it stands; `violations_count`: a refused action is a failure."""
        hidden = self.executor.hidden
        lacking = shortfall(self.start, hidden, self.goal)
        violation = self.violation if violations_count else None
        return Judgement(
            success=violation is None and not lacking,
            violation=violation,
            unmet=tuple(map(str, lacking.unmet)),
            unsafe=tuple(f"{'open' if flag is Flag.OPEN else 'toggled'}({obj})" for flag, obj in lacking.unsafe),
            metres=self.executor.pose.metres,
        )

    def succeeded(self) -> bool:
        """Return whether everything is met and safe, quickly.

        The literal that failed last is looked at first, and only if something that it depends on has changed.
        """
        hidden = self.executor.hidden
        literals = self.goal.literals
        if self._failed_on is not None and all(map(operator.is_, self._failed_on, self._basis(hidden))):
            return False
        first = self._doubted
        for offset in range(len(literals)):
            self._doubted = (first + offset) % len(literals)
            if unmet(self._each[self._doubted], hidden):
                self._failed_on = self._basis(hidden)
                return False
        self._failed_on = None
        return not unmet(self.goal, hidden) and not unsafe(self.start, hidden, self.goal)

    def _basis(self, graph: SceneGraph) -> tuple[object, ...]:
        """Return the parts of a graph that decide about the literal that failed last."""
        flag = self.goal.literals[self._doubted].predicate.flag
        flagged = None if flag is None else graph.flags[flag]
        return graph.supports, graph.next_to, graph.robot_room, flagged

    def reveal(self) -> Privileged:
        """Make every object observed, and return the hidden state."""
        self.executor.reveal()
        self.observed = self._view("", None)
        return self.privileged()

    def privileged(self) -> Privileged:
        """Return the hidden state."""
        executor = self.executor
        return Privileged(executor.hidden, self.instruction, self.scene, executor.floor, self.observed.cell, executor)
