"""The methods as agents in their environments: self-checks that the comparison rests on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import gymnasium as gym
import pytest
from support.houses import unwrapped

import gavel_agents
from gavel_agents.llm import Completion, Prompt
from gavel_agents.llm.reference import ReferencePlans
from gavel_agents.methods import METHODS
from gavel_agents.pipeline import PlanningAgent
from gavel_agents.understanding import ReferenceUnderstanding
from gavel_env.errors import AgentNameTaken, UnknownAgent
from gavel_env.exchange import EnvAction
from gavel_env.instructions.record import Instruction, read_instructions, shipped
from gavel_env.world_model.goals import parse_goal
from gavel_env.world_model.graph import Flag
from gavel_env.world_model.ontology import category_of

KINDS = ("single", "multi")
CONFERRED = (Flag.COOKED, Flag.WASHED, Flag.DRIED)


class Result(NamedTuple):
    success: bool
    metres: float
    stopped: str


@pytest.fixture(scope="module", params=KINDS)
def instructions(request: pytest.FixtureRequest) -> Mapping[str, Instruction]:
    """Every third shipped instruction of a kind."""
    everything = read_instructions(shipped(request.param))
    return {name: everything[name] for name in list(everything)[::3]}


def needs_conferred(instruction: Instruction) -> bool:
    return any(lit.predicate.flag in CONFERRED for task in instruction.tasks for lit in parse_goal(task.goal).literals)


def parks_somewhere_unsaid(instruction: Instruction) -> bool:
    said = {text.split("@")[0] for target in instruction.meta["targets"] for text in target["objects"]}
    return any(category_of(action.target or "") not in said | {""} for action in instruction.reference_plan())


def run(agent: Any, instructions: Mapping[str, Instruction]) -> dict[str, Result]:
    env = gym.make(
        "Gavel-MultiTask-v0",
        instructions=instructions.values(),
        terminate_on_success=False,
        observation="symbolic",
    )
    results = {}
    for name in instructions:
        observation, _ = env.reset(seed=0, options={"instruction": name})
        if isinstance(agent, gavel_agents.Privileged):
            agent.reveal(env)
        agent.reset(observation, {})
        while (action := agent.act(observation, {})) is not None:
            observation, _, terminated, truncated, _ = env.step(action)
            assert not truncated
            if terminated:
                agent.act(observation, {})
                break
        judgement = unwrapped(env).judge()
        results[name] = Result(judgement.success, judgement.metres, agent.trace.stopped)
    return results


def planner(method: str, instructions: Mapping[str, Instruction], model: Any = None, **options: Any) -> Any:
    return gavel_agents.make(
        method, understanding=ReferenceUnderstanding(instructions.values()), model=model, **options
    )


class WithReferencePlans:
    """Answers single and multi instructions alike."""

    name = "reference plans"
    decoding: Mapping[str, str | float | int] = {}

    def __init__(self) -> None:
        files = [read_instructions(shipped(kind)) for kind in KINDS]
        self._model = ReferencePlans([instruction for file in files for instruction in file.values()])

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        return self._model.complete(prompts)


def test_oracle_succeeds_everywhere_and_drives_least(instructions: Mapping[str, Instruction]) -> None:
    oracle = run(gavel_agents.make("oracle"), instructions)
    assert [name for name, result in oracle.items() if not result.success] == []
    full = run(planner("gavel-full", instructions, WithReferencePlans()), instructions)
    matched = [name for name in instructions if full[name].success]
    assert len(matched) == len(instructions)
    assert sum(oracle[n].metres for n in matched) < sum(full[n].metres for n in matched)


def test_epog_fails_exactly_where_an_appliance_must_confer_a_state(instructions: Mapping[str, Instruction]) -> None:
    results = run(planner("epog", instructions), instructions)
    failed = {name for name, result in results.items() if not result.success}
    assert failed == {name for name, instruction in instructions.items() if needs_conferred(instruction)}
    assert failed


class EmptyModel:
    """Never says anything of use."""

    name = "empty"
    decoding: Mapping[str, str | float | int] = {}

    def __init__(self) -> None:
        self.asked: list[Prompt] = []

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        self.asked += prompts
        return [Completion("I am afraid I cannot do that.") for _ in prompts]


@pytest.fixture(scope="module")
def washing() -> dict[str, Instruction]:
    everything = read_instructions(shipped("single"))
    washed = [n for n, i in everything.items() if any("washed" in g for task in i.tasks for g in task.goal)]
    return {washed[0]: everything[washed[0]]}


@pytest.mark.parametrize(
    ("method", "attempts"),
    [("llm-only", 1), ("gavel-basic", 1), ("sayplan", 5), ("gavel-map", 5), ("gavel-static", 5), ("gavel-full", 5)],
)
def test_the_budget_of_calls_is_spent_only_with_feedback(
    method: str, attempts: int, washing: dict[str, Instruction]
) -> None:
    model = EmptyModel()
    agent = planner(method, washing, model)
    result = run(agent, washing)
    assert not next(iter(result.values())).success
    assert agent.trace.attempts == len(model.asked) == attempts
    assert [prompt.attempt for prompt in model.asked] == list(range(attempts))


def test_feedback_names_what_is_missing_and_stops_when_all_is_valid(washing: dict[str, Instruction]) -> None:
    class SecondTimeRight(WithReferencePlans):
        def __init__(self) -> None:
            super().__init__()
            self.asked: list[Prompt] = []

        def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
            self.asked += prompts
            return super().complete(prompts) if len(self.asked) > 1 else [Completion("Task 1:\nGRASP the moon")]

    model = SecondTimeRight()
    agent = planner("sayplan", washing, model)
    result = run(agent, washing)
    assert next(iter(result.values())).success
    assert agent.trace.attempts == 2
    complaint = model.asked[1].messages[-1].content
    assert "moon" in complaint
    assert "washed(" in complaint


def test_repair_alone_restores_what_the_model_left_out(instructions: Mapping[str, Instruction]) -> None:
    class WithoutNavigation(WithReferencePlans):
        """Forgets every NAVIGATE_TO and CLOSE: both follow from the action model."""

        def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
            [whole] = super().complete(prompts)
            kept = [line for line in whole.text.splitlines() if not line.startswith(("NAVIGATE", "CLOSE"))]
            return [Completion("\n".join(kept))]

    basic = run(planner("gavel-basic", instructions, WithoutNavigation()), instructions)
    only = run(planner("llm-only", instructions, WithoutNavigation()), instructions)
    assert not any(result.success for result in only.values())
    assert all(result.stopped for result in only.values())
    # Where to put something down for a moment, if the sentence names no such place, is for the model to say.
    lost = {name for name, result in basic.items() if not result.success}
    assert lost <= {name for name, instruction in instructions.items() if parks_somewhere_unsaid(instruction)}
    assert len(lost) < len(instructions) / 10


def test_every_method_is_a_configuration_of_one_pipeline(washing: dict[str, Instruction]) -> None:
    for name, config in METHODS.items():
        agent = planner(name, washing, EmptyModel())
        assert isinstance(agent, PlanningAgent)
        assert agent.config == config
    assert planner("gavel", washing, EmptyModel()).name == "gavel-full"


def test_runs_repeat_exactly(instructions: Mapping[str, Instruction]) -> None:
    few = {name: instructions[name] for name in list(instructions)[:6]}

    def once() -> Iterator[tuple[str, Result]]:
        yield from run(planner("gavel-full", few, WithReferencePlans()), few).items()

    assert dict(once()) == dict(once())


def test_an_unknown_agent_is_met_with_the_nearest_names() -> None:
    with pytest.raises(UnknownAgent, match="gavel-static"):
        gavel_agents.make("gavel-statik")


def test_an_agent_of_ones_own_is_plugged_in_by_name() -> None:
    class Idle:
        name = "idle"

        def reset(self, observation: Any, info: dict[str, Any]) -> None:
            self.begun = info["instruction_id"]

        def act(self, observation: Any, info: dict[str, Any]) -> EnvAction | None:
            return None

    gavel_agents.register("idle", lambda **options: Idle())
    assert "idle" in gavel_agents.agent_names()
    assert isinstance(gavel_agents.make("idle", model=None), gavel_agents.Agent)
    with pytest.raises(AgentNameTaken, match="registered already"):
        gavel_agents.register("idle", lambda **options: Idle())
