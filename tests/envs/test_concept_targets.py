"""Concepts as targets of actions in the environment."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import pytest

import gavel_env
from gavel_env.errors import BadAction, InstructionError
from gavel_env.exchange import EnvAction
from gavel_env.instructions.record import parse_instruction
from gavel_env.world_model.actions import Primitive
from gavel_env.world_model.concepts import default_concepts
from gavel_env.world_model.ontology import category_of

RECORD: dict[str, Any] = {
    "id": "mug",
    "scene": "Merom_1_int",
    "text": "Put the mug on a table.",
    "placements": [{"category": "mug", "relation": "on", "target": "bottom_cabinet"}],
    "tasks": [{"text": "Put the mug on a table.", "goal": ["on_top(mug, any_table)"], "reference_plan": []}],
}


@pytest.fixture
def env() -> gavel_env.GavelEnv:
    made = gym.make("Gavel-SingleTask-v0", instructions=[parse_instruction(RECORD, "test")], on_violation="noop")
    made.reset(seed=0)
    return made.unwrapped  # type: ignore[return-value]


@pytest.mark.parametrize("target", ["any_bed", "any_trash_can", "any_cabinet@kitchen", "any_chair", "any_lamp@bedroom"])
def test_a_search_for_a_concept_ends_at_one_of_its_categories_in_its_room(env: gavel_env.GavelEnv, target: str) -> None:
    info = env.step(EnvAction(Primitive.NAVIGATE_TO, target))[-1]
    name, _, room = target.partition("@")
    assert info["outcome"] == "ok"
    reached = info["observed"].reached
    assert category_of(reached) in default_concepts().categories(name)
    assert not room or info["observed"].graph.room_of(reached).startswith(room)


def test_what_a_search_is_not_for_is_passed_by(env: gavel_env.GavelEnv) -> None:
    bins: list[str] = []
    while (info := env.step(EnvAction(Primitive.NAVIGATE_TO, "any_trash_can", None, tuple(bins)))[-1])[
        "outcome"
    ] == "ok":
        bins.append(info["observed"].reached)
    assert info["outcome"] == "not_found"
    hidden = env.privileged_state().graph.world
    assert sorted(bins) == sorted(hidden.instances("any_trash_can"))


def test_other_primitives_take_a_concept_for_what_is_near(env: gavel_env.GavelEnv) -> None:
    env.step(EnvAction(Primitive.NAVIGATE_TO, "mug"))
    assert env.step(EnvAction(Primitive.GRASP, "any_cup"))[-1]["action"] == "GRASP(mug_0)"
    env.step(EnvAction(Primitive.NAVIGATE_TO, "any_table"))
    _, _, terminated, _, info = env.step(EnvAction(Primitive.PLACE_ON_TOP, "any_table"))
    assert terminated
    assert info["success"]


def test_the_action_space_says_that_it_knows_no_concepts(env: gavel_env.GavelEnv) -> None:
    with pytest.raises(BadAction, match="any_table"):
        env.encode(EnvAction(Primitive.NAVIGATE_TO, "any_table"))
    assert env.step(EnvAction(Primitive.NAVIGATE_TO, "any_zorgle"))[-1]["outcome"] == "unknown_object"


def test_a_goal_over_an_unknown_concept_is_refused_with_the_nearest(env: gavel_env.GavelEnv) -> None:
    record = RECORD | {"tasks": [{"text": "Put it.", "goal": ["on_top(mug, any_tabel)"], "reference_plan": []}]}
    with pytest.raises(InstructionError, match=r"tasks\[0\]: unknown concept 'any_tabel'; did you mean 'any_table'"):
        env.reset(options={"instruction": record})
