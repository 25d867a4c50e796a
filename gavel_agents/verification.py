"""The verifier and repairer as a library: anyone's plan in; verdict, repaired plan, edit trace and diff out."""

from __future__ import annotations

import difflib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from gavel_agents.edits.repair import Repaired
from gavel_agents.edits.repair import repair as repair_plan
from gavel_agents.proposing.complaint import complaint
from gavel_agents.proposing.parse import ParsedPlans, parse_plans
from gavel_agents.proposing.resolve import resolve
from gavel_agents.proposing.unread import Unread, unread
from gavel_env.data import read_bytes, shipped_data
from gavel_env.errors import BadOption, InstructionError, UnknownInstruction
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.record import (
    Instruction,
    InstructionSet,
    parse_instruction,
    read_instructions,
    scene_beside,
)
from gavel_env.world_model.actions import Action
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import Goal, GoalText, as_goal, check_goal
from gavel_env.world_model.graph import Flag, SceneGraph
from gavel_env.world_model.travel import travel_cost
from gavel_env.world_model.verdict import CostFunction, Plan, Verdict, validate

__all__ = ["Verified", "find_instruction", "read_plan_strictly", "verify", "verify_on_graph"]

FORMAT = "gavel-verdict/1"


class Verified(msgspec.Struct, frozen=True):
    """What verification found.

    Attributes:
        instruction: id of the instruction, or empty.
        scene: scene name, or empty.
        goal: g.
        parsed: the plan as it was read, with what was left out.
        verdict: of the steps that were read.
        repaired: the repair, or None if none was asked for.
        profile: rules profile.
        unread: what of the plan may be a step and could not be read.
        strict: whether a plan that cannot be read whole is invalid.
        unit: what the cost counts: navigations, metres, rooms.
    """

    instruction: str
    scene: str
    goal: Goal
    parsed: ParsedPlans
    verdict: Verdict
    repaired: Repaired | None
    profile: Profile
    unread: tuple[Unread, ...] = ()
    strict: bool = True
    unit: str = "navigations"

    @property
    def valid(self) -> bool:
        """Whether the plan as given is valid: every step was read, unless leniently, and what was read is valid."""
        return self.verdict.valid and not (self.strict and self.unread)

    @property
    def passed(self) -> bool:
        """The gate's answer: as `valid`, of the repaired plan if a repair was asked for."""
        return self.final.valid and not (self.strict and self.unread)

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
    def complaint(self) -> str:
        """What is still wrong, in words; empty if nothing is."""
        found = complaint(self.final, profile=self.profile)
        parts = [] if not (self.strict and self.unread) else ["Not read as steps:", *map(str, self.unread)]
        return "\n".join(parts if found is None else [*parts, found.text()])

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
            "format": FORMAT,
            "passed": self.passed,
            "strict": self.strict,
            "instruction": self.instruction,
            "scene": self.scene,
            "profile": self.profile.value,
            "goal": list(self.goal.text()),
            "problem": self.parsed.problem,
            "unread": [msgspec.to_builtins(piece) for piece in self.unread],
            **_verdict_dict(self.verdict),
            "cost_unit": self.unit,
        }
        report["valid"] = self.valid
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
    instruction: str | Path | Mapping[str, Any] | Instruction | None = None,
    graph: SceneGraph | str | Path | Mapping[str, Any] | None = None,
    goal: GoalText | None = None,
    plan: str | Sequence[Any],
    repair: bool = True,
    strict: bool = True,
    profile: Profile | str = Profile.PAPER,
    cost: CostFunction | None = None,
) -> Verified:
    """Check a plan against an instruction in its house, or a goal on one's own graph, and repair it.

    Repair goes as far as graph and goal determine how.

    Args:
        scene: name of a shipped scene or path of a scene file; default: the instruction's own.
        instruction: id of a shipped instruction, path of an instruction file (`FILE#ID` if it holds several), a
            record, or an `Instruction`.
        graph: one's own graph instead of an instruction's: a `SceneGraph`, or what `SceneGraph.from_json` reads.
        goal: with `graph`: a `Goal`, text (`"on_top(vial, rack), not dirty(vial)"`), or a list of texts.
        plan: text in any form that a model may write, a list of text actions or of what JSON says (`["RELEASE",
            None]`), or actions; the plans of several tasks are carried out one after the other.
        repair: also repair the plan.
        strict: what cannot be read as a step makes the plan invalid; else it is left out, and the result says so.
        profile: rules profile, or its name.
        cost: believed metres of a plan; default: number of navigations, on one's own graph its `travel_cost`.

    Raises:
        GavelError: unknown scene or instruction, a record that is malformed or does not fit its scene, a malformed
            graph, or a goal that speaks of what the graph does not have.
    """
    if (instruction is None) == (graph is None) or (graph is None) != (goal is None):
        raise BadOption("verify takes an instruction, or a graph and a goal")
    if graph is not None and goal is not None:
        own = graph if isinstance(graph, SceneGraph) else SceneGraph.from_json(graph)
        wanted = as_goal(goal)
        check_goal(wanted, own)
        cost = cost or travel_cost(own)
        return verify_on_graph(own, wanted, plan, repair=repair, strict=strict, profile=profile, cost=cost)
    assert instruction is not None
    record = instruction if isinstance(instruction, Instruction) else find_instruction(instruction)
    house = load_scene(scene if scene is not None else record.scene)
    graph = instruction_graph(house, record)
    found = verify_on_graph(graph, record.goal(), plan, repair=repair, strict=strict, profile=profile, cost=cost)
    return msgspec.structs.replace(found, instruction=record.id, scene=house.scene)


