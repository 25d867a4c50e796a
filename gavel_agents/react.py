"""ReAct (Yao et al., 2023): the model is asked for one thought and one action at a time, and told what came of it.

The baseline beside the plan-then-act methods. It has no understanding, no belief and no repair: only the instruction,
what was seen so far in words, and the model. Two things are shared with the other methods: what the world model refuses
in the observed graph is told to the model instead of being sent (they validate their plans by the same model), and a
model that answers with a whole plan has it carried out step by step, until something is refused.
"""

from __future__ import annotations

import re
from collections import deque
from typing import Any

from gavel_agents.agent import AgentTrace, TaskTrace
from gavel_agents.classical.planner import ClassicalPlanner
from gavel_agents.llm import ChatModel, Completion, Message, Prompt, load_model
from gavel_agents.proposing.proposals import prompt_hash
from gavel_env.data import sayable
from gavel_env.errors import BadOption, GavelError, MalformedAction
from gavel_env.exchange import EnvAction, Observation, Observed, view
from gavel_env.instructions.lookup import About
from gavel_env.world_model.actions import Action, Primitive, parse_action
from gavel_env.world_model.dynamics import Profile, Violation, ViolationKind, first_violation
from gavel_env.world_model.goals import Designator, fitting
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.narration import commands, look, outcome_text, reason
from gavel_env.world_model.ontology import default_ontology

__all__ = ["ReActAgent"]

SYSTEM = """You are a household robot with one hand. You act step by step: each time, write one line "Thought: ..." and one line "Action: ...", nothing else. You are then told what happened.
Actions:
go to X: X is a name you were shown; needed before anything is done with X.
find KIND: search the house for any object of a kind, such as find fridge, and go to it.
take X: needs an empty hand. What is inside something closed cannot be taken.
put on X, put in X: puts what you hold; what has a door must be open.
open X, close X, turn on X, turn off X, drop.
done: when the whole instruction is carried out.
Close everything you opened. Running an oven, stove or microwave with food inside cooks it, a dishwasher or washer washes, a clothes dryer dries; turn them off afterwards."""  # noqa: E501

_SHOWN_COMMANDS = 24
_MOST_CHARACTERS = 60_000
_MOST_LINES = 300
_ACTION = re.compile(r"^(?:[^\w\n]|_)*+action\s*+\d*+\s*+[:=]\W*(.+)$", re.IGNORECASE | re.MULTILINE)
_MADE_UP = re.compile(r"^(?:[^\w\n]|_)*+observation\s*+\d*+\s*+[:=]", re.IGNORECASE | re.MULTILINE)
_DONE = re.compile(r"^\W*+(done|finish(ed)?|stop|end)\W*+$", re.IGNORECASE)


