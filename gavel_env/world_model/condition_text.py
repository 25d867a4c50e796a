"""The text form of goal conditions, BDDL's own: `(forall (?x apple_0 apple_1) (inside ?x fridge_0))`."""

from __future__ import annotations

from typing import TypeAlias

from gavel_env.errors import MalformedGoal, nearest_names
from gavel_env.world_model.conditions import (
    PREDICATES,
    And,
    Atom,
    Exists,
    ForAll,
    Formula,
    ForN,
    ForPairs,
    Imply,
    Not,
    Or,
)

__all__ = ["Expression", "parse_formula", "read_expression"]

Expression: TypeAlias = str | list["Expression"]


def read_expression(text: str, place: str = "condition") -> Expression:
    """Read one parenthesised expression; `;` starts a comment.

    Raises:
        MalformedGoal: parentheses do not match, or something stands before or after the expression.
    """
    tokens = "\n".join(line.split(";")[0] for line in text.splitlines()).replace("(", " ( ").replace(")", " ) ").split()
    stack: list[list[Expression]] = [[]]
    for token in tokens:
        if token == "(":
            stack.append([])
        elif token == ")":
            if len(stack) == 1:
                raise MalformedGoal(f"{place}: a parenthesis closes that was never opened")
            done = stack.pop()
            stack[-1].append(done)
        else:
            stack[-1].append(token)
    if len(stack) != 1:
        raise MalformedGoal(f"{place}: {len(stack) - 1} parentheses are not closed")
    if len(stack[0]) != 1:
        raise MalformedGoal(f"{place}: {len(stack[0])} expressions where one is expected")
    return stack[0][0]


def parse_formula(text: str) -> Formula:
    """Read a condition in text form; `parse_formula(str(c)) == c`.

    Raises:
        MalformedGoal: says which part is wrong, and how.
    """
    return _formula(read_expression(text))


def _words(expression: Expression, what: str) -> tuple[str, ...]:
    if isinstance(expression, str) or not expression or not all(isinstance(part, str) for part in expression):
        raise MalformedGoal(f"{what} needs words in parentheses, not {_shown(expression)}")
    return tuple(str(part) for part in expression)


def _shown(expression: Expression) -> str:
    return expression if isinstance(expression, str) else f"({' '.join(map(_shown, expression))})"[:80]


_LENGTHS = {"not": 2, "imply": 3, "forall": 3, "exists": 3, "forn": 4, "forpairs": 4}


def _formula(expression: Expression) -> Formula:
    if isinstance(expression, str) or not expression or not isinstance(expression[0], str):
        raise MalformedGoal(f"{_shown(expression)!r} is not a condition; write (predicate place ...)")
    head = expression[0]
    rest = expression[1:]
    if head in _LENGTHS and len(expression) != _LENGTHS[head]:
        raise MalformedGoal(f"{head} takes {_LENGTHS[head] - 1} part(s), not {len(rest)}: {_shown(expression)}")
    if head in ("and", "or"):
        parts = tuple(_formula(part) for part in rest)
        return And(parts) if head == "and" else Or(parts)
    if head == "not":
        return Not(_formula(rest[0]))
    if head == "imply":
        return Imply(_formula(rest[0]), _formula(rest[1]))
    if head in ("forall", "exists"):
        variable, *domain = _words(rest[0], head)
        made = ForAll if head == "forall" else Exists
        return made(variable, tuple(domain), _formula(rest[1]))
    if head == "forn":
        (count,) = _words(rest[0], head)
        variable, *domain = _words(rest[1], head)
        if not count.isdigit():
            raise MalformedGoal(f"forn counts with a whole number, not {count!r}")
        return ForN(variable, tuple(domain), _formula(rest[2]), int(count))
    if head == "forpairs":
        variable, *domain = _words(rest[0], head)
        other, *others = _words(rest[1], head)
        return ForPairs(variable, tuple(domain), other, tuple(others), _formula(rest[2]))
    if head not in PREDICATES:
        near = nearest_names(head, PREDICATES)
        hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(sorted(PREDICATES))}"
        raise MalformedGoal(f"unknown predicate {head!r} in {_shown(expression)}; {hint}")
    args = _words(rest, head)
    if len(args) != PREDICATES[head]:
        raise MalformedGoal(f"{head} takes {PREDICATES[head]} place(s), not {len(args)}: {_shown(expression)}")
    return Atom(head, args)
