"""Goal literals: their text, the instances that they speak of, and when they hold."""

from __future__ import annotations

import itertools

import hypothesis.strategies as st
import pytest
from hypothesis import assume, given, settings
from support.worlds import kitchen

from gavel_env.errors import MalformedGoal, UnknownObject
from gavel_env.world_model.actions import normalise_name
from gavel_env.world_model.goals import (
    Designator,
    Goal,
    Literal,
    Predicate,
    as_goal,
    check_goal,
    fitting,
    parse_goal,
    parse_literal,
    unmet,
)
from gavel_env.world_model.graph import Flag, Node, Relation, SceneGraph
from gavel_env.world_model.ontology import default_ontology

NAMES = st.from_regex(r"[a-z][a-z0-9]*(_[a-z0-9]+){0,3}", fullmatch=True).filter(lambda n: normalise_name(n) == n)
DESIGNATORS = st.builds(Designator, NAMES, st.one_of(st.none(), NAMES))


@st.composite
def literals(draw: st.DrawFn) -> Literal:
    predicate = draw(st.sampled_from(Predicate))
    second = draw(DESIGNATORS) if predicate.arity == 2 else None
    return Literal(predicate, draw(DESIGNATORS), second, draw(st.booleans()))


@given(literals())
@settings(max_examples=300, deadline=None)
def test_text_of_a_literal_is_read_back(literal: Literal) -> None:
    assert parse_literal(str(literal)) == literal


@pytest.mark.parametrize(
    ("text", "canonical"),
    [
        ("on_top(apple, kitchen_table)", "on_top(apple, kitchen_table)"),
        ("OnTop( the Apple , kitchen table )", "on_top(apple, kitchen_table)"),
        ("not open(fridge@kitchen)", "not open(fridge@kitchen)"),
        ("!open(fridge_0)", "not open(fridge_0)"),
        ("in(apple, bottom_cabinet @ private office)", "inside(apple, bottom_cabinet@private_office)"),
        ("toggled_on(stove)", "toggled(stove)"),
        ("in_room(apple, kitchen)", "in_room(apple, kitchen)"),
    ],
)
def test_literals_are_read_tolerantly(text: str, canonical: str) -> None:
    assert str(parse_literal(text)) == canonical


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is not a literal"),
        ("apple on table", "is not a literal"),
        ("on_top(apple)", "takes 2"),
        ("open(fridge, kitchen)", "takes 1"),
        ("coked(apple)", "did you mean 'cooked'"),
        ("zzz(apple)", "known: on_top"),
        ("open(fridge@)", "name@room"),
        ("on_top(apple, table, chair)", "is not a literal"),
    ],
)
def test_malformed_literals_say_what_is_wrong(text: str, said: str) -> None:
    with pytest.raises(MalformedGoal) as error:
        parse_literal(text)
    assert said in str(error.value)


@given(st.text(max_size=60))
@settings(max_examples=300, deadline=None)
def test_any_text_is_a_literal_or_a_typed_error(text: str) -> None:
    try:
        literal = parse_literal(text)
    except MalformedGoal:
        return
    assert (literal.object is None) == (literal.predicate.arity == 1)


# --- designators ---------------------------------------------------------------------------------------------------

TWO = {"apple_1": "on bookcase_0", "countertop_1": "floor living_room_0"}


@pytest.mark.parametrize(
    ("designator", "expected"),
    [
        ("apple_1", ("apple_1",)),
        ("apple", ("apple_0", "apple_1")),
        ("apple@kitchen", ("apple_0",)),
        ("apple@living_room_0", ("apple_1",)),
        ("apple_1@kitchen", ()),
        ("apple_1@living_room", ("apple_1",)),
        ("apple@garage", ()),
        ("piano", ()),
        ("countertop", ("countertop_0", "countertop_1")),
    ],
)
def test_fitting(designator: str, expected: tuple[str, ...]) -> None:
    assert fitting(kitchen(TWO), Designator.parse(designator)) == expected


def test_held_things_are_in_the_robots_room() -> None:
    graph = kitchen({"apple_0": "held"}, robot_room="living_room_0")
    assert fitting(graph, Designator("apple", "living_room")) == ("apple_0",)
    assert fitting(graph, Designator("apple", "kitchen")) == ()


