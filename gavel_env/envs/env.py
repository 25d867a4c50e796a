"""The Gymnasium environments: instructions carried out in partially observed houses."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal

import gymnasium as gym
import msgspec
import numpy as np

from gavel_env.data import convert
from gavel_env.envs.action_codec import ActionCodec
from gavel_env.envs.graph_encoder import GraphEncoder
from gavel_env.envs.rewards import RewardWeights
from gavel_env.envs.spaces import MAX_INSTRUCTION, observation_space
from gavel_env.envs.unicode_text import is_unicode
from gavel_env.errors import (
    BadAction,
    BadEnvironmentOption,
    GavelError,
    InstructionError,
    ResetNeeded,
    UnknownInstruction,
)
from gavel_env.exchange import EnvAction, Observation, Observed, ReturnWhen
from gavel_env.house.robot_config import DEFAULT_ROBOT, RobotConfig
from gavel_env.house.scenes import BENCHMARK_HOUSES, load_scene
from gavel_env.instructions.record import Instruction, parse_instruction
from gavel_env.instructions.sources import InstructionSource, gather
from gavel_env.sim.episode import Episode, Judgement, Privileged
from gavel_env.world_model.actions import Primitive
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.ontology import default_ontology

if TYPE_CHECKING:
    from gavel_env.envs.frames import EpisodeCamera

__all__ = ["BadEnvironmentOption", "GavelEnv"]


_FEWEST_NODES = 512


class GavelEnv(gym.Env[dict[str, Any], Any]):
    """A robot carries out an instruction in a house that it has not seen.

    ## Description

    The house is one of the BEHAVIOR-1K scenes. The robot knows its rooms, walls and doorways, but not what is in it: it
    sees what its camera sees, and goes and finds the rest. It acts through the nine primitives of the paper, and the
    cost is the metres that it drives.

    ## Action Space

    `Dict(primitive, target, search_prior)`

    | key | space | meaning |
    |---|---|---|
    | `primitive` | `Discrete(9)` | `gavel_env.Primitive` |
    | `target` | `Discrete(max_nodes + categories)` | a node of the observed graph, or `max_nodes` + a category |
    | `search_prior` | `Box(-1, 1, (64,))` | one weight per room, in the order of the graph's room nodes |

    A category that `NavigateTo` is given stands for the nearest known instance; if none is known, the robot goes and
    finds one: rooms by descending weight, equal ones by distance. A room with a negative weight is not meant: instances
    in it are neither gone to nor searched for first. For the other primitives a category stands for an observed
    instance, one that is near if there is any.

    `step` also takes a `gavel_env.EnvAction`, which says the same in names: an observed id or a designator
    (`fridge`, `bottom_cabinet@private_office`, or `any_cabinet@any_office`, of which any category and room will do),
    weights by room id, and ids that are not meant. `encode` turns one into the dict form, `decode` turns it back;
    concepts have no number in it.

    An `EnvAction` may also say when a search comes back before it has found anything (`return_when`): where something
    else that is wanted comes into sight, or after every room. Such a step is "ok", costs what it has driven, reaches
    nothing, and once the robot has moved it is near nothing but what it holds.

    ## Observation Space

    `Dict`; `observation="symbolic"` leaves out `graph` and is faster.

    | key | space | meaning |
    |---|---|---|
    | `graph` | `Graph` | the robot (node 0), the rooms, then objects in the order of first sight |
    | `holding` | `Discrete` | node of the held object; 0 = nothing |
    | `instruction` | `Text` | the sentences to carry out |
    | `metres` | `Box(1)` | driven so far |
    | `outcome` | `Discrete` | index in `OUTCOMES`: of the last action, "" before the first |
    | `pose` | `Box(4)` | x, y in metres, cosine and sine of the heading |
    | `room` | `Discrete(65)` | index of the robot's room; 64 = none |
    | `searched` | `MultiBinary(64)` | rooms searched completely |

    Columns of a node: `gavel_env.envs.spaces.NODE_COLUMNS`; relations of the edges: `EdgeType`. A category is its index
    in the ontology.

    The dict is a `gavel_env.Observation`: its attribute `observed` is the same as a frozen `gavel_env.Observed`, with
    the observed `SceneGraph` and the map of the rooms. Nothing in either names an object that has not been observed.

    ## Starting State

    `reset(seed=...)` draws an instruction; `reset(options={"instruction": X})` takes one by id, or a whole record. The
    movables are where the record puts them, the robot stands at the middle of the largest connected floor and has
    looked around once.

    ## Rewards

    `success * [succeeded] - metre * metres - violation * [invalid]`; weights: `RewardWeights`, by default 1, 0.01, 0.1.

    ## Episode End

    Terminated when the instruction is carried out (`terminate_on_success`): every goal literal holds in the hidden
    world, doors that were opened are shut, safety-critical appliances that were switched on are off. Terminated by a
    invalid action with `on_violation="terminate"`; with `"noop"` an invalid action changes nothing and costs reward.
    Truncated after 200 steps (500 for several tasks), by Gymnasium's `TimeLimit`.

    ## Information

    | key | meaning |
    |---|---|
    | `observed` | the agent's view, as in the observation |
    | `outcome` | "ok", the kind of the violation, or "" after `reset` |
    | `violation` | `Violation` with kind, subject and blocker, or None |
    | `action` | the action as text, its target bound to what was found |
    | `metres`, `step_metres` | driven so far, and in this step |
    | `route` | map cells driven over in this step |
    | `seen` | ids observed for the first time |
    | `steps`, `instruction_id`, `scene` | as they say |
    | `success` | only with `terminate_on_success`: whether the episode ended successfully |

    ## Arguments

    Args:
        instructions: name of a shipped file ("single", "multi", "behavior"), path of a JSON Lines file, or records.
        scenes: keep only the instructions in this scene, or in these.
        profile: rules profile, "paper" or "omnigibson".
        robot: fields of `RobotConfig` that differ from the default.
        on_violation: "terminate" (benchmarks) or "noop" (learning).
        terminate_on_success: end as soon as the instruction is carried out; False: go on, and ask `judge()` at the end.
        reward: fields of `RewardWeights` that differ from the default.
        observation: "graph" or "symbolic".
        max_nodes: most nodes of the graph; larger scenes are an error at `reset`. Default: 512, or as many times its
            double as the largest of the instructions' scenes needs.
        render_mode: "rgb_array" (the house from above) or "ansi" (a text).

    ## Version History

    - v0: first version. Added since, without effect on what was there: `EnvAction.return_when`, `Observed.seen`.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  # as the base class declares it
        "render_modes": ["rgb_array", "ansi"],
        "render_fps": 2,
    }

    def __init__(
        self,
        instructions: InstructionSource = "single",
        *,
        scenes: str | Iterable[str] | None = None,
        profile: Profile | str = Profile.PAPER,
        robot: RobotConfig | Mapping[str, Any] | None = None,
        on_violation: Literal["terminate", "noop"] = "terminate",
        terminate_on_success: bool = True,
        reward: RewardWeights | Mapping[str, float] | None = None,
        observation: Literal["graph", "symbolic"] = "graph",
        max_nodes: int | None = None,
        render_mode: str | None = None,
    ) -> None:
        _check_choice("on_violation", on_violation, ("terminate", "noop"))
        _check_choice("observation", observation, ("graph", "symbolic"))
        _check_choice("render_mode", render_mode, (None, *self.metadata["render_modes"]))
        _check_choice("profile", profile, (*Profile, *(p.value for p in Profile)))
        self.render_mode = render_mode
        self.on_violation = on_violation
        self.terminate_on_success = terminate_on_success
        self.profile = Profile(profile)
        self.robot = _options(RobotConfig, robot, DEFAULT_ROBOT)
        self.reward = _options(RewardWeights, reward, RewardWeights())
        self._instructions = gather(instructions, scenes)
        max_nodes = _fitting_nodes(self._instructions.values()) if max_nodes is None else max_nodes
        self.max_nodes = max_nodes
        self.instruction_ids = tuple(self._instructions)
        self._ontology = default_ontology()
        self._codec = ActionCodec(self._ontology, max_nodes)
        self._with_graph = observation == "graph"
        self.observation_space = observation_space(max_nodes, with_graph=self._with_graph)
        self.action_space = self._codec.space
        self._episode: Episode | None = None
        self._camera: EpisodeCamera | None = None
        self._over = False
        self._steps = 0

    # --- Gymnasium -----------------------------------------------------------------------------------------------

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: of the drawn instruction, and of where movables lie on the floor.
            options: `{"instruction": X}`: an id of the instruction file, or a record (a mapping or `Instruction`).

        Raises:
            UnknownInstruction: the file has no such id.
            InstructionError: the record is malformed or does not fit its scene.
            UnknownScene, SceneError: its scene is not shipped, or corrupt.
            BadEnvironmentOption: an unknown option.
        """
        super().reset(seed=seed)
        self._episode = None
        instruction = self._choose(options or {})
        _check_text(instruction)
        episode = Episode(
            instruction, profile=self.profile, robot=self.robot, ontology=self._ontology, rng=self.np_random
        )
        self._encoder = GraphEncoder(episode.layout, self._ontology, self.max_nodes)
        self._encoder.check_size(len(episode.executor.hidden.world.nodes))
        self._episode = episode
        self._over = False
        self._steps = 0
        if self.render_mode == "rgb_array":
            self._camera = self._new_camera(episode)
        info = self._info("", None, "", 0.0, (), ())
        if self.terminate_on_success:
            info["success"] = False
        return self._observe(), info

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Run one primitive.

        Args:
            action: in the form of the action space, or an `EnvAction`.

        Raises:
            BadAction: an action of neither form.
            BadEnvironmentOption: before `reset`, or after the end.
            UnknownObject, BadSearchPrior: the search prior of an `EnvAction` names no room, or has a bad weight.
        """
        episode = self._running()
        if isinstance(action, EnvAction):
            outcome = episode.step(_checked(action))
        else:
            outcome = episode.step(*self._codec.decode(action, self._encoder))
        self._steps += 1
        violation = outcome.violation
        success = False
        if violation is None:
            success = self.terminate_on_success and episode.succeeded()
        refused = violation is not None and self.on_violation == "terminate"
        self._over = success or refused
        route = tuple(outcome.route.tolist()) if len(outcome.route) > 1 else ()
        kind = "ok" if violation is None else violation.kind.value
        info = self._info(kind, violation, str(outcome.action), outcome.metres, route, outcome.observed)
        if self.terminate_on_success:
            info["success"] = success
        if self._camera is not None:
            self._camera.follow(route)
        reward = self.reward.of(success=success, metres=outcome.metres, violation=violation is not None)
        return self._observe(), reward, self._over, False, info

    def render(self) -> Any:
        """Return a picture, (height, width, 3) uint8 RGB, or a text; None without a render mode."""
        if self.render_mode is None:
            return None
        episode = self._started()
        if self.render_mode == "ansi":
            from gavel_env.envs.ansi import describe

            return describe(episode.observed)
        assert self._camera is not None
        return self._camera.picture(episode)

    # --- beyond Gymnasium ----------------------------------------------------------------------------------------

    @property
    def observed(self) -> Observed:
        """Return the agent's view, as in the last observation."""
        return self._started().observed

    def judge(self) -> Judgement:
        """Return whether the instruction is carried out, judged on the hidden world; for runners, not for agents."""
        return self._started().judge(violations_count=self.on_violation == "terminate")

    def privileged_state(self) -> Privileged:
        """Return the hidden state: for records, not for agents."""
        return self._started().privileged()

    def reveal(self) -> Privileged:
        """Return the hidden state and make every object observed: the oracle's one call, allowed to no other agent."""
        return self._started().reveal()

    def encode(self, action: EnvAction, search_prior: Mapping[str, float] | None = None) -> dict[str, Any]:
        """Return an action in the form of the action space; `search_prior` replaces the action's own.

        Raises:
            BadAction: the target is neither an observed id nor a category, or the space cannot say the action.
        """
        self._started()
        if search_prior is not None:
            action = action._replace(search_prior=search_prior)
        return self._codec.encode(action, self._encoder)

    def decode(self, action: Mapping[str, Any]) -> EnvAction:
        """Return an action of the action space in names.

        Raises:
            BadAction: the action has not the form of the action space.
        """
        self._started()
        return self._codec.decode(action, self._encoder).action

    def node_name(self, node: int) -> str | None:
        """Return the id of a node of the observed graph; None for the robot (node 0) and for unused indices."""
        self._started()
        return self._encoder.name(node)

    # --- inside --------------------------------------------------------------------------------------------------

    def _choose(self, options: Mapping[str, Any]) -> Instruction:
        if unknown := sorted(set(options) - {"instruction"}):
            raise BadEnvironmentOption(f"reset has no option {unknown[0]!r}; it takes 'instruction'")
        chosen = options.get("instruction")
        if chosen is None:
            index = int(self.np_random.integers(len(self.instruction_ids)))
            return self._instructions[self.instruction_ids[index]]
        if isinstance(chosen, str):
            if chosen not in self._instructions:
                raise UnknownInstruction(chosen, self.instruction_ids, "this environment's instructions")
            return self._instructions[chosen]
        return parse_instruction(chosen, "reset(options)")

    def _observe(self) -> Observation:
        episode = self._started()
        observed = episode.observed
        x, y = episode.layout.point(observed.cell)
        values = self._encoder.small(observed, (x, y))
        if self._with_graph:
            values["graph"] = self._encoder.encode(observed, (x, y))
        return Observation(values, observed)

    def _info(
        self, outcome: str, violation: Any, action: str, metres: float, route: tuple[int, ...], seen: tuple[str, ...]
    ) -> dict[str, Any]:
        episode = self._started()
        observed: Observed = episode.observed
        return {
            "observed": observed,
            "outcome": outcome,
            "violation": violation,
            "action": action,
            "metres": observed.metres,
            "step_metres": metres,
            "route": route,
            "seen": seen,
            "steps": self._steps,
            "instruction_id": episode.instruction.id,
            "scene": episode.scene.scene,
        }

    def _new_camera(self, episode: Episode) -> EpisodeCamera:
        from gavel_env.envs.frames import EpisodeCamera

        return EpisodeCamera(episode)

    def _started(self) -> Episode:
        if self._episode is None:
            raise ResetNeeded("the environment has not been reset; call reset() first")
        return self._episode

    def _running(self) -> Episode:
        episode = self._started()
        if self._over:
            raise ResetNeeded("the episode is over; call reset() to begin another")
        return episode


