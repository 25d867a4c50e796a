"""Fast Downward on the PDDL export of a task, through unified-planning (extra `planning`)."""

from __future__ import annotations

from functools import cache
from typing import Any, cast

from gavel_agents.classical.needs import Needs
from gavel_agents.classical.search import Found, handy
from gavel_env.errors import NotExpressible
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import Profile, apply
from gavel_env.world_model.goals import GoalText, as_goal
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.planning_task import (
    Expression,
    PlanningTask,
    household_domain,
    planning_task,
)

__all__ = ["TIME_LIMIT_S", "going_to_each", "solve", "up_problem"]

_SEARCH = "eager_wastar([ff()],w=2)"
"""A* weighted by 2 with the FF heuristic: LAMA's first plan often goes somewhere for nothing."""

TIME_LIMIT_S = 60.0
"""Wall-clock seconds for one task."""


def solve(graph: SceneGraph, goal: GoalText, profile: Profile = Profile.PAPER, limit_s: float = TIME_LIMIT_S) -> Found:
    """Return the first plan that Fast Downward's LAMA finds for a goal.

    Args:
        graph: the state that is planned from.
        goal: g of one task.
        profile: rules profile.
        limit_s: seconds after which it gives up.
    """
    goal = as_goal(goal)
    from unified_planning.engines import PlanGenerationResultStatus as Status
    from unified_planning.shortcuts import OneshotPlanner

    try:
        task = planning_task(graph, goal, profile, Needs(graph, goal, profile).relevant)
    except NotExpressible as error:
        return Found(None, 0, str(error))
    problem = up_problem(task)
    with OneshotPlanner(name="fast-downward", params={"fast_downward_search_config": _SEARCH}) as planner:
        result = planner.solve(problem, timeout=limit_s)
    if result.plan is None:
        reasons = {
            Status.UNSOLVABLE_PROVEN: "Fast Downward proves that nothing brings the goal about",
            Status.UNSOLVABLE_INCOMPLETELY: "Fast Downward finds nothing that brings the goal about",
            Status.TIMEOUT: f"Fast Downward gave up after {limit_s:.0f} s",
        }
        return Found(None, 0, reasons.get(result.status, f"Fast Downward: {result.status.name.lower()}"))
    steps = [task.action(step.action.name, [str(a) for a in step.actual_parameters]) for step in result.plan.actions]
    return Found(going_to_each(graph, steps))


@cache
def _domain() -> Any:
    """Return the household domain as unified-planning reads it; once a process, since reading takes a second."""
    from unified_planning.io import PDDLReader
    from unified_planning.shortcuts import get_environment

    get_environment().credits_stream = None
    return PDDLReader().parse_problem_string(household_domain(), None)


def up_problem(task: PlanningTask) -> Any:
    """Return a task as a problem of unified-planning, which its engines solve and its simulator steps."""
    from unified_planning.model import Object

    problem = _domain().clone()
    for kind, names in (("thing", task.things), ("room", task.rooms)):
        problem.add_objects([Object(name, problem.user_type(kind)) for name in names])
    for fact in task.init:
        problem.set_initial_value(_expression(problem, fact, {}), True)
    problem.add_goal(_expression(problem, task.goal, {}))
    return problem


def _expression(problem: Any, expression: Expression, variables: dict[str, Any]) -> Any:
    """Return an expression in unified-planning's form."""
    from unified_planning.model import Variable

    build = problem.environment.expression_manager
    head, rest = expression[0], cast("tuple[Any, ...]", expression[1:])
    if head == "exists":
        variable = Variable(str(rest[0])[1:], problem.user_type("thing"))
        return build.Exists(_expression(problem, rest[1], {**variables, rest[0]: variable}), variable)
    if head in ("and", "or", "not"):
        parts = [_expression(problem, part, variables) for part in rest]
        return {"and": build.And, "or": build.Or, "not": build.Not}[str(head)](*parts)
    arguments = [variables.get(name) or problem.object(name) for name in rest]
    return problem.fluent(head)(*arguments)


def going_to_each(graph: SceneGraph, plan: list[Action]) -> tuple[Action, ...]:
    """Return a plan that also goes to what is near only because it lies on the same piece (`search.handy`)."""
    steps: list[Action] = []
    at: str | None = None
    for action in plan:
        target = action.target
        if action.primitive is Primitive.NAVIGATE_TO:
            at = target
        elif target is not None and target not in handy(graph, at) and target != graph.holding:
            going = Action(Primitive.NAVIGATE_TO, target)
            graph, at = apply(graph, going), target
            steps.append(going)
        graph = apply(graph, action)
        steps.append(action)
    return tuple(steps)
