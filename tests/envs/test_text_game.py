"""The text game: commands, answers, score; and texts that are not actions."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import pytest
from support.houses import INSTRUCTIONS, make, unwrapped

import gavel_env
from gavel_env import TextActions, TextGame
from gavel_env.envs.env import BadEnvironmentOption
from gavel_env.world_model.actions import Action, Primitive, parse_action
from gavel_env.world_model.dynamics import Profile, ViolationKind, first_violation
from gavel_env.world_model.narration import REASONS, command, commands

PLAY = ("find apple", "take apple_0", "find coffee_table", "put on coffee_table_0")


def game(instruction: str = "rs_apple_to_table", **options: Any) -> tuple[TextGame, str, dict[str, Any]]:
    env = TextGame(make(**({"on_violation": "noop"} | options)))
    text, info = env.reset(seed=0, options={"instruction": instruction})
    return env, text, info


def test_a_game_is_won_in_words() -> None:
    env, text, info = game()
    assert INSTRUCTIONS["rs_apple_to_table"].text in text
    assert "You are in" in text
    assert (info["score"], info["won"]) == (0.0, False)
    told = []
    for said in PLAY:
        assert said in info["admissible_commands"] or said == "find coffee_table", (said, info["admissible_commands"])
        text, reward, terminated, _, info = env.step(said)
        told.append(text)
    assert terminated
    assert (info["score"], info["won"], info["commands"]) == (1.0, True, 4)
    assert reward > 0.9
    assert told[1] == "You take apple_0."
    assert told[3] == "You put apple_0 on coffee_table_0. You have done it."


@pytest.mark.parametrize("said", ["look", "Inventory.", "task", "help", "what am I to do", "", "grab"])
def test_talk_changes_nothing_and_is_answered(said: str) -> None:
    env, _, _ = game()
    before = unwrapped(env).observed
    text, reward, terminated, truncated, info = env.step(said)
    assert text
    assert (reward, terminated, truncated, info["outcome"]) == (0.0, False, False, "told")
    assert unwrapped(env).observed is before


def test_chatter_is_answered_by_the_nearest_commands() -> None:
    env, _, info = game()
    target = next(c for c in info["admissible_commands"] if c.startswith("go to"))
    text = env.step(target.replace("go to", "goo too"))[0]
    assert target in text


def test_refusals_say_why() -> None:
    env, _, _ = game("benevolence_cook_apple")
    assert env.step("take apple_0")[0].startswith("Nothing happens: there is no apple_0")
    assert env.step("drop")[0] == "Nothing happens: the hand is empty."
    env.step("find fridge")
    assert "with" not in env.step("look")[0].partition("fridge_0 (closed)")[2][:5]
    assert set(REASONS) == set(ViolationKind)


def test_admissible_commands_are_those_that_the_world_model_accepts() -> None:
    env, _, info = game("benevolence_cook_apple")
    for action in INSTRUCTIONS["benevolence_cook_apple"].reference_plan():
        graph = unwrapped(env).observed.graph
        found = {parse_action(text) for text in info["admissible_commands"] if not text.startswith("find")}
        for obj in graph.world.nodes:
            for primitive in Primitive:
                tried = Action(primitive, obj if primitive.takes_target else None)
                at_it = primitive is Primitive.NAVIGATE_TO and (obj in graph.near or obj == graph.holding)
                if not at_it:
                    assert (tried in found) == (first_violation(graph, tried) is None), tried
        said = command(action) if action.target in graph.world.nodes else f"find {str(action.target).rsplit('_', 1)[0]}"
        if not action.primitive.takes_target:
            said = "drop"
        *_, info = env.step(said)
        assert info["outcome"] == "ok", said
    assert info["won"]


def test_commands_are_read_back() -> None:
    for primitive in Primitive:
        action = Action(primitive, "bottom_cabinet_3" if primitive.takes_target else None)
        assert parse_action(command(action)) == action


def test_a_profile_restricts_commands() -> None:
    env, _, _ = game("benevolence_cook_apple", profile="omnigibson")
    for said in ("find fridge", "open fridge_0", "take apple_0"):
        env.step(said)
    graph = unwrapped(env).observed.graph
    assert graph.holding == "apple_0"
    assert "close fridge_0" in commands(graph)
    assert "close fridge_0" not in commands(graph, Profile.OMNIGIBSON)


def test_games_end_after_the_most_commands() -> None:
    env = TextGame(make(on_violation="noop"), max_commands=2)
    env.reset(seed=0)
    assert [env.step("look")[3] for _ in range(2)] == [False, True]
    with pytest.raises(BadEnvironmentOption, match="max_commands"):
        TextGame(make(), max_commands=0)
    with pytest.raises(TypeError, match="CartPole"):
        TextGame(gym.make("CartPole-v1"))


def test_text_that_is_no_action_is_a_refused_action() -> None:
    env = TextActions(make(on_violation="noop"))
    env.reset(seed=0, options={"instruction": "rs_apple_to_table"})
    before = unwrapped(env).observed.graph
    _, reward, terminated, _, info = env.step("go two the armchair please, would you")
    assert (info["outcome"], terminated) == ("unknown_object", False)
    assert reward == pytest.approx(-0.1)
    assert "no primitive" in info["refusal"]
    assert unwrapped(env).observed.graph is before
    near = env.step("goo to coffee_table_0")[-1]["nearest_commands"]
    assert all(text in commands(before) for text in near)
    assert "refusal" not in env.step("navigate to the apple")[-1]
    strict = TextActions(make())
    strict.reset(seed=0, options={"instruction": "rs_apple_to_table"})
    assert strict.step("hello")[2]


def test_it_is_exported() -> None:
    assert gavel_env.TextGame is TextGame
