"""The canonical text of an action, and what the parser makes of what people and models write."""

from __future__ import annotations

import string

import hypothesis.strategies as st
import pytest
from hypothesis import given, settings

from gavel_env.errors import MalformedAction
from gavel_env.world_model.actions import Action, Primitive, normalise_name, parse_action
from gavel_env.world_model.ontology import default_ontology

NAMES = st.from_regex(r"[a-z][a-z0-9]*(_[a-z0-9]+){0,3}", fullmatch=True).filter(
    lambda name: normalise_name(name) == name
)
TARGETS = st.one_of(NAMES, st.builds("{}@{}".format, NAMES, NAMES))
ACTIONS = st.one_of(
    st.builds(Action, st.sampled_from([p for p in Primitive if p.takes_target]), TARGETS, st.just(())),
    st.just(Action(Primitive.RELEASE)),
)


@given(ACTIONS)
@settings(max_examples=500, deadline=None)
def test_canonical_text_is_read_back(action: Action) -> None:
    assert parse_action(str(action)) == action


def test_every_shipped_category_is_read_back_by_every_primitive() -> None:
    for name in default_ontology():
        for primitive in Primitive:
            action = Action(primitive, f"{name}_0") if primitive.takes_target else Action(primitive)
            assert parse_action(str(action)) == action


@given(ACTIONS, st.sampled_from(["{}", "  {}  ", "{};", "{}.", "{},"]), st.booleans())
@settings(max_examples=300, deadline=None)
def test_case_spacing_and_trailing_marks_do_not_matter(action: Action, frame: str, lower: bool) -> None:
    text = str(action).lower() if lower else str(action)
    assert parse_action(frame.format(text.replace("(", " ( ").replace(")", " )"))) == action


@pytest.mark.parametrize(
    ("text", "canonical"),
    [
        ("NAVIGATE_TO(fridge_0)", "NAVIGATE_TO(fridge_0)"),
        ("navigateTo(Fridge_0)", "NAVIGATE_TO(fridge_0)"),
        ("NavigateTo[fridge_0]", "NAVIGATE_TO(fridge_0)"),
        ("navigate to the fridge", "NAVIGATE_TO(fridge)"),
        ("go to the Bottom Cabinet 3", "NAVIGATE_TO(bottom_cabinet_3)"),
        ("PlaceInside(apple, fridge)", "PLACE_INSIDE(fridge)"),
        ("place_on_top(object=apple, target=kitchen_table)", "PLACE_ON_TOP(kitchen_table)"),
        ("put on top of the bottom_cabinet@private_office", "PLACE_ON_TOP(bottom_cabinet@private_office)"),
        ("PLACE_INSIDE(bottom_cabinet @ private office)", "PLACE_INSIDE(bottom_cabinet@private_office)"),
        ("pick up a bowl.", "GRASP(bowl)"),
        ("turn on stove", "TOGGLE_ON(stove)"),
        ("ToggleOff: 'stove_0'", "TOGGLE_OFF(stove_0)"),
        ("release", "RELEASE()"),
        ("Release(apple_0)", "RELEASE()"),
        ("RELEASE()", "RELEASE()"),
        ("open the fridge", "OPEN(fridge)"),
        ("shut(fridge)", "CLOSE(fridge)"),
        ("GRASP(apple) ;", "GRASP(apple)"),
        ("GRASP(apple ) .", "GRASP(apple)"),
        ("GRASP(-apple_0_)", "GRASP(apple_0)"),
    ],
)
def test_what_people_and_models_write(text: str, canonical: str) -> None:
    assert str(parse_action(text)) == canonical


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no primitive"),
        ("dance(fridge_0)", "no primitive"),
        ("NAVIGATE_TOO(fridge_0)", "did you mean NAVIGATE_TO?"),
        ("GRASP()", "names no target"),
        ("grasp", "names no target"),
        ("OPEN(' ')", "names no target"),
    ],
)
def test_malformed_actions_say_what_is_wrong(text: str, said: str) -> None:
    with pytest.raises(MalformedAction) as error:
        parse_action(text)
    assert said in str(error.value)


@given(st.text(alphabet=string.printable, max_size=80))
@settings(max_examples=500, deadline=None)
def test_any_text_is_an_action_or_a_typed_error(text: str) -> None:
    try:
        action = parse_action(text)
    except MalformedAction:
        return
    assert (action.target is None) == (action.primitive is Primitive.RELEASE)


def test_primitive_values_index_the_action_space() -> None:
    assert [int(p) for p in Primitive] == list(range(9))
