"""Goal conditions with quantifiers: both forms, when they hold, what they ask for, and how planners are told."""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping

import hypothesis.strategies as st
import msgspec
import pytest
from hypothesis import given, settings
from support.worlds import kitchen

from gavel_env.errors import MalformedGoal
from gavel_env.world_model.condition_text import parse_formula, read_expression
from gavel_env.world_model.conditions import (
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
    conjuncts,
    plain_literals,
)
from gavel_env.world_model.goals import Goal, unmet
from gavel_env.world_model.graph import Flag, SceneGraph

THINGS = ("apple_0", "apple_1", "bowl_0", "fridge_0", "breakfast_table_0")
VARIABLES = ("?x", "?y", "?z")
places = st.sampled_from(THINGS + VARIABLES)
domains = st.lists(st.sampled_from(THINGS), min_size=1, max_size=3, unique=True).map(tuple)
unary = st.builds(lambda p, a: Atom(p, (a,)), st.sampled_from(("open", "cooked", "dirty")), places)
RELATED = ("on_top", "inside", "within", "next_to")
binary = st.builds(lambda p, a, b: Atom(p, (a, b)), st.sampled_from(RELATED), places, places)
atoms = st.one_of(unary, binary, st.builds(lambda a: Atom("on_floor", (a, "kitchen_0")), places))


def _grown(inner: st.SearchStrategy[Formula]) -> st.SearchStrategy[Formula]:
    parts = st.lists(inner, min_size=1, max_size=3).map(tuple)
    variable = st.sampled_from(VARIABLES)
    return st.one_of(
        st.builds(Not, inner),
        st.builds(And, parts),
        st.builds(Or, parts),
        st.builds(Imply, inner, inner),
        st.builds(ForAll, variable, domains, inner),
        st.builds(Exists, variable, domains, inner),
        st.builds(ForN, variable, domains, inner, st.integers(0, 3)),
        st.builds(ForPairs, st.just("?x"), domains, st.just("?y"), domains, inner),
    )


formulas = st.recursive(atoms, _grown, max_leaves=6)
closed = formulas.map(lambda f: ForAll("?x", ("apple_0",), Exists("?y", ("bowl_0",), Exists("?z", ("fridge_0",), f))))


@given(formulas)
@settings(max_examples=300, deadline=None)
def test_both_forms_of_a_condition_are_read_back(formula: Formula) -> None:
    assert parse_formula(str(formula)) == formula
    assert msgspec.json.decode(msgspec.json.encode(formula), type=Formula) == formula
    assert msgspec.convert(json.loads(msgspec.json.encode(formula)), type=Formula) == formula


FIRST = ("on breakfast_table_0", "in fridge_0", "in bowl_0", "floor kitchen_0")
SECOND = ("on breakfast_table_0", "in bowl_0", "floor kitchen_0")
BOWL = ("on breakfast_table_0", "in fridge_0")
COMBINATIONS = [
    {"apple_0": first, "apple_1": second, "bowl_0": bowl}
    for first, second, bowl in itertools.product(FIRST, SECOND, BOWL)
]
STATES = [
    kitchen(
        moved, flags={"cooked": ["apple_0"] if index % 2 else ["apple_1"], "open": ["fridge_0"] if index % 3 else []}
    )
    for index, moved in enumerate(COMBINATIONS)
]