def _check_choice(name: str, value: Any, known: tuple[Any, ...]) -> None:
    if value not in known:
        raise BadEnvironmentOption(f"{name} is {value!r}; choose from {', '.join(repr(k) for k in known)}")


def _checked(action: EnvAction) -> EnvAction:
    """Return an action in names, its parts of the types that they should have.

    Raises:
        BadAction: one of them is not; says which.
    """
    primitive, target, prior, other_than, when = action
    if not isinstance(primitive, Primitive):
        raise BadAction(f"primitive is {primitive!r:.80}; expected a gavel_env.Primitive")
    if not (target is None or isinstance(target, str)):
        raise BadAction(f"target is {target!r:.80}; expected a text or None")
    if prior is not None:
        if not isinstance(prior, Mapping) or not all(isinstance(room, str) for room in prior):
            raise BadAction(f"search_prior is {prior!r:.80}; expected room id -> weight")
        if not all(isinstance(weight, int | float | np.number) for weight in prior.values()):
            raise BadAction(f"search_prior is {prior!r:.80}; expected numbers for weights")
    if not isinstance(other_than, tuple | list | frozenset | set) or not all(isinstance(o, str) for o in other_than):
        raise BadAction(f"other_than is {other_than!r:.80}; expected observed ids")
    if when is not None and not (isinstance(when, ReturnWhen) and all(isinstance(text, str) for text in when.seen)):
        raise BadAction(f"return_when is {when!r:.80}; expected a ReturnWhen of designators")
    return action