class ReActAgent:
    """An agent that asks its planner for one action after the other.

    Args:
        planner: a `ChatModel` or its spec.
        profile: rules profile of the environment.
        seed: of the model's sampling.
        max_calls: calls of the model in an episode at most.

    Raises:
        BadOption: no language model, or an unknown profile.
        GavelError: the planner's spec is not known or not usable.
    """

    name = "react"

    def __init__(
        self,
        planner: ChatModel | str | None = None,
        profile: Profile | str = Profile.PAPER,
        seed: int | None = None,
        max_calls: int = 80,
    ) -> None:
        if isinstance(planner, str):
            planner = load_model(planner)
        if planner is None or isinstance(planner, ClassicalPlanner):  # which reads no text
            raise BadOption(
                "agent 'react' asks a language model, and the default planner, 'classical', reads no text:"
                " make('react', planner='openai:MODEL@URL')"
            )
        self._model = planner
        if profile not in (*Profile, *(known.value for known in Profile)):
            raise BadOption(f"profile is {profile!r}; known: {', '.join(repr(known.value) for known in Profile)}")
        self._profile = Profile(profile)
        self._seed = seed
        self._most = max_calls
        self.trace = AgentTrace()

    def reset(self, observation: Observation, info: dict[str, Any]) -> None:
        """Begin the conversation with the instruction and what is seen."""
        observed = view(observation)
        self.trace = AgentTrace(tasks=[], order=[0], seconds={}, prompts=[], completions=[])
        self._about = About.of(observed.instruction, observed.graph.world.rooms)
        self._taken: list[str] = []
        self._queue: deque[Action] = deque()
        self._whole_plan = False
        self._sent: Action | None = None
        self._before = observed
        text = f"Instruction: {observed.instruction}\n{look(observed.graph)}"
        self._turns = [Message("system", SYSTEM), Message("user", self._with_commands(text, observed.graph))]

    def act(self, observation: Observation, info: dict[str, Any]) -> EnvAction | None:
        """Tell the model what its last action did; return the next one, or None when it is done."""
        observed = view(observation)
        if self._sent is not None:
            self._report(self._sent, observed)
        self._before = observed
        action = self._next(observed)
        self._sent = action
        self.trace.tasks = [TaskTrace(text=observed.instruction, plan=tuple(self._taken))]
        if action is None:
            return None
        self._taken.append(str(action))
        return EnvAction.of(action)

    def _report(self, sent: Action, observed: Observed) -> None:
        metres = observed.metres - self._before.metres
        done = Action(sent.primitive, observed.reached or sent.target)
        text = outcome_text(done, self._before.graph, observed.graph, observed.outcome, metres)
        if observed.outcome != "ok":
            self._drop_plan()
        if not self._queue:
            self._say(text, observed.graph)

    def _next(self, observed: Observed) -> Action | None:
        """Return the next action that the world model does not refuse; None when the model is done or gives up."""
        while True:
            while self._queue:
                action = _bound(self._queue.popleft(), observed.graph)
                refused = self._refusal(action, observed)
                if refused is None:
                    return action
                self._drop_plan()
                self._say(f"Nothing happens: {refused}.", observed.graph)
            if self.trace.attempts >= self._most:
                self.trace.stopped = f"gave up after {self._most} calls of the model"
                return None
            if self._whole_plan:
                return None
            found = read_turn(self._ask())
            if found is None:
                return None
            self._queue.extend(found)
            self._whole_plan = len(found) > 1
            if not found:
                hint = 'That is no action. Write "Action: " and one of the actions.'
                self._say(f"{hint} {look(observed.graph)}", observed.graph)

    def _drop_plan(self) -> None:
        self._queue.clear()
        self._whole_plan = False

    def _refusal(self, action: Action, observed: Observed) -> str | None:
        """Return why the world model refuses an action, or None; what may still be found is not refused."""
        graph, target = observed.graph, action.target or ""
        if action.primitive is Primitive.NAVIGATE_TO and target not in graph.world.nodes:
            if _instances(target, graph):
                return None
            if default_ontology().knows(target.partition("@")[0]):
                searched = observed.searched.issuperset(graph.world.rooms)
                return reason(Violation(ViolationKind.NOT_FOUND, target)) if searched else None
        violation = first_violation(graph, action, self._profile)
        return None if violation is None else reason(violation)

    def _ask(self) -> str:
        prompt = Prompt(tuple(self._turns), self._about, self.trace.attempts, seed=self._seed)
        [completion] = self._model.complete([prompt])
        self._note(prompt, completion)
        shown = own_words(completion.text)
        self._turns.append(Message("assistant", shown.strip() or "Thought:"))
        return shown

    def _note(self, prompt: Prompt, completion: Completion) -> None:
        trace = self.trace
        if completion.cut:
            trace.cut.append(trace.attempts)
        trace.attempts += 1
        trace.seconds["plan"] = trace.seconds.get("plan", 0.0) + completion.seconds
        trace.prompt_tokens += completion.prompt_tokens
        trace.completion_tokens += completion.completion_tokens
        trace.prompts.append(prompt_hash(prompt.messages))
        trace.completions.append(completion.text)

    def _say(self, text: str, graph: SceneGraph) -> None:
        text = self._with_commands(text, graph)
        if self._turns[-1].role == "user":
            last = self._turns.pop()
            text = f"{last.content}\n{text}"
        self._turns.append(Message("user", text))

    def _with_commands(self, text: str, graph: SceneGraph) -> str:
        possible = [c for c in commands(graph, self._profile) if not c.startswith("go to ")][:_SHOWN_COMMANDS]
        return f"{text}\nPossible here: {', '.join(possible)}." if possible else text


def own_words(answer: str) -> str:
    """Return what a model says up to the first observation that it makes up; at most 60,000 characters."""
    answer = sayable(answer[:_MOST_CHARACTERS])
    made_up = _MADE_UP.search(answer)
    if made_up is None:
        return answer
    end = made_up.start()
    while end and not answer[end - 1].isalnum():
        end -= 1
    return answer[: answer.index("\n", end) + 1] if end else ""


def read_turn(answer: str) -> list[Action] | None:
    """Return the actions of an answer: the one after "Action:", else every line that is one; None = done."""
    answer = answer[:_MOST_CHARACTERS]
    marked = _ACTION.search(answer)
    lines = [marked.group(1)] if marked else answer.splitlines()
    found: list[Action] = []
    refused = 0
    for line in lines:
        if _DONE.match(line):
            return found or None
        try:
            found.append(parse_action(line))
        except MalformedAction:
            refused += 1
            if refused == _MOST_LINES:
                break
    return found


def _bound(action: Action, graph: SceneGraph) -> Action:
    """Return the action on the observed instance that its target means, one in reach if there is any."""
    target = action.target
    if target is None or target in graph.world.nodes or action.primitive is Primitive.NAVIGATE_TO:
        return action
    fit = _instances(target, graph)
    return Action(action.primitive, min(fit, key=lambda obj: obj not in graph.near)) if fit else action


def _instances(target: str, graph: SceneGraph) -> tuple[str, ...]:
    try:
        return fitting(graph, Designator.parse(target))
    except GavelError:
        return ()
