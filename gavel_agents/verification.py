"""The verifier and repairer as a library: anyone's plan in; verdict, repaired plan, edit trace and diff out."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from gavel_agents.edits.repair import Repaired
from gavel_agents.edits.repair import repair as repair_plan
from gavel_agents.proposing.complaint import complaint
from gavel_agents.proposing.parse import Dropped, ParsedPlans, parse_plans
from gavel_agents.proposing.resolve import resolve
from gavel_env.data import read_bytes, shipped_data
from gavel_env.errors import InstructionError, UnknownInstruction
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.record import Instruction, InstructionSet, parse_instruction, read_instructions
from gavel_env.world_model.actions import Action
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import Goal
from gavel_env.world_model.graph import Flag, SceneGraph
from gavel_env.world_model.verdict import CostFunction, Plan, Verdict, validate

__all__ = ["Verified", "find_instruction", "verify", "verify_on_graph"]


class Verified(msgspec.Struct, frozen=True):
    """What verification found.

    Attributes:
        instruction: id of the instruction, or empty.
        scene: scene name, or empty.
        goal: g.
        parsed: the plan as it was read, with what was left out.
        verdict: of the plan as it was given.
        repaired: the repair, or None if none was asked for.
        profile: rules profile.
    """

    instruction: str
    scene: str
    goal: Goal
    parsed: ParsedPlans
    verdict: Verdict
    repaired: Repaired | None
    profile: Profile

    @property
    def valid(self) -> bool:
        """Whether the plan as given is valid."""
        return self.verdict.valid

    @property
    def plan(self) -> Plan:
        """The plan as given, names resolved."""
        return self.verdict.plan

    @property
    def repaired_plan(self) -> Plan:
        """The repaired plan; the plan as given if no repair was asked for."""
        return self.plan if self.repaired is None else self.repaired.plan

    @property
    def final(self) -> Verdict:
        """Verdict of the repaired plan if a repair was asked for, else of the plan as given."""
        return self.verdict if self.repaired is None else self.repaired.verdict

    @property
    def edits(self) -> tuple[str, ...]:
        """The edit trace, one line per edit."""
        return () if self.repaired is None else self.repaired.trace

    @property
    def dropped(self) -> tuple[Dropped, ...]:
        """What was left out of the plan's text."""
        return self.parsed.dropped

    @property
    def complaint(self) -> str:
        """What is still wrong, in words; empty if nothing is."""
        found = complaint(self.final, profile=self.profile)
        return "" if found is None else found.text()

    def diff(self) -> str:
        """Return the unified diff from the plan as given to the repaired one; empty if they agree."""
        lines = difflib.unified_diff(
            [str(action) for action in self.plan],
            [str(action) for action in self.repaired_plan],
            "plan",
            "repaired plan",
            lineterm="",
            n=max(len(self.plan), len(self.repaired_plan)),
        )
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """Return everything in builtin types, for JSON."""
        report: dict[str, Any] = {
            "instruction": self.instruction,
            "scene": self.scene,
            "profile": self.profile.value,
            "goal": list(self.goal.text()),
            "problem": self.parsed.problem,
            "dropped": [msgspec.to_builtins(d) for d in self.dropped],
            **_verdict_dict(self.verdict),
        }
        if self.repaired is not None:
            edits = [
                {"rule": e.rule, "step": e.step, "cause": e.cause, "change": e.change, "text": str(e)}
                for e in self.repaired.edits
            ]
            report["repaired"] = {**_verdict_dict(self.repaired.verdict), "edits": edits, "diff": self.diff()}
        report["complaint"] = self.complaint
        return report


def _verdict_dict(verdict: Verdict) -> dict[str, Any]:
    violation = verdict.violation
    return {
        "valid": verdict.valid,
        "plan": [str(action) for action in verdict.plan],
        "violation": None
        if violation is None
        else {
            "kind": violation.kind.value,
            "step": violation.step,
            "subject": violation.subject,
            "blocker": violation.blocker,
            "nearest": list(verdict.nearest),
        },
        "unmet": [str(condition) for condition in verdict.unmet],
        "left_open": [obj for flag, obj in verdict.unsafe if flag is Flag.OPEN],
        "left_on": [obj for flag, obj in verdict.unsafe if flag is Flag.TOGGLED],
        "cost": verdict.cost,
    }