def expected(formula: Formula, graph: SceneGraph, bound: Mapping[str, str]) -> bool:
    """Evaluate by the definitions, over the whole domain, with none of the module's own code."""
    if isinstance(formula, Atom):
        args = [bound.get(a, a) for a in formula.args]
        if len(args) == 1:
            return args[0] in graph.flags[Flag[formula.predicate.upper()]]
        edges = {(name, a, b) for name, a, b in graph.edges()}
        held = {(a, b) for name, a, b in edges if name in ("on_top", "object_inside")}
        obj, other = args
        if formula.predicate == "on_floor":
            return ("room_inside", obj, other) in edges and not any(a == obj for a, _ in held)
        if formula.predicate == "next_to":
            mine = {edge[::2] for edge in edges if edge[1] == obj and edge[0] in ("on_top", "object_inside")}
            theirs = {edge[::2] for edge in edges if edge[1] == other and edge[0] in ("on_top", "object_inside")}
            return obj != other and bool(mine & theirs)
        if formula.predicate == "within":
            at: str | None = obj
            while at is not None:
                if ("object_inside", at, other) in edges:
                    return True
                at = next((b for a, b in held if a == at), None)
            return False
        return ({"inside": "object_inside"}.get(formula.predicate, formula.predicate), obj, other) in edges
    if isinstance(formula, Not):
        return not expected(formula.body, graph, bound)
    if isinstance(formula, And | Or):
        values = [expected(part, graph, bound) for part in formula.parts]
        return False not in values if isinstance(formula, And) else True in values
    if isinstance(formula, Imply):
        return expected(formula.body, graph, bound) or not expected(formula.premise, graph, bound)
    if isinstance(formula, ForPairs):
        table = [
            [a != b and expected(formula.body, graph, {**bound, "?x": a, "?y": b}) for b in formula.other_domain]
            for a in formula.domain
        ]
        least = min(len(table), len(table[0]))
        return sum(map(any, table)) >= least and sum(map(any, zip(*table, strict=True))) >= least
    values = [expected(formula.body, graph, {**bound, formula.variable: member}) for member in formula.domain]
    if isinstance(formula, ForN):
        return values.count(True) == formula.count
    return all(values) if isinstance(formula, ForAll) else any(values)


@given(closed, st.integers(0, len(STATES) - 1))
@settings(max_examples=600, deadline=None)
def test_conditions_hold_when_their_definition_says_so(formula: Formula, index: int) -> None:
    graph = STATES[index]
    assert formula.holds(graph) == expected(formula, graph, {})
    assert (unmet(Goal(conditions=(formula,)), graph) == ()) == formula.holds(graph)


def test_exactly_means_exactly() -> None:
    graph = kitchen({"apple_0": "in bowl_0", "apple_1": "in bowl_0"})
    counts = [
        n for n in range(4) if parse_formula(f"(forn ({n}) (?x apple_0 apple_1) (inside ?x bowl_0))").holds(graph)
    ]
    assert counts == [2]


@pytest.mark.parametrize(
    ("bowls", "met"),
    [
        ({"apple_0": "in bowl_0", "apple_1": "in bowl_1"}, True),
        ({"apple_0": "in bowl_1", "apple_1": "in bowl_0"}, True),
        ({"apple_0": "in bowl_0", "apple_1": "in bowl_0"}, False),  # every apple is in a bowl, not every bowl has one
        ({"apple_0": "in bowl_0", "apple_1": "on stove_0"}, False),
    ],
)
def test_pairs_leave_nothing_over_on_either_side(bowls: dict[str, str], met: bool) -> None:
    graph = kitchen({"bowl_1": "on stove_0", **bowls})
    text = "(forpairs (?x apple_0 apple_1) (?y bowl_0 bowl_1) (inside ?x ?y))"
    assert parse_formula(text).holds(graph) == met
    turned = "(forpairs (?y bowl_0 bowl_1) (?x apple_0 apple_1) (inside ?x ?y))"
    assert parse_formula(turned).holds(graph) == met


def test_within_reaches_through_what_holds_a_thing_and_inside_does_not() -> None:
    graph = kitchen({"bowl_0": "in fridge_0", "apple_0": "in bowl_0"})
    assert parse_formula("(within apple_0 fridge_0)").holds(graph)
    assert not parse_formula("(inside apple_0 fridge_0)").holds(graph)
    assert not parse_formula("(within apple_0 breakfast_table_0)").holds(graph)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("(forall (?x fridge_0 oven_0) (open ?x))", True),
        ("(forall (?x fridge_0 oven_0) (not (open ?x)))", False),
        ("(not (forall (?x oven_0) (not (open fridge_0))))", True),
        ("(imply (open fridge_0) (open oven_0))", False),
        ("(exists (?x oven_0) (open ?x))", False),
        ("(open fridge)", True),
        ("(or (and (open fridge_0) (dirty oven_0)) (dirty fridge_0))", True),
        ("(or (and (not (open fridge_0)) (dirty oven_0)) (dirty fridge_0))", False),
        ("(not (and (open fridge_0) (dirty oven_0)))", False),
        ("(not (or (dirty oven_0) (and (dirty fridge_0) (not (open fridge_0)))))", True),
        ("(forn (1) (?x oven_0 fridge_0) (and (open ?x) (dirty ?x)))", True),
        ("(forpairs (?x oven_0) (?y fridge_0) (and (open ?y) (dirty ?x)))", True),
        ("(toggled fridge_0)", False),
    ],
)
def test_a_goal_wants_a_door_open_where_it_asks_for_it_positively(text: str, wanted: bool) -> None:
    goal = Goal(conditions=(parse_formula(text),))
    assert goal.wants(Flag.OPEN, "fridge_0", kitchen()) == wanted


