"""Model-derived edits: one table from what a verdict says to small named rules that change the plan.

`VIOLATION_RULES` is keyed by the violated precondition, `LITERAL_RULES` by the predicate of an unmet goal literal,
`SAFETY_RULES` by what the plan leaves open or on. Quantified conditions are seen to as literals (`grounding`). `offers`
lists the edits for a verdict, best first.
"""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from gavel_agents.edits.condition_literals import grounded
from gavel_agents.edits.endings import LITERAL_RULES, SAFETY_RULES, in_order
from gavel_agents.edits.pruning import prune
from gavel_agents.edits.regression import act_for
from gavel_agents.edits.rule import Case, Change, Edit
from gavel_agents.edits.violations import OWN_RULES, VIOLATION_RULES
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import GoalText, Literal, as_goal, unmet
from gavel_env.world_model.graph import Flag
from gavel_env.world_model.own_actions import own_action
from gavel_env.world_model.verdict import Verdict

__all__ = ["LITERAL_RULES", "SAFETY_RULES", "VIOLATION_RULES", "Case", "Change", "Edit", "offers", "prune"]


def offers(verdict: Verdict, goal: GoalText, profile: Profile = Profile.PAPER) -> Iterator[Edit]:
    """Yield the model-derived edits of a verdict's plan, best first; none = left to the model."""
    goal = as_goal(goal)
    if goal.conditions:
        goal = grounded(goal, verdict)
        verdict = msgspec.structs.replace(verdict, unmet=unmet(goal, verdict.end))
    case = Case(verdict, goal, profile)
    if verdict.violation is not None:
        kind, subject, blocker, _ = verdict.violation
        because = f" (because of {blocker})" if blocker not in (None, subject) else ""
        cause = f"{kind.value}({subject}){because}"
        own = own_action(case.action.primitive) is not None
        for rule in OWN_RULES if own else VIOLATION_RULES[verdict.violation.kind]:
            for change in rule(case):
                yield Edit(rule.__name__, case.step, cause, change.text, change.plan)
        return
    for literal in in_order([lit for lit in verdict.unmet if isinstance(lit, Literal)]):
        for goal_rule in (*LITERAL_RULES.get(literal.predicate, ()), act_for):
            for change in goal_rule(case, literal):
                yield Edit(goal_rule.__name__, None, f"unmet {literal}", change.text, change.plan)
    for flag, obj in verdict.unsafe:
        for safety_rule in SAFETY_RULES[flag]:
            for change in safety_rule(case, obj):
                left = "left open" if flag is Flag.OPEN else "left on"
                yield Edit(safety_rule.__name__, None, f"{left} {obj}", change.text, change.plan)