def _fitting_nodes(instructions: Iterable[Instruction]) -> int:
    """Return how many nodes hold every scene of the instructions, their movables and the robot."""
    movables: dict[str, int] = {}
    for instruction in instructions:
        if instruction.scene not in BENCHMARK_HOUSES:  # which all fit
            movables[instruction.scene] = max(movables.get(instruction.scene, 0), len(instruction.placements))
    nodes = _FEWEST_NODES
    for name, count in movables.items():
        try:
            scene = load_scene(name)
        except GavelError:
            continue  # said at `reset`
        while nodes < 1 + len(scene.rooms) + len(scene.furniture) + len(scene.items) + count:
            nodes *= 2
    return nodes


def _check_text(instruction: Instruction) -> None:
    """Check that the observation space can say the instruction's text."""
    if len(instruction.text) > MAX_INSTRUCTION:
        raise InstructionError(
            f"instruction {instruction.id!r}: text has {len(instruction.text)} characters; at most {MAX_INSTRUCTION}"
        )
    if not is_unicode(instruction.text):
        raise InstructionError(f"instruction {instruction.id!r}: text has half a character, a lone surrogate")


def _options(kind: Any, given: Any, default: Any) -> Any:
    """Return a record of options from itself, from a mapping of its fields, or the default."""
    if given is None:
        return default
    if isinstance(given, kind):
        return given
    try:
        return convert(dict(given), kind)
    except (msgspec.ValidationError, TypeError, ValueError) as error:
        known = ", ".join(kind.__struct_fields__)
        raise BadEnvironmentOption(f"{kind.__name__}: {error}; fields: {known}") from error