def test_where_the_place_is_unknown_the_stated_room_counts() -> None:
    node = Node("pear_0", default_ontology()["pear"], False, stated_room="kitchen")
    graph = kitchen().with_nodes({"pear_0": node})
    assert fitting(graph, Designator("pear", "kitchen")) == ("pear_0",)
    assert fitting(graph, Designator("pear", "living_room")) == ()


# --- predicates ----------------------------------------------------------------------------------------------------

FLOOR = {"bowl_0": "floor kitchen_0"}
PREDICATES = {
    "on_top(apple, countertop)": (kitchen(), kitchen({"apple_0": "on stove_0"})),
    "inside(steak, fridge)": (kitchen(), kitchen({"steak_0": "on fridge_0"})),
    "under(bowl, breakfast_table)": (
        kitchen(FLOOR, next_to=[("bowl_0", "breakfast_table_0")]),
        kitchen(FLOOR),
    ),
    "next_to(bowl, fridge)": (kitchen(FLOOR, next_to=[("bowl_0", "fridge_0")]), kitchen(FLOOR)),
    "next_to(bowl, backpack)": (kitchen(), kitchen(FLOOR)),
    "in_room(apple, kitchen)": (kitchen(), kitchen({"apple_0": "on bookcase_0"})),
    "in_room(apple, kitchen_0)": (kitchen(), kitchen({"apple_0": "on bookcase_0"})),
} | {
    f"{flag.name.lower()}(microwave)": (kitchen(flags={flag.name.lower(): ("microwave_0",)}), kitchen())
    for flag in Flag
}


@pytest.mark.parametrize("text", PREDICATES)
def test_predicate_holds_and_fails_and_is_negated(text: str) -> None:
    true, false = PREDICATES[text]
    literal, negated = parse_literal(text), parse_literal(f"not {text}")
    assert unmet(Goal((literal,)), true) == ()
    assert unmet(Goal((literal,)), false) == (literal,)
    assert unmet(Goal((negated,)), true) == (negated,)
    assert unmet(Goal((negated,)), false) == ()


def test_every_predicate_is_tested() -> None:
    assert {parse_literal(text).predicate for text in PREDICATES} == set(Predicate)


def test_next_to_pairs_are_ordered_by_name() -> None:
    graph = kitchen(FLOOR, next_to=[("bowl_0", "fridge_0")])
    assert unmet(parse_goal(["next_to(fridge, bowl)"]), graph) == ()
    assert unmet(parse_goal(["next_to(bowl, bowl)"]), graph) != ()


def test_things_on_or_in_one_thing_are_beside_each_other() -> None:
    graph = kitchen({"apple_0": "in fridge_0", "mug_0": "on fridge_0"})
    for a, b, beside in (("apple_0", "steak_0", True), ("bowl_0", "backpack_0", True), ("apple_0", "mug_0", False)):
        assert graph.beside(a, b) == graph.beside(b, a) == beside


def test_things_on_the_floor_of_a_room_are_not_beside_each_other() -> None:
    assert unmet(parse_goal(["next_to(oven, stove)"]), kitchen()) != ()


def test_nothing_is_under_what_has_no_room_beneath() -> None:
    graph = kitchen(FLOOR, next_to=[("bowl_0", "fridge_0")])
    assert not default_ontology()["fridge"].clearance
    assert unmet(parse_goal(["under(bowl, fridge)"]), graph) != ()


# --- which instance ------------------------------------------------------------------------------------------------


def test_any_instance_that_fits_will_do() -> None:
    graph = kitchen(TWO)
    assert unmet(parse_goal(["on_top(apple, bookcase)"]), graph) == ()
    assert unmet(parse_goal(["on_top(apple@kitchen, bookcase)"]), graph) != ()
    assert unmet(parse_goal(["on_top(apple_0, bookcase)"]), graph) != ()


def test_literals_with_one_subject_speak_of_one_instance() -> None:
    goal = parse_goal(["on_top(apple, bookcase)", "cooked(apple)"])
    assert len(unmet(goal, kitchen(TWO, flags={"cooked": ("apple_0",)}))) == 1
    assert unmet(goal, kitchen(TWO, flags={"cooked": ("apple_1",)})) == ()


