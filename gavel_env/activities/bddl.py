"""BEHAVIOR's activity definitions: a parser of BDDL problems (`problem0.bddl`) into frozen structs.

A problem names objects by synset (`apple.n.01_1 - apple.n.01`), says how everything starts, and has a goal with
quantifiers over synsets. `gavel_env.activities` grounds it in a scene and turns its goal into a condition of
`gavel_env.world_model.conditions`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

import msgspec

from gavel_env.errors import MalformedGoal
from gavel_env.world_model.condition_text import Expression, read_expression

__all__ = ["Fact", "Node", "Problem", "parse_problem", "predicates", "synset_of"]

OPERATORS = frozenset({"and", "or", "not", "imply", "forall", "exists", "forn", "forpairs", "fornpairs"})
QUANTIFIERS: Mapping[str, int] = {"forall": 1, "exists": 1, "forn": 1, "forpairs": 2, "fornpairs": 2}
_COUNTED = frozenset({"forn", "fornpairs"})
_INSTANCE = re.compile(r"_(\d+|\*)$")


def synset_of(name: str) -> str:
    """Return the synset of an object name: `apple.n.01_2` -> `apple.n.01`."""
    return _INSTANCE.sub("", name)


class Fact(msgspec.Struct, frozen=True):
    """One line of an initial state: `(covered plate.n.04_1 stain.n.01_1)`, or its negation."""

    predicate: str
    args: tuple[str, ...]
    negated: bool = False

    def __str__(self) -> str:
        text = f"({' '.join((self.predicate, *self.args))})"
        return f"(not {text})" if self.negated else text


class Node(msgspec.Struct, frozen=True):
    """One node of a goal as BDDL writes it.

    Attributes:
        head: an operator or quantifier, or a predicate such as `ontop`.
        args: places of a predicate: variables and object names, both without `?`.
        parts: operands of an operator, or the body of a quantifier.
        variables: (variable, synset) of a quantifier, two for the pairs.
        count: of `forn` and `fornpairs`.
    """

    head: str
    args: tuple[str, ...] = ()
    parts: tuple[Node, ...] = ()
    variables: tuple[tuple[str, str], ...] = ()
    count: int = 0

    def __str__(self) -> str:
        words = [self.head]
        if self.head in _COUNTED:
            words.append(f"({self.count})")
        words.extend(f"(?{name} - {synset})" for name, synset in self.variables)
        words.extend(self.args)
        words.extend(map(str, self.parts))
        return f"({' '.join(words)})"


class Problem(msgspec.Struct, frozen=True):
    """An activity.

    Attributes:
        name: activity, as in `putting_away_toys`.
        objects: object names by synset, in the order written; a name that ends in `_*` stands for all others there are.
        init: how everything starts.
        goal: what is to hold.
    """

    name: str
    objects: Mapping[str, tuple[str, ...]]
    init: tuple[Fact, ...]
    goal: Node

    def names(self) -> tuple[str, ...]:
        """Return every object name."""
        return tuple(name for names in self.objects.values() for name in names)

    def __str__(self) -> str:
        objects = " ".join(f"{' '.join(names)} - {synset}" for synset, names in self.objects.items())
        init = " ".join(map(str, self.init))
        head = f"(define (problem {self.name}-0) (:domain omnigibson)"
        return f"{head} (:objects {objects}) (:init {init}) (:goal {self.goal}))"


def parse_problem(text: str, place: str = "problem") -> Problem:
    """Read a BDDL problem; `parse_problem(str(p)) == p`.

    Raises:
        MalformedGoal: names the place and the part that is wrong.
    """
    expression = read_expression(text, place)
    sections = {}
    if not isinstance(expression, str):
        for part in expression:
            if not isinstance(part, str) and part and isinstance(part[0], str):
                sections[part[0]] = part[1:]
    for need in ("problem", ":objects", ":init", ":goal"):
        if not sections.get(need):
            raise MalformedGoal(f"{place}: no section ({need} ...); sections: {', '.join(sorted(sections)) or 'none'}")
    name = _word(sections["problem"][0], place).rsplit("-", 1)[0]
    objects = _objects(sections[":objects"], place)
    init = tuple(_fact(part, place) for part in sections[":init"])
    goals = [_node(part, place) for part in sections[":goal"]]
    goal = goals[0] if len(goals) == 1 else Node("and", parts=tuple(goals))
    problem = Problem(name, objects, init, goal)
    _check_names(problem, place)
    return problem


def predicates(node: Node, negated: bool = False) -> Iterator[tuple[str, bool]]:
    """Yield (predicate, whether under an odd number of negations) of every atom of a goal."""
    if node.head not in OPERATORS:
        yield node.head, negated
        return
    for index, part in enumerate(node.parts):
        flips = node.head == "not" or (node.head == "imply" and index == 0)
        yield from predicates(part, negated != flips)


def _word(expression: Expression, place: str) -> str:
    if not isinstance(expression, str):
        raise MalformedGoal(f"{place}: a name is expected, not a parenthesis")
    return expression


def _words(expression: Expression, place: str) -> list[str]:
    if isinstance(expression, str):
        raise MalformedGoal(f"{place}: a parenthesis is expected, not {expression!r}")
    return [_word(part, place) for part in expression]


def _objects(section: list[Expression], place: str) -> dict[str, tuple[str, ...]]:
    objects: dict[str, tuple[str, ...]] = {}
    names: list[str] = []
    words = iter(_words(section, place))
    for word in words:
        if word == "-":
            synset = next(words, None)
            if synset is None:
                raise MalformedGoal(f"{place}: (:objects ...) ends after a hyphen; a synset is expected")
            objects[synset] = (*objects.get(synset, ()), *names)
            names = []
        else:
            names.append(word)
    if names:
        raise MalformedGoal(f"{place}: (:objects ...) gives no synset for {', '.join(names)}")
    return objects


def _fact(expression: Expression, place: str) -> Fact:
    if not isinstance(expression, str) and expression and expression[0] == "not" and len(expression) == 2:
        inner = _fact(expression[1], place)
        return Fact(inner.predicate, inner.args, not inner.negated)
    predicate, *args = _words(expression, place) or [""]
    if not args:
        raise MalformedGoal(f"{place}: (:init ...) has a fact without places: {predicate!r}")
    return Fact(predicate, tuple(arg.lstrip("?") for arg in args))


def _node(expression: Expression, place: str) -> Node:
    if isinstance(expression, str) or not expression:
        raise MalformedGoal(f"{place}: a condition is expected, not {expression!r}")
    head, rest = _word(expression[0], place), expression[1:]
    if head in QUANTIFIERS:
        count = 0
        if head in _COUNTED:
            words = _words(rest[0], place) if rest else []
            if len(words) != 1 or not words[0].isdigit():
                raise MalformedGoal(f"{place}: {head} needs a whole number in parentheses")
            count, rest = int(words[0]), rest[1:]
        if len(rest) != QUANTIFIERS[head] + 1:
            raise MalformedGoal(f"{place}: {head} takes {QUANTIFIERS[head]} variable(s) and one body")
        variables = tuple(_variable(part, place) for part in rest[:-1])
        return Node(head, parts=(_node(rest[-1], place),), variables=variables, count=count)
    if head in OPERATORS:
        parts = tuple(_node(part, place) for part in rest)
        if (head == "not" and len(parts) != 1) or (head == "imply" and len(parts) != 2):
            raise MalformedGoal(f"{place}: {head} has {len(parts)} part(s)")
        return Node(head, parts=parts)
    return Node(head, args=tuple(word.lstrip("?") for word in _words(rest, place)))


def _variable(expression: Expression, place: str) -> tuple[str, str]:
    words = _words(expression, place)
    if len(words) != 3 or words[1] != "-":
        raise MalformedGoal(f"{place}: a variable is written (?x - synset), not ({' '.join(words)})")
    return words[0].lstrip("?"), words[2]


def _check_names(problem: Problem, place: str) -> None:
    known = frozenset(problem.names())
    for fact in problem.init:
        places = fact.args[:1] if fact.predicate == "inroom" else fact.args
        for name in places:
            if name not in known:
                raise MalformedGoal(f"{place}: (:init ...) speaks of {name!r}, which (:objects ...) does not have")
