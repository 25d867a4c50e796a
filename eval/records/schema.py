"""Episode records: what one episode was, did and came to, as one JSON line (schema `gavel-record/1`).

A record file is JSON Lines of two kinds of line, told apart by `schema`: a `RunHeader` each time a run starts or
resumes (what was scheduled, on which data, with which versions), and an `EpisodeRecord` per episode. Everything that is
printed, drawn or reported is a function of such files alone. `eval.records.journal` writes and reads them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import msgspec

from eval.records.sampling import sample
from gavel_agents.agent import AgentTrace
from gavel_env.exchange import ReturnWhen

__all__ = [
    "OUTCOMES",
    "Benchmark",
    "Contestant",
    "EpisodeKey",
    "EpisodeRecord",
    "RejectedLine",
    "RunHeader",
    "Scenery",
    "Step",
    "Usage",
]

OUTCOMES: Mapping[str, str] = {
    "success": "the agent stopped with the goal met, without violation, everything closed and off again",
    "violation": "an action was invalid: a precondition did not hold",
    "unmet": "the agent stopped with part of the goal unmet",
    "unsafe": "the goal holds, but something was left open or on",
    "truncated": "the step limit was reached",
    "timeout": "the wall-clock limit was reached",
    "refused": "the agent declined: it did not understand the instruction",
    "error": "the agent or the environment raised an exception, or its process died",
    "rejected": "the instruction is malformed or does not fit its scene",
}
"""Every way in which an episode ends; all of them stay in the denominator."""


class EpisodeKey(NamedTuple):
    """What makes two episodes the same episode.

    Attributes:
        data: stamp of everything the episode is built from (instruction file, scenes, ontology).
        config: stamp of the contestant and of the environment's settings.
        instruction: instruction id.
        seed: seed of environment and agent.
    """

    data: str
    config: str
    instruction: str
    seed: int


class Step(msgspec.Struct, frozen=True, omit_defaults=True):
    """One executed action.

    Attributes:
        action: text form, as the agent sent it.
        outcome: "ok" or the violation kind.
        metres: driven by this action.
        reached: instance that a `NavigateTo` reached.
        route: turning points of the drive, (x, y) in metres to 1 cm.
        detail: the violation in full, with its blocker.
        search_prior: room -> weight, the order in which the agent asked rooms to be searched.
        other_than: observed ids that the target was not to be.
        return_when: when the search was to come back early.
    """

    action: str
    outcome: str
    metres: float = 0.0
    reached: str | None = None
    route: tuple[tuple[float, float], ...] = ()
    detail: str = ""
    search_prior: dict[str, float] = {}
    other_than: tuple[str, ...] = ()
    return_when: ReturnWhen | None = None


class Scenery(msgspec.Struct, frozen=True, omit_defaults=True):
    """What an episode looked like, for its replay; empty in records of older runs.

    Attributes:
        start: x, y of the robot at the start, metres.
        things: the instruction's movables -> x, y at the start.
        goal: literals of the instruction's goal.
        met: (actions done, indices of the literals that hold then), where that changed; a literal counts by itself.
        beliefs: (actions done, node of the agent's believed graph, room -> probability), where that changed; no rooms:
            the node is not uncertain any more.
    """

    start: tuple[float, float] | None = None
    things: dict[str, tuple[float, float]] = {}
    goal: tuple[str, ...] = ()
    met: tuple[tuple[int, tuple[int, ...]], ...] = ()
    beliefs: tuple[tuple[int, str, dict[str, float]], ...] = ()


class Usage(msgspec.Struct, frozen=True, omit_defaults=True):
    """What an episode really asked of a model; answers that it shared with others, or that came from a file, are free.

    Attributes:
        calls: completions that were asked for.
        prompt_tokens, completion_tokens: of these, as the backend counted them.
    """

    calls: int = 0
    prompt_tokens: int = 0
    completion_tokens: int = 0


class Contestant(msgspec.Struct, frozen=True, omit_defaults=True):
    """An agent with everything that is chosen for it: one row of a table.

    `kinds` and `sample` say which episodes are scheduled and are not part of `config`: what is drawn for a sample is
    the same episode outside it.

    Attributes:
        agent: registered name.
        planner: spec of the language model, such as `scripted:FILE`; empty for agents that need none.
        understanding: name of the task understanding.
        prior: name of the location prior.
        cost: what it orders tasks by, `paper`, `carried` or `simulated`; empty for agents that do not order.
        config: stamp of the above, of the files they name, and of the environment's settings.
        privileged: sees the hidden state.
        kinds: kinds of instructions that it is run on; empty = all.
        sample: it is run on so many instructions of a benchmark, as `eval.records.sampling` takes them; None = all.
    """

    agent: str
    planner: str = ""
    understanding: str = ""
    prior: str = ""
    config: str = ""
    privileged: bool = False
    kinds: tuple[str, ...] = ()
    sample: int | None = None
    cost: str = ""

    def takes(self, kind: str) -> bool:
        """Return whether it is run on instructions of this kind."""
        return not self.kinds or kind in self.kinds

    @property
    def planner_kind(self) -> str:
        """The part of the planner spec before the colon: `scripted`, `hf`, ...; empty without a planner."""
        return self.planner.partition(":")[0]


class RejectedLine(msgspec.Struct, frozen=True):
    """A line of an instruction file that is not an instruction; scheduled and counted under `id`."""

    id: str
    reason: str


class Benchmark(msgspec.Struct, frozen=True):
    """The instructions of one kind from one file.

    Attributes:
        kind: "single", "multi" or "behavior".
        source: file name, without its folder.
        stamp: content stamp of the file.
        data: stamp of the file, of the scenes it uses and of the ontology.
        instructions: scheduled ids.
        rejected: lines that could not be read; scheduled too, so that they are counted.
    """

    kind: str
    source: str
    stamp: str
    data: str
    instructions: tuple[str, ...]
    rejected: tuple[RejectedLine, ...] = ()

    @property
    def scheduled(self) -> tuple[str, ...]:
        """Every id that counts, rejected lines last."""
        return (*self.instructions, *(line.id for line in self.rejected))

    def scheduled_for(self, contestant: Contestant) -> tuple[str, ...]:
        """Return the ids that count for a contestant: nothing of other kinds, its sample, rejected lines."""
        if not contestant.takes(self.kind):
            return ()
        return (*sample(self.instructions, contestant.sample), *(line.id for line in self.rejected))


class RunHeader(msgspec.Struct, frozen=True, tag_field="schema", tag="gavel-run/1"):
    """What a run set out to do.

    Attributes:
        started: ISO 8601 time, UTC.
        versions: of this project, Python and the packages that results can depend on.
        code: git commit (with `+` if files were changed), or the version of the installed package.
        arguments: of the command line or of `run`.
        contestants, benchmarks, seeds: the schedule is their product, as far as contestants take an instruction.
        environment: settings of the environment and of the runner's limits.
    """

    started: str
    versions: dict[str, str]
    code: str
    arguments: dict[str, Any]
    contestants: tuple[Contestant, ...]
    benchmarks: tuple[Benchmark, ...]
    seeds: tuple[int, ...]
    environment: dict[str, Any]

    def keys(self) -> list[EpisodeKey]:
        """Return the scheduled episodes in the order in which they are run."""
        return [
            EpisodeKey(benchmark.data, contestant.config, instruction, seed)
            for benchmark in self.benchmarks
            for contestant in self.contestants
            for seed in self.seeds
            for instruction in benchmark.scheduled_for(contestant)
        ]


class EpisodeRecord(msgspec.Struct, frozen=True, kw_only=True, tag_field="schema", tag="gavel-record/1"):
    """One episode.

    Attributes:
        seed, instruction, kind, scene, text: what was to be done, where.
        data, code: stamps of data and code.
        contestant: who did it.
        model, decoding: name and decoding settings of the language model, as it reports them.
        method: the agent's configuration, as it reports it.
        trace: tasks with plans before and after repair, verdicts of every attempt, order, prompts' hashes.
        calls: ids of every call of a model, in order, in `eval.records.conversations`; empty in records of older runs,
            whose traces have the raw answers.
        usage: what was really asked of the model for this episode.
        misread: what was understood other than the instruction's record says, such as `goal: missing cooked(pie)`.
        steps: what was executed.
        scenery: what its replay shows beside the steps.
        metres: driven in all.
        seconds: `setup`, `agent` (in its `reset` and `act`) and `execute`; planning by stage is in the trace.
        outcome: one of `OUTCOMES`.
        failure: class of the failure, `violation:closed`, `unmet:cooked`, `error:ValueError`; empty on success.
        unmet: goal conditions that do not hold at the end; empty if never judged.
        unsafe: what was left open or on, as literals.
        tasks_met: per task, whether its goal holds at the end; empty if never judged.
        error: why it was rejected, or the traceback of a crash; values of environment variables are removed.
        finished: ISO 8601 time, UTC.
    """

    seed: int
    instruction: str
    kind: str
    scene: str
    text: str
    data: str
    code: str
    contestant: Contestant
    outcome: str
    failure: str = ""
    model: str = ""
    decoding: dict[str, Any] = {}
    method: dict[str, Any] = {}
    trace: AgentTrace = msgspec.field(default_factory=AgentTrace)
    calls: tuple[str, ...] = ()
    usage: Usage = Usage()
    misread: tuple[str, ...] = ()
    steps: tuple[Step, ...] = ()
    scenery: Scenery = Scenery()
    metres: float = 0.0
    seconds: dict[str, float] = {}
    unmet: tuple[str, ...] = ()
    unsafe: tuple[str, ...] = ()
    tasks_met: tuple[bool, ...] = ()
    error: str = ""
    finished: str = ""

    @property
    def key(self) -> EpisodeKey:
        """Which episode this is."""
        return EpisodeKey(self.data, self.contestant.config, self.instruction, self.seed)

    @property
    def success(self) -> bool:
        """Whether the instruction was carried out."""
        return self.outcome == "success"

    @property
    def planning_s(self) -> float:
        """Seconds of planning: the sum over the stages that the agent reports."""
        return sum(self.trace.seconds.values())