def test_an_object_that_is_a_subject_elsewhere_is_the_same_instance() -> None:
    """A bowl in the bookcase and an apple in another bowl do not make an apple in the bowl in the bookcase."""
    goal = parse_goal(["inside(bowl, bookcase)", "inside(apple_0, bowl)"])
    places = {"bowl_0": "in bookcase_0", "bowl_1": "on countertop_0"}
    assert len(unmet(goal, kitchen({**places, "apple_0": "in bowl_1"}))) == 1
    assert unmet(goal, kitchen({**places, "apple_0": "in bowl_0"})) == ()


def test_negation_over_a_category_means_none_of_them() -> None:
    goal = parse_goal(["not cooked(apple)"])
    assert unmet(goal, kitchen(TWO)) == ()
    assert unmet(goal, kitchen(TWO, flags={"cooked": ("apple_1",)})) == goal.literals


def test_a_designator_that_nothing_fits_is_unmet_and_its_negation_met() -> None:
    assert unmet(parse_goal(["open(piano)"]), kitchen()) != ()
    assert unmet(parse_goal(["not open(piano)"]), kitchen()) == ()


SUBJECTS = ("apple", "bowl", "bowl@kitchen", "apple_0", "steak")
OBJECTS = ("countertop", "bowl", "fridge", "bookcase", "countertop_0")


@st.composite
def small_worlds(draw: st.DrawFn) -> SceneGraph:
    rests = st.sampled_from(("on countertop_0", "in fridge_0", "in bookcase_0", "on bookcase_0", "on countertop_1"))
    places = {o: draw(rests) for o in ("apple_0", "apple_1", "bowl_0", "bowl_1", "steak_0")}
    for o in ("apple_0", "apple_1", "steak_0"):
        if draw(st.booleans()):
            places[o] = draw(st.sampled_from(("in bowl_0", "in bowl_1")))
    cooked = draw(st.sets(st.sampled_from(("apple_0", "apple_1", "steak_0"))))
    return kitchen({**places, "countertop_1": "floor living_room_0"}, flags={"cooked": cooked})


@st.composite
def small_goals(draw: st.DrawFn) -> Goal:
    texts = st.one_of(
        st.builds("inside({}, {})".format, st.sampled_from(SUBJECTS), st.sampled_from(OBJECTS)),
        st.builds("on_top({}, {})".format, st.sampled_from(SUBJECTS), st.sampled_from(OBJECTS)),
        st.builds("cooked({})".format, st.sampled_from(SUBJECTS)),
    )
    lines = draw(st.lists(st.tuples(st.sampled_from(("", "", "not ")), texts), min_size=1, max_size=4))
    return parse_goal(negation + text for negation, text in lines)


def fewest_unmet(goal: Goal, graph: SceneGraph) -> int:
    """Return the fewest literals that any choice of instances leaves unmet, by trying all of them."""
    subjects = sorted({lit.subject for lit in goal.literals if not lit.negated}, key=str)
    instances = [fitting(graph, s) or (None,) for s in subjects]
    return min(
        sum(not true_under(graph, lit, dict(zip(subjects, choice, strict=True))) for lit in goal.literals)
        for choice in itertools.product(*instances)
    )


def true_under(graph: SceneGraph, literal: Literal, chosen: dict[Designator, str | None]) -> bool:
    def those(designator: Designator) -> tuple[str, ...]:
        one = chosen.get(designator)
        return fitting(graph, designator) if one is None else (one,)

    if literal.predicate is Predicate.COOKED:
        holds = any(s in graph.flags[Flag.COOKED] for s in those(literal.subject))
    else:
        relation = Relation.INSIDE if literal.predicate is Predicate.INSIDE else Relation.ON_TOP
        assert literal.object is not None
        pairs = itertools.product(those(literal.subject), those(literal.object))
        holds = any(graph.supports[s] == (relation, o) for s, o in pairs)
    return holds != literal.negated


@given(small_goals(), small_worlds())
@settings(max_examples=400, deadline=None)
def test_unmet_leaves_as_few_literals_as_the_best_choice_of_instances(goal: Goal, graph: SceneGraph) -> None:
    missing = unmet(goal, graph)
    assert len(missing) == fewest_unmet(goal, graph)
    assert list(missing) == [lit for lit in goal.literals if lit in missing]


# --- goals ---------------------------------------------------------------------------------------------------------


