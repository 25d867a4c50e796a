"""Lines 8-18 of Algorithm 1: propose plans, repair and validate them, complain about what is left, at most T times."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import msgspec

from gavel_agents.agent import AgentTrace, TaskTrace, stage
from gavel_agents.edits.repair import repair
from gavel_agents.llm import ChatModel, Message, PlanningProblem, Prompt
from gavel_agents.methods import MethodConfig
from gavel_agents.proposing.complaint import complain
from gavel_agents.proposing.parse import Dropped, parse_plans
from gavel_agents.proposing.prompts import plan_prompt, retry_prompt
from gavel_agents.proposing.unread import steps_among
from gavel_agents.understanding import TaskUnderstanding
from gavel_env.instructions.lookup import About
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import Goal
from gavel_env.world_model.graph import Flag, SceneGraph
from gavel_env.world_model.verdict import CostFunction, Plan, Verdict, validate

__all__ = ["Planned", "edited_plans", "proposed_plans"]


@dataclass
class Planned:
    """The plans {pi_i} that will be executed, and their verdicts."""

    plans: list[Plan] = field(default_factory=list)
    verdicts: list[Verdict] = field(default_factory=list)


@dataclass(frozen=True)
class Problem:
    """What is planned for: I, G_0, B_0 and {g_i}.

    Attributes:
        about: the instruction's text I, and the rooms of the house.
        tasks: the understood tasks with their goals.
        graph: the believed graph G_0.
        likely: node -> its rooms by decreasing belief.
        cost: believed metres of a plan.
        profile: rules profile.
        seed: of a model's sampling.
    """

    about: About
    tasks: Sequence[TaskUnderstanding]
    graph: SceneGraph
    likely: Mapping[str, Sequence[str]]
    cost: CostFunction
    profile: Profile
    seed: int | None = None


def proposed_plans(problem: Problem, config: MethodConfig, model: ChatModel, trace: AgentTrace) -> Planned:
    """Ask the model until every task's plan is valid or the budget T is spent."""
    first = plan_prompt(problem.about.text, problem.tasks, problem.graph, problem.likely, problem.profile)
    prompt = first
    goals = [task.goal for task in problem.tasks]
    structured = PlanningProblem(problem.graph, tuple(goals), problem.profile)
    planned = Planned()
    for attempt in range(config.attempts):
        answer = _ask(model, Prompt(prompt, problem.about, attempt, seed=problem.seed, problem=structured), trace)
        parsed = parse_plans(answer, problem.graph, len(problem.tasks))
        planned = _judge(problem, parsed.plans, trace, repairing=config.repair, dropped=parsed.dropped)
        if all(verdict.valid for verdict in planned.verdicts) or not config.feedback:
            break
        complaint = complain(planned.verdicts, goals, parsed, problem.profile)
        prompt = retry_prompt(first, _quote(planned.plans), complaint)
    return planned


def edited_plans(problem: Problem, trace: AgentTrace) -> Planned:
    """Synthesise plans from the difference between the believed and the goal graph alone: Repair from nothing.

    A state that only an appliance confers is not a difference of relations, so it is left out of what the edits work
    towards; the verdict is on the whole goal (`epog`).
    """
    with stage(trace, "plan"):
        sketched = [
            repair(problem.graph, (), _edit_goal(task.goal), cost=problem.cost, profile=problem.profile).plan
            for task in problem.tasks
        ]
    return _judge(problem, sketched, trace, repairing=False)


def _edit_goal(goal: Goal) -> Goal:
    return Goal(tuple(lit for lit in goal.literals if lit.predicate.flag in (None, Flag.OPEN, Flag.TOGGLED)))


def _judge(
    problem: Problem, plans: Sequence[Plan], trace: AgentTrace, *, repairing: bool, dropped: Sequence[Dropped] = ()
) -> Planned:
    """Repair (if the method does) and validate one plan per task; a task without a plan has the empty one."""
    planned = Planned()
    cut = trace.attempts - 1 in trace.cut
    if trace.tasks:
        trace.earlier.append(trace.tasks)
    trace.tasks = []
    for number, (task, proposed) in enumerate(zip(problem.tasks, plans, strict=True), start=1):
        unread = steps_among(dropped, number)
        edits: tuple[str, ...] = ()
        if repairing:
            with stage(trace, "repair"):
                repaired = repair(problem.graph, proposed, task.goal, cost=problem.cost, profile=problem.profile)
            plan, verdict, edits, before = repaired.plan, repaired.verdict, repaired.trace, repaired.before
            if task.goal.conditions and not verdict.valid and verdict.rank[:3] <= repaired.before.rank[:3]:
                # Shorter is no better where part of the goal is beyond the edit rules: what they take for needless may
                # be for that part.
                plan, verdict, edits = proposed, repaired.before, ()
        else:
            plan = proposed
            with stage(trace, "validate"):
                before = verdict = validate(problem.graph, plan, task.goal, cost=problem.cost, profile=problem.profile)
        planned.plans.append(plan)
        planned.verdicts.append(verdict)
        trace.tasks.append(
            TaskTrace(
                text=task.text,
                goal=task.goal.text(),
                objects=tuple(str(designator) for designator in task.objects),
                relations=tuple(str(relation) for relation in task.relations),
                proposed=tuple(str(action) for action in proposed),
                proposed_verdict=_summary(before, unread, cut),
                plan=tuple(str(action) for action in plan),
                edits=edits,
                verdict=_summary(verdict, unread, cut),
                unread=unread,
            )
        )
    return planned


def _ask(model: ChatModel, prompt: Prompt, trace: AgentTrace) -> str:
    [completion] = model.complete([prompt])
    if completion.cut:
        trace.cut.append(trace.attempts)
    trace.attempts += 1
    trace.seconds["plan"] = trace.seconds.get("plan", 0.0) + completion.seconds
    trace.prompt_tokens += completion.prompt_tokens
    trace.completion_tokens += completion.completion_tokens
    trace.prompts.append(prompt_hash(prompt.messages))
    trace.completions.append(completion.text)
    return completion.text


def prompt_hash(messages: Sequence[Message]) -> str:
    """Return the first 16 hexadecimal digits of the SHA-256 of a conversation."""
    return hashlib.sha256(msgspec.json.encode(messages)).hexdigest()[:16]


def _quote(plans: Sequence[Plan]) -> str:
    """Return plans as the model is asked to write them."""
    lines: list[str] = []
    for number, plan in enumerate(plans, start=1):
        lines.append(f"Task {number}:")
        lines += [action.words for action in plan]
    return "\n".join(lines)


def _summary(verdict: Verdict, unread: Sequence[str], cut: bool) -> str:
    """Return "valid" or the first thing that is wrong, then what the answer lacks: its end, or steps not read."""
    lacks = [*(["answer cut"] if cut else []), *([f"not read: {'; '.join(unread)}"] if unread else [])]
    return _fault(verdict) + (f" [{', '.join(lacks)}]" if lacks else "")


def _fault(verdict: Verdict) -> str:
    if verdict.violation is not None:
        return f"step {verdict.violation.step}: {verdict.violation}"
    if verdict.unmet:
        return "unmet: " + ", ".join(str(condition) for condition in verdict.unmet)
    if verdict.unsafe:
        return "unsafe: " + ", ".join(f"{flag.name.lower()}({obj})" for flag, obj in verdict.unsafe)
    return "valid"