def test_plain_conjunctions_become_literals_and_others_do_not() -> None:
    plain = plain_literals(
        parse_formula("(and (forall (?x cup_0 cup_1) (and (inside ?x box_0) (not (open box_0)))) (cooked egg_0))")
    )
    assert plain is not None
    assert [str(literal) for literal in plain] == [
        "inside(cup_0, box_0)",
        "not open(box_0)",
        "inside(cup_1, box_0)",
        "cooked(egg_0)",
    ]
    pairs = plain_literals(
        parse_formula("(forall (?x box_0 box_1) (forall (?y cup_0 cup_1) (and (on_top ?x ?y) (open cup_0) (open ?x))))")
    )
    assert pairs is not None
    assert [str(literal) for literal in pairs] == [
        "on_top(box_0, cup_0)", "open(cup_0)", "open(box_0)", "on_top(box_0, cup_1)",
        "on_top(box_1, cup_0)", "open(box_1)", "on_top(box_1, cup_1)",
    ]  # fmt: skip
    for text in (
        "(or (open cup_0) (open box_0))",
        "(on_floor cup_0 kitchen_0)",
        "(exists (?x cup_0) (open ?x))",
        "(and (open cup_0) (forall (?x cup_0) (or (open ?x) (open box_0))))",
        "(not (and (open cup_0) (open box_0)))",
    ):
        assert plain_literals(parse_formula(text)) is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("(opened fridge_0)", "unknown predicate 'opened' in (opened fridge_0); did you mean 'open'?"),
        ("(zzz fridge_0)", "unknown predicate 'zzz' in (zzz fridge_0); known: "),
        ("(open fridge_0 oven_0)", "open takes 1 place(s), not 2: (open fridge_0 oven_0)"),
        ("(inside apple_0)", "inside takes 2 place(s), not 1: (inside apple_0)"),
        ("(open (fridge_0))", "open needs words in parentheses, not"),
        ("(not (open a_0) (open b_0))", "not takes 1 part(s), not 2: (not (open a_0) (open b_0))"),
        ("(imply (open a_0))", "imply takes 2 part(s), not 1"),
        ("(forall (?x a_0))", "forall takes 2 part(s), not 1"),
        ("(exists (?x a_0))", "exists takes 2 part(s), not 1"),
        ("(forn (1) (?x a_0))", "forn takes 3 part(s), not 2"),
        ("(forpairs (?x a_0) (open ?x))", "forpairs takes 3 part(s), not 2"),
        ("(forn (two) (?x a_0) (open ?x))", "forn counts with a whole number, not 'two'"),
        ("(forn (-1) (?x a_0) (open ?x))", "forn counts with a whole number, not '-1'"),
        ("(forn 1 (?x a_0) (open ?x))", "forn needs words in parentheses, not 1"),
        ("(forall ?x (open ?x))", "forall needs words in parentheses, not ?x"),
        ("(exists () (open ?x))", "exists needs words in parentheses, not ()"),
        ("(forn (1) ?x (open ?x))", "forn needs words in parentheses, not ?x"),
        ("(forpairs ?x (?y b_0) (open ?x))", "forpairs needs words in parentheses, not ?x"),
        ("(forpairs (?x a_0) (?y (b_0)) (open ?x))", "forpairs needs words in parentheses, not (?y (b_0))"),
        ("open", "'open' is not a condition; write (predicate place ...)"),
        ("()", "'()' is not a condition"),
        ("((open a_0))", "'((open a_0))' is not a condition"),
        ("(and (open a_0)", "condition: 1 parentheses are not closed"),
        ("((and (open a_0)", "condition: 2 parentheses are not closed"),
        ("(open a_0))", "condition: a parenthesis closes that was never opened"),
        ("(open a_0) (open b_0)", "condition: 2 expressions where one is expected"),
        ("", "condition: 0 expressions where one is expected"),
    ],
)
def test_what_is_wrong_with_a_condition_is_said(text: str, said: str) -> None:
    with pytest.raises(MalformedGoal) as caught:
        parse_formula(text)
    assert str(caught.value).startswith(said)


