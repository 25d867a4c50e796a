"""The environment as a text game, after ALFWorld's convention."""

from __future__ import annotations

import string
from typing import Any

import gymnasium as gym
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs

from gavel_env.envs.env import BadEnvironmentOption, GavelEnv
from gavel_env.envs.goal_slots import can_be_searched_for, goal_designators
from gavel_env.errors import BadAction, MalformedAction, ResetNeeded
from gavel_env.exchange import EnvAction
from gavel_env.world_model.actions import Action, parse_action
from gavel_env.world_model.goals import fitting
from gavel_env.world_model.narration import commands, look, nearest_commands, outcome_text

__all__ = ["TextGame"]

_LONGEST = 10_000  # characters of a command

_Step = tuple[str, float, bool, bool, dict[str, Any]]

HELP = (
    "Say what to do: go to X, find X, take X, put on X, put in X, open X, close X, turn on X, turn off X, drop. "
    "X is a name you were shown, or any kind of thing (find fridge). "
    "look, inventory, task and help cost nothing."
)


class TextGame(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """A `GavelEnv` that is played in words, after ALFWorld's convention.

    ## Description

    `reset` returns what one sees as a text, `step` takes a command and returns what came of it. Make the environment
    with `on_violation="noop"`: otherwise the first invalid command ends the game.

    ## Action Space

    `Text`: a command such as `go to fridge_0`, `take apple_0`, `put in fridge_0`; `find apple` goes and looks for one.
    Whatever `parse_action` reads is understood. `look`, `inventory`, `task` and `help` tell something and change
    nothing; so does a text that is not a command, which is answered by the nearest ones.

    ## Observation Space

    `Text`: some lines of plain text.

    ## Starting State

    As of `GavelEnv`.

    ## Rewards

    Those of `GavelEnv`; 0 for what is only told.

    ## Episode End

    As of `GavelEnv`; truncated after `max_commands`, whatever they were.

    ## Information

    | key | meaning |
    |---|---|
    | `admissible_commands` | every command that the world model accepts in what has been seen, and what may be found |
    | `score` | share of the goal's conditions that hold, 0 to 1 |
    | `won` | whether the instruction is carried out |
    | `commands`, `metres` | given so far, driven so far |
    | `outcome`, `instruction_id` | as in `GavelEnv`; "told" if nothing was done |

    ## Arguments

    Args:
        env: a `GavelEnv`, wrapped or not.
        max_commands: the game is cut after so many.

    ## Version History

    - v0: first version.
    """

    def __init__(self, env: gym.Env[Any, Any], max_commands: int = 200) -> None:
        RecordConstructorArgs.__init__(self, max_commands=max_commands)
        gym.Wrapper.__init__(self, env)
        base = env.unwrapped
        if not isinstance(base, GavelEnv):
            raise TypeError(f"this wrapper is for GavelEnv, not {type(base).__name__}")
        if max_commands < 1:
            raise BadEnvironmentOption(f"max_commands is {max_commands!r}; it must be at least 1")
        self._base = base
        self._most = max_commands
        self._commands: int | None = None
        self.action_space = spaces.Text(max_length=256, min_length=1, charset=string.printable)
        self.observation_space = spaces.Text(max_length=100_000, min_length=1, charset=string.printable)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[str, dict[str, Any]]:
        """Begin a game; options as of `GavelEnv.reset`."""
        _, info = self.env.reset(seed=seed, options=options)
        self._goal = self._base.privileged_state().instruction.goal()
        self._conditions = len(self._goal.literals) + len(self._goal.conditions)
        self._commands = 0
        text = f"{look(self._base.observed.graph)}\nYour task: {self._base.observed.instruction}"
        return text, self._info(info["outcome"], info["metres"], info["instruction_id"], won=False)

    def step(self, action: str) -> _Step:
        """Carry out a command, or answer it.

        Raises:
            BadAction: it is not a text, or longer than any command.
            ResetNeeded: no game has begun.
        """
        if not isinstance(action, str):
            raise BadAction(f"a command is a text, such as 'go to fridge_0', not {type(action).__name__}")
        if len(action) > _LONGEST:
            raise BadAction(f"a command of {len(action)} characters; at most {_LONGEST}")
        if self._commands is None:
            raise ResetNeeded("the game has not begun; call reset first")
        self._commands += 1
        cut = self._commands >= self._most
        told = self._tell(action)
        if told is None:
            try:
                sent = parse_action(action)
            except MalformedAction:
                told = self._not_understood(action)
        if told is not None:
            last = self._last
            return told, 0.0, False, cut, self._info("told", last["metres"], last["instruction_id"], won=False)
        before = self._base.observed.graph
        _, reward, terminated, truncated, info = self.env.step(EnvAction.of(sent))
        after = self._base.observed
        done = Action(sent.primitive, after.reached or sent.target)
        text = outcome_text(done, before, after.graph, info["outcome"], info["step_metres"])
        won = bool(info.get("success", False))
        if won:
            text += " You have done it."
        told_of = self._info(info["outcome"], info["metres"], info["instruction_id"], won=won)
        return text, float(reward), terminated, truncated or (cut and not terminated), told_of

    @property
    def admissible_commands(self) -> list[str]:
        """Return the commands that are admissible now."""
        observed = self._base.observed
        rooms = observed.graph.world.rooms.values()
        unknown = [
            str(designator)
            for designator in goal_designators(self._goal)
            if not fitting(observed.graph, designator) and can_be_searched_for(designator, rooms, observed.searched)
        ]
        return commands(observed.graph, self._base.profile, unknown)

    def _tell(self, text: str) -> str | None:
        """Return the answer to a question about the game, or None if the text is something else."""
        graph = self._base.observed.graph
        answers = {
            "look": lambda: look(graph),
            "inventory": lambda: f"You hold {graph.holding or 'nothing'}.",
            "task": lambda: f"Your task: {self._base.observed.instruction}",
            "help": lambda: HELP,
        }
        answer = answers.get(text.strip().strip(".!?").lower())
        return None if answer is None else answer()

    def _not_understood(self, text: str) -> str:
        near = nearest_commands(text, self.admissible_commands)
        hint = f"Did you mean: {', '.join(near)}?" if near else HELP
        return f"That is not a command: {text.strip()[:60]!r}. {hint}"

    def _info(self, outcome: str, metres: float, instruction: str, *, won: bool) -> dict[str, Any]:
        unmet = len(self._base.judge().unmet)
        self._last: dict[str, Any] = {
            "admissible_commands": self.admissible_commands,
            "score": 1.0 - unmet / max(1, self._conditions),
            "won": won,
            "commands": self._commands,
            "metres": metres,
            "outcome": outcome,
            "instruction_id": instruction,
        }
        return self._last