def verify_on_graph(
    graph: SceneGraph,
    goal: GoalText,
    plan: str | Sequence[Any],
    *,
    repair: bool = True,
    strict: bool = True,
    profile: Profile | str = Profile.PAPER,
    cost: CostFunction | None = None,
) -> Verified:
    """Check (and repair) a plan on any graph, believed or hidden; arguments as in `verify`."""
    profile, goal = Profile(profile), as_goal(goal)
    parsed, missed = _parsed(plan, graph, goal)
    verdict = validate(graph, parsed.plan, goal, cost=cost, profile=profile)
    repaired = repair_plan(graph, parsed.plan, goal, cost=cost, profile=profile) if repair else None
    return Verified(
        "",
        "",
        goal,
        parsed,
        verdict,
        repaired,
        profile,
        missed,
        strict,
        unit=getattr(cost, "unit", "metres" if cost else "navigations"),
    )


def read_plan_strictly(text: str, graph: SceneGraph | None = None) -> tuple[Plan, tuple[Unread, ...]]:
    """Return the steps of a plan's text, names resolved if there is a graph, and what could not be read."""
    parsed = parse_plans(text, graph)
    return parsed.plan, unread(text, parsed, graph)


def _parsed(plan: str | Sequence[Any], graph: SceneGraph, goal: Goal) -> tuple[ParsedPlans, tuple[Unread, ...]]:
    """Return the plan as it is read, and what of it is not read."""
    missed: tuple[Unread, ...] = ()
    if not isinstance(plan, str) and all(isinstance(step, Action) for step in plan):
        parsed = ParsedPlans((tuple(step for step in plan if isinstance(step, Action)),))
    else:
        text = plan if isinstance(plan, str) else _text_of(plan)
        parsed = parse_plans(text)
        missed = unread(text, parsed, graph)
    return msgspec.structs.replace(parsed, plans=(resolve(graph, parsed.plan, goal),)), missed


def _text_of(steps: Sequence[Any]) -> str:
    """Return a list of steps as text: a line each if all are text or actions, else as JSON."""
    if all(isinstance(step, str | Action) for step in steps):
        return "\n".join(map(str, steps))
    return json.dumps([str(step) if isinstance(step, Action) else step for step in steps], default=str)


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
        record = parse_instruction(read_bytes(path, "instruction file", InstructionError), str(path))
        return scene_beside(record, path.parent, str(path))
    records: InstructionSet = read_instructions(path)
    if wanted:
        return records[wanted]
    if len(records) > 1:
        some = ", ".join(list(records)[:3])
        raise InstructionError(f"{path} holds {len(records)} instructions; name one as {path}#ID (such as {some})")
    return next(iter(records.values()))


def _shipped_files() -> list[Path]:
    return sorted(shipped_data("instructions").glob("*.jsonl"))
