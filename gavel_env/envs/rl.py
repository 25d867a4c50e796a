"""`Gavel-RL-v0`: the environment for reinforcement learning, and the wrapper behind it."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import msgspec
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from gavel_env.envs.env import BadEnvironmentOption, GavelEnv
from gavel_env.envs.goal_slots import GoalSlots, Slot, named_slots
from gavel_env.envs.levels import LevelSplit, find_level, level_instructions
from gavel_env.envs.slot_features import SlotFeatures, feature_space
from gavel_env.exchange import EnvAction, Observed
from gavel_env.world_model.actions import Primitive
from gavel_env.world_model.dynamics import unsafe
from gavel_env.world_model.goals import Goal, Literal, Predicate, unmet
from gavel_env.world_model.graph import Flag, SceneGraph

__all__ = ["SlotEnv", "make_rl"]

Floats = NDArray[np.float32]


class SlotEnv(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """A `GavelEnv` as reinforcement learners want it: one discrete action, exact masks, a small vector.

    ## Description

    `gym.make("Gavel-RL-v0", level="easy")` is a `GavelEnv` in this wrapper. The world is spoken of through K *slots*:
    first what the goal speaks of, in the order written, then what else was observed, in the order of its use
    (machines that confer a wanted state, containers with a door, then the rest). A slot keeps what it stands for; a
    container that was looked into and shut again makes room for the next one.

    ## Action Space

    `Discrete(9 * K)`: action `primitive * K + slot`, with `primitive` a `gavel_env.Primitive`. `RELEASE` has no target
    and is allowed in slot 0 alone. `NAVIGATE_TO` a slot of the goal of which nothing is known goes and finds it.

    The mask is exact: an action is allowed if and only if the world model accepts it in the observed graph
    (`first_violation` is None), or if it searches for something while a room that fits is unsearched. An instance to
    which no route was found is not offered again.

    ## Observation Space

    `Box(0, 1, (n,), float32)`, n = 427 at level easy, 1,807 at level benchmark. `parts(observation)` gives it as named
    arrays: `slots` (K, `SLOT_COLUMNS`), `literals` (L, `LITERAL_COLUMNS` + 2 K: which slots are subject and object) and
    `robot` (`ROBOT_COLUMNS`).

    ## Starting State

    An instruction of the level is drawn by the seed; see `GavelEnv`.

    ## Rewards

    The reward of `GavelEnv` (1 for success, -0.01 per metre, -0.1 for an invalid action) plus
    `shaping * (gamma * Phi(s') - Phi(s))`, with the potential

        Phi = -(sum of w(l) over l in unmet(g, G) + number of things to restore) / |g|

    over the observed graph G; to restore are doors to shut and appliances to switch off. w(l) is 1, less 1/4 once the
    literal's subject is known, less 1/4 more while a relation's subject is in the hand. Phi is 0 at a terminal state.
    Shaping of this form leaves the optimal policies what they are (Ng, Harada and Russell, 1999) if `gamma` is the
    learner's; Phi depends on what was observed so far, so this holds of policies over histories.

    ## Episode End

    Terminated when the instruction is carried out, truncated after `max_steps`. An invalid action (geometry alone can
    rule out what the mask allows) changes nothing.

    ## Information

    | key | meaning |
    |---|---|
    | `action_mask` | (9 K,) int8, 1 = allowed; `action_masks()` gives the same as bool |
    | `outcome` | "ok", the kind of the violation, or "" after `reset` |
    | `metres`, `instruction_id` | as they say |
    | `success` | whether the episode ended successfully |

    ## Arguments

    Args:
        env: a `GavelEnv`, wrapped or not.
        slots: K; at least the number of things that a goal speaks of.
        literals: L; at least the number of a goal's literals.
        max_steps: None = do not truncate here.
        gamma: the learner's discount.
        shaping: weight of the potential; 0 = none.

    ## Version History

    - v0: first version.
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        *,
        slots: int = 16,
        literals: int = 8,
        max_steps: int | None = None,
        gamma: float = 0.99,
        shaping: float = 1.0,
    ) -> None:
        RecordConstructorArgs.__init__(
            self, slots=slots, literals=literals, max_steps=max_steps, gamma=gamma, shaping=shaping
        )
        gym.Wrapper.__init__(self, env)
        base = env.unwrapped
        if not isinstance(base, GavelEnv):
            raise TypeError(f"this wrapper is for GavelEnv, not {type(base).__name__}")
        _check("slots", slots, 1, 512)
        _check("literals", literals, 1, 256)
        _check("gamma", gamma, 0.0, 1.0)
        if max_steps is not None:
            _check("max_steps", max_steps, 1, 10**9)
        self.slots, self.literals, self.max_steps = slots, literals, max_steps
        self.gamma, self.shaping = gamma, shaping
        self.action_space = spaces.Discrete(len(Primitive) * slots)
        self.observation_space = feature_space(slots, literals)
        self._base = base
        self._mask = np.zeros(len(Primitive) * slots, np.int8)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Floats, dict[str, Any]]:
        """Begin an episode; options as of `GavelEnv.reset`.

        Raises:
            BadEnvironmentOption: the goal needs more slots or literals than there are, or has quantified conditions.
        """
        _, info = self.env.reset(seed=seed, options=options)
        observed = self._base.observed
        self._goal: Goal = self._base.privileged_state().instruction.goal()
        self._check_size(info["instruction_id"])
        self._table = GoalSlots(self._goal, self.slots, observed.graph.world.rooms.values())
        self._features = SlotFeatures(self._goal, self._table, self.literals)
        self._at_first: list[frozenset[str]] = [frozenset()] * len(Flag)
        self._known = 0
        self._steps = 0
        observation, self._potential = self._look(observed)
        return observation, self._slim(info)

    def step(self, action: Any) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Run the primitive and slot that an action says."""
        primitive, slot = divmod(int(action), self.slots)
        sent = self._action(Primitive(primitive), slot)
        _, reward, terminated, truncated, info = self.env.step(sent)
        self._steps += 1
        if info["outcome"] in ("unreachable", "not_found") and sent.target in self._base.observed.graph.world.nodes:
            self._table.unreachable.add(str(sent.target))
        observation, potential = self._look(self._base.observed)
        if terminated:
            potential = 0.0
        shaped = float(reward) + self.shaping * (self.gamma * potential - self._potential)
        self._potential = potential
        truncated = truncated or (self.max_steps is not None and self._steps >= self.max_steps and not terminated)
        return observation, shaped, terminated, truncated, self._slim(info)

    def action_masks(self) -> NDArray[np.bool_]:
        """Return (9 K,) bool, True = allowed."""
        return self._mask.astype(np.bool_)

    @property
    def slots_now(self) -> tuple[Slot, ...]:
        """Return what the slots stand for now."""
        return tuple(self._table)

    def action_of(self, primitive: Primitive, target: str | None = None) -> int | None:
        """Return the action that says a primitive on an id or a designator of the goal; None if no slot does."""
        if not primitive.takes_target:
            return int(primitive) * self.slots
        for index, (designator, instance, _) in enumerate(self._table):
            if target in (instance, None if designator is None else str(designator)):
                return int(primitive) * self.slots + index
        return None

    def action_text(self, action: int) -> str:
        """Return an action in words, `GRASP(apple_0)`."""
        primitive, slot = divmod(int(action), self.slots)
        return f"{Primitive(primitive).name}({self._action(Primitive(primitive), slot).target or ''})"

    def parts(self, observation: Floats) -> Any:
        """Return an observation as named arrays; see `split_features`."""
        from gavel_env.envs.slot_features import split_features

        return split_features(observation, self.slots, self.literals)

    # --- inside --------------------------------------------------------------------------------------------------

    def _action(self, primitive: Primitive, slot: int) -> EnvAction:
        designator, instance, _ = self._table.slots[slot]
        if not primitive.takes_target:
            return EnvAction(primitive)
        if instance is not None:
            return EnvAction(primitive, instance)
        return EnvAction(primitive, f"slot_{slot}" if designator is None else str(designator))

    def _look(self, observed: Observed) -> tuple[Floats, float]:
        """Bring slots and mask up to date; return the observation and the potential."""
        graph = observed.graph
        self._table.update(observed)
        missing = unmet(self._goal, graph)
        to_restore = self._to_restore(graph)
        self._mask = np.zeros(len(Primitive) * self.slots, np.int8)
        for primitive, slot in self._table.allowed(observed, self._base.profile):
            self._mask[primitive * self.slots + slot] = 1
        time = 0.0 if self.max_steps is None else min(1.0, self._steps / self.max_steps)
        observation = self._features.write(observed, missing, to_restore, time)
        left = sum(self._left(graph, literal) for literal in missing) + len(to_restore)
        return observation, -left / max(1, len(self._goal.literals))

    def _left(self, graph: SceneGraph, literal: Any) -> float:
        """Return w(l) of an unmet literal."""
        assert isinstance(literal, Literal)
        if literal.negated:
            return 1.0
        subject = next(slot.instance for slot in self._table if slot.designator == literal.subject)
        if subject is None:
            return 1.0
        carried = subject == graph.holding and literal.predicate in _PLACING
        return 0.5 if carried else 0.75

    def _to_restore(self, graph: SceneGraph) -> frozenset[str]:
        """Return what is open or on now, was not when first seen, and must not stay so."""
        fresh = list(graph.world.nodes)[self._known :]
        self._known += len(fresh)
        for flag in (Flag.OPEN, Flag.TOGGLED):
            self._at_first[flag] = self._at_first[flag].union(graph.flags[flag].intersection(fresh))
        if all(graph.flags[flag] <= self._at_first[flag] for flag in (Flag.OPEN, Flag.TOGGLED)):
            return frozenset()
        start = msgspec.structs.replace(graph, flags=tuple(self._at_first))
        return frozenset(obj for _, obj in unsafe(start, graph, self._goal))

    def _check_size(self, instruction: str) -> None:
        things, literals = len(named_slots(self._goal)), len(self._goal.literals)
        if self._goal.conditions:
            raise BadEnvironmentOption(f"instruction {instruction!r} has quantified conditions, which no slot can say")
        if things > self.slots or literals > self.literals:
            raise BadEnvironmentOption(
                f"instruction {instruction!r} speaks of {things} things in {literals} literals; make the environment "
                f"with slots >= {things} and literals >= {literals}, not {self.slots} and {self.literals}"
            )

    def _slim(self, info: dict[str, Any]) -> dict[str, Any]:
        return {
            "action_mask": self._mask,
            "outcome": info["outcome"],
            "metres": info["metres"],
            "instruction_id": info["instruction_id"],
            "success": info.get("success", False),
        }


def make_rl(
    level: str = "easy",
    *,
    split: LevelSplit = "train",
    slots: int | None = None,
    literals: int | None = None,
    max_steps: int | None = None,
    gamma: float = 0.99,
    shaping: float = 1.0,
    **options: Any,
) -> SlotEnv:
    """Return `Gavel-RL-v0`.

    Args:
        level: "easy", "medium", "hard" or "benchmark" (`LEVELS`).
        split: "train" or "test" instructions of the level.
        slots: K; default: the level's.
        literals: L; default: the level's.
        max_steps: steps after which an episode is truncated; default: the level's.
        gamma: the learner's discount.
        shaping: weight of the potential; 0 = none.
        options: of `GavelEnv`, such as `instructions`, `scenes`, `reward` or `render_mode`.

    Raises:
        UnknownLevel: no such level or split.
        BadEnvironmentOption: a value that the option cannot have.
    """
    chosen = find_level(level)
    if "instructions" not in options:
        options["instructions"] = level_instructions(level, split)
    env = GavelEnv(**{"observation": "symbolic", "on_violation": "noop", "max_nodes": 4096, **options})
    return SlotEnv(
        env,
        slots=chosen.slots if slots is None else slots,
        literals=chosen.literals if literals is None else literals,
        max_steps=chosen.max_steps if max_steps is None else max_steps,
        gamma=gamma,
        shaping=shaping,
    )


_PLACING = (Predicate.ON_TOP, Predicate.INSIDE, Predicate.UNDER, Predicate.NEXT_TO, Predicate.IN_ROOM)


def _check(name: str, value: float, least: float, most: float) -> None:
    if not least <= value <= most:
        raise BadEnvironmentOption(f"{name} is {value!r}; it must be between {least:g} and {most:g}")