def verify(
    *,
    scene: str | Path | None = None,
    instruction: str | Path | Mapping[str, Any] | Instruction,
    plan: str | Sequence[str] | Sequence[Action],
    repair: bool = True,
    profile: Profile | str = Profile.PAPER,
    cost: CostFunction | None = None,
) -> Verified:
    """Check a plan against an instruction in its house, and repair it as far as graph and goal determine how.

    Args:
        scene: name of a shipped scene or path of a scene file; default: the instruction's own.
        instruction: id of a shipped instruction, path of an instruction file (`FILE#ID` if it holds several), a
            record, or an `Instruction`.
        plan: text in any form that a model may write, text actions, or actions; the plans of several tasks are
            carried out one after the other.
        repair: also repair the plan.
        profile: rules profile, or its name.
        cost: believed metres of a plan; default: number of navigations.

    Raises:
        GavelError: unknown scene or instruction, or a record that is malformed or does not fit its scene.
    """
    record = instruction if isinstance(instruction, Instruction) else find_instruction(instruction)
    house = load_scene(scene if scene is not None else record.scene)
    graph = instruction_graph(house, record)
    found = verify_on_graph(graph, record.goal(), plan, repair=repair, profile=profile, cost=cost)
    return msgspec.structs.replace(found, instruction=record.id, scene=house.scene)


def verify_on_graph(
    graph: SceneGraph,
    goal: Goal,
    plan: str | Sequence[str] | Sequence[Action],
    *,
    repair: bool = True,
    profile: Profile | str = Profile.PAPER,
    cost: CostFunction | None = None,
) -> Verified:
    """Check (and repair) a plan on any graph, believed or hidden; arguments as in `verify`."""
    profile = Profile(profile)
    parsed = _parsed(plan, graph, goal)
    verdict = validate(graph, parsed.plan, goal, cost=cost, profile=profile)
    repaired = repair_plan(graph, parsed.plan, goal, cost=cost, profile=profile) if repair else None
    return Verified("", "", goal, parsed, verdict, repaired, profile)


def _parsed(plan: str | Sequence[str] | Sequence[Action], graph: SceneGraph, goal: Goal) -> ParsedPlans:
    if isinstance(plan, str):
        parsed = parse_plans(plan)
    elif all(isinstance(step, Action) for step in plan):
        parsed = ParsedPlans((tuple(step for step in plan if isinstance(step, Action)),))
    else:
        parsed = parse_plans("\n".join(str(step) for step in plan))
    return msgspec.structs.replace(parsed, plans=(resolve(graph, parsed.plan, goal),))


def find_instruction(source: str | Path | Mapping[str, Any]) -> Instruction:
    """Return the instruction that an id, a path, `FILE#ID` or a record means.

    Raises:
        UnknownInstruction: no shipped file has the id, or the file does not.
        InstructionError: the file or record is malformed, or holds several instructions and no id was given.
    """
    if isinstance(source, Mapping):
        return parse_instruction(source, "the given record")
    path, _, wanted = str(source).partition("#")
    if Path(path).suffix in (".json", ".jsonl") or Path(path).is_file():
        return _from_file(Path(path), wanted)
    known: list[str] = []
    for file in _shipped_files():
        records = read_instructions(file)
        if str(source) in records:
            return records[str(source)]
        known += records
    raise UnknownInstruction(str(source), known, "the shipped instruction files")


def _from_file(path: Path, wanted: str) -> Instruction:
    if path.suffix == ".json":
        return parse_instruction(read_bytes(path, "instruction file", InstructionError), str(path))
    records: InstructionSet = read_instructions(path)
    if wanted:
        return records[wanted]
    if len(records) > 1:
        some = ", ".join(list(records)[:3])
        raise InstructionError(f"{path} holds {len(records)} instructions; name one as {path}#ID (such as {some})")
    return next(iter(records.values()))


def _shipped_files() -> list[Path]:
    return sorted(shipped_data("instructions").glob("*.jsonl"))