def test_an_expression_says_where_it_was_read_and_passes_over_comments() -> None:
    with pytest.raises(MalformedGoal, match=r"^the goal: 1 parentheses"):
        read_expression("(", "the goal")
    assert read_expression("(and ; both (\n (open a_0)(open b_0) ) ; and no more )") == [
        "and", ["open", "a_0"], ["open", "b_0"],
    ]  # fmt: skip


def test_what_is_shown_of_a_long_condition_is_short() -> None:
    with pytest.raises(MalformedGoal) as caught:
        parse_formula(f"(opened {'x' * 300})")
    assert len(str(caught.value)) < 160


# --- what planners are told ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("condition", "told"),
    [
        ("(inside apple_0 fridge_0)", "inside(apple_0, fridge_0)"),
        ("(not (open fridge_0))", "not open(fridge_0)"),
        ("(not (not (open fridge_0)))", "not not open(fridge_0)"),
        ("(and (open a_0) (not (open b_0)))", "open(a_0) and not open(b_0)"),
        ("(or (open a_0) (and (open b_0) (open c_0)))", "open(a_0) or (open(b_0) and open(c_0))"),
        ("(imply (open a_0) (or (open b_0) (open c_0)))", "if open(a_0) then (open(b_0) or open(c_0))"),
        ("(forall (?x a_0 b_0) (open ?x))", "each A of a_0, b_0: open(A)"),
        ("(exists (?x a_0 b_0) (open ?x))", "some A of a_0, b_0: open(A)"),
        ("(forall (?x a_0) (open ?x))", "open(a_0)"),
        ("(exists (?x a_0) (not (open ?x)))", "not open(a_0)"),
        ("(forn (1) (?x a_0) (open ?x))", "exactly 1 A of a_0: open(A)"),
        (
            "(forall (?x a_0 b_0) (exists (?y c_0 d_0) (inside ?x ?y)))",
            "each A of a_0, b_0: some B of c_0, d_0: inside(A, B)",
        ),
        (
            "(forpairs (?x a_0 b_0) (?y c_0 d_0) (inside ?x ?y))",
            "pair off A of a_0, b_0 with B of c_0, d_0: inside(A, B)",
        ),
        (
            "(forall (?z e_0 f_0) (forpairs (?x a_0 b_0) (?y c_0 d_0) (inside ?x ?y)))",
            "each A of e_0, f_0: pair off B of a_0, b_0 with C of c_0, d_0: inside(B, C)",
        ),
    ],
)
def test_a_condition_is_told_in_words(condition: str, told: str) -> None:
    assert parse_formula(condition).text() == told


def test_conjuncts_are_the_parts_of_nested_conjunctions_in_order() -> None:
    found = conjuncts(parse_formula("(and (open a_0) (and (open b_0) (or (open c_0) (open d_0))))"))
    assert [str(part) for part in found] == ["(open a_0)", "(open b_0)", "(or (open c_0) (open d_0))"]


def test_every_atom_is_asked_with_its_polarity_and_the_domains_around_it() -> None:
    condition = parse_formula(
        "(forall (?x a_0 b_0) (imply (open ?x) (forpairs (?y c_0) (?z d_0) (not (inside ?y ?z)))))"
    )
    asked = [(str(atom), positive, dict(domains)) for atom, positive, domains in condition.asked()]
    outer = {"?x": ("a_0", "b_0")}
    assert asked == [
        ("(open ?x)", False, outer),
        ("(inside ?y ?z)", False, {**outer, "?y": ("c_0",), "?z": ("d_0",)}),
    ]