def test_union_keeps_order_and_drops_repetitions() -> None:
    first, second = parse_goal(["open(fridge)", "cooked(apple)"]), parse_goal(["cooked(apple)", "open(oven)"])
    assert (first | second).text() == ("open(fridge)", "cooked(apple)", "open(oven)")


@given(small_goals(), small_goals(), small_worlds())
@settings(max_examples=150, deadline=None)
def test_a_union_that_is_met_has_both_parts_met(first: Goal, second: Goal, graph: SceneGraph) -> None:
    # A negated literal of one part is about the instances that the other part binds, so it may be met only there.
    assume(not any(literal.negated for literal in (first | second).literals))
    if not unmet(first | second, graph):
        assert not unmet(first, graph)
        assert not unmet(second, graph)


def test_wants_asks_for_the_state_itself() -> None:
    goal = parse_goal(["open(fridge)", "not toggled(stove_0)"])
    assert goal.wants(Flag.OPEN, "fridge_0", kitchen())
    assert not goal.wants(Flag.OPEN, "oven_0", kitchen())
    assert not goal.wants(Flag.TOGGLED, "stove_0", kitchen())


def test_subjects_are_what_literals_speak_of_first() -> None:
    goal = parse_goal(["on_top(apple, bowl)", "open(fridge@kitchen)"])
    assert goal.subjects == {Designator("apple"), Designator("fridge", "kitchen")}


def test_further_conditions_are_part_of_the_goal() -> None:
    class Never:
        def holds(self, graph: SceneGraph) -> bool:
            return graph.holding == "apple_0"

        def wants(self, flag: Flag, obj: str, graph: SceneGraph) -> bool:
            return False

        def text(self) -> str:
            return "the apple is held"

    condition = Never()
    goal = parse_goal(["on_top(apple, countertop)"]) | Goal(conditions=(condition,))
    assert unmet(goal, kitchen()) == (condition,)
    assert unmet(goal, kitchen({"apple_0": "held", "apple_1": "on countertop_0"})) == ()


# --- goals that are given -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("literals", "unknown"),
    [
        (["on_top(apple, stove)", "in_room(bowl, kitchen)"], None),
        (["in_room(apple, living_room_0)"], None),
        (["inside(apple@bathroom, fridge)"], None),  # no apple is there, but apples there are
        (["on_top(apple, stove)", "cooked(napkin)"], "unknown object 'napkin'"),
        (["inside(apple@bathroom, fridgee)"], "unknown object 'fridgee'.*did you mean 'fridge'"),
        (["inside(napkin@kitchen, fridge)"], "unknown object 'napkin@kitchen'"),
        (["in_room(apple, bathroom)"], r"unknown object 'bathroom'.*the goal in_room\(apple, bathroom\)"),
        (["in_room(napkin, kitchen)"], "unknown object 'napkin'"),
        (["in_room(apple, kitchen)", "on_top(napkin, stove)"], "unknown object 'napkin'.*on_top"),
        (["on_top(apple@bathroom, napkin)"], "unknown object 'napkin'"),
        (["in_room(apple, kitchen)", "next_to(apple, napkin)"], "unknown object 'napkin'.*next_to"),
    ],
)
def test_a_goal_speaks_of_what_the_graph_has(literals: list[str], unknown: str | None) -> None:
    goal = parse_goal(literals)
    if unknown is None:
        check_goal(goal, kitchen())
        return
    with pytest.raises(UnknownObject, match=unknown):
        check_goal(goal, kitchen())


def test_a_goal_may_be_given_in_every_form() -> None:
    wanted = parse_goal(["on_top(apple, stove)", "not open(fridge)"])
    one, other = wanted.literals
    assert as_goal(wanted) is wanted
    assert (
        as_goal("on_top(apple, stove), not open(fridge)")
        == as_goal([str(one), other])
        == as_goal((one, other))
        == wanted
    )
    assert as_goal(one) == Goal((one,))
    nothings: tuple[str | list[str], ...] = ("", [], " ")
    for nothing in nothings:
        with pytest.raises(MalformedGoal, match="asks for nothing"):
            as_goal(nothing)
    with pytest.raises(MalformedGoal, match="goal 7 is not text"):
        as_goal(7)  # type: ignore[arg-type]
