"""BEHAVIOR activities: definitions, grounding, texts, reference plans, and the environment that runs them."""

from __future__ import annotations

import contextlib
import io
from collections import Counter
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import msgspec
import pytest
from support.houses import unwrapped

import gavel_agents
import gavel_env  # noqa: F401  # registers the environments
from eval.cli import main
from gavel_agents.oracle import OracleAgent
from gavel_env.activities import Ungroundable, UnknownActivity, ground, load_activities, title_of
from gavel_env.activities.bddl import synset_of
from gavel_env.activities.english import imperative, plural
from gavel_env.activities.grounding import reachable_in
from gavel_env.activities.scope import GROUND
from gavel_env.errors import DataError
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.record import Instruction, TaskSpec, parse_instruction, read_instructions, shipped
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import rollout, unsafe
from gavel_env.world_model.goals import unmet
from gavel_env.world_model.graph import Flag, Relation, SceneGraph
from gavel_env.world_model.ontology import default_ontology

ACTIVITIES = load_activities()
SHIPPED = read_instructions(shipped("behavior"))
RECORDS = list(SHIPPED.values())
SAMPLE = RECORDS[::40]
SCENES = ("Beechwood_0_int", "Rs_garden", "restaurant_diner")


def start_of(record: Instruction) -> SceneGraph:
    return instruction_graph(load_scene(record.scene), record)


# --- definitions ---------------------------------------------------------------------------------------------------


def test_all_activities_are_there_and_grouped_by_what_their_goals_need() -> None:
    assert Counter(a.group for a in ACTIVITIES.activities) == {"core": 279, "extended": 305, "other": 432}
    for activity in ACTIVITIES.activities:
        assert activity.expressible == (activity.group != "other") == bool(activity.bddl)


def test_unknown_and_inexpressible_activities_say_so() -> None:
    with pytest.raises(UnknownActivity, match="putting_away_toys"):
        ACTIVITIES["putting_away_toy"]
    other = next(a for a in ACTIVITIES.activities if a.needs == ("real",))
    with pytest.raises(DataError, match="needs real"):
        ground(other, "Rs_int")


def test_what_a_scene_lacks_is_named() -> None:
    with pytest.raises(Ungroundable, match="Rs_int has no grocery_store"):
        ground("buy_dog_food", "Rs_int")
    with pytest.raises(Ungroundable, match=r"no cabinet\.n\.01 left"):
        ground("setting_mousetraps", "Rs_int")


# --- grounding -----------------------------------------------------------------------------------------------------


def groundings() -> Iterator[Any]:
    for activity in ACTIVITIES.activities[::7]:
        for scene in SCENES:
            if activity.expressible:
                with contextlib.suppress(Ungroundable):
                    yield ground(activity, scene)


def test_the_initial_state_is_placed_as_the_definition_says() -> None:
    """Every fact of the definition that graphs have is looked up in the graph."""
    seen: Counter[str] = Counter()
    for grounding in groundings():
        task = TaskSpec("", (), (), (grounding.goal,))
        record = Instruction("x", grounding.scene, "", grounding.placements, (task,), "behavior", grounding.initial)
        record = msgspec.structs.replace(record, tasks=(TaskSpec("", ("washed(plate)",), ()),))
        graph = start_of(record)
        problem, scope = grounding.activity.problem(), grounding.scope
        covering = {fact.args[1] for fact in problem.init if fact.predicate == "covered"}
        for fact in problem.init:
            name, *others = fact.args
            if fact.negated or name not in scope or synset_of(name) in GROUND:
                continue
            obj = scope[name]
            if fact.predicate == "inroom":
                room = graph.room_of(obj)
                assert room is not None, fact
                assert graph.world.rooms[room].type == others[0], fact
            elif fact.predicate in ("ontop", "inside") and synset_of(others[0]) in GROUND:
                assert graph.supports[obj] == (Relation.FLOOR, scope[others[0]]), fact
            elif fact.predicate in ("ontop", "inside"):
                relation = Relation.ON_TOP if fact.predicate == "ontop" else Relation.INSIDE
                assert graph.supports[obj] == (relation, scope[others[0]]), fact
            elif fact.predicate in ("open", "cooked", "frozen", "hot", "toggled_on"):
                assert graph.has(Flag[fact.predicate.upper().removesuffix("_ON")], obj), fact
            elif fact.predicate == "covered" and not _wanted_off(problem.goal) - covering:
                assert graph.has(Flag.DIRTY, obj) or synset_of(others[0]) not in _wanted_off(problem.goal), fact
            seen[fact.predicate] += 1
    assert min(seen[p] for p in ("inroom", "ontop", "inside", "covered")) >= 30


def _wanted_off(node: Any) -> set[str]:
    found = {synset_of(node.args[1])} if node.head == "covered" else set()
    return found.union(*(_wanted_off(part) for part in node.parts))


def test_every_object_of_the_activity_gets_one_of_its_own_of_its_kind() -> None:
    ontology = default_ontology()
    for grounding in groundings():
        things = {n: o for n, o in grounding.scope.items() if synset_of(n) not in GROUND}
        assert len(set(things.values())) == len(things), grounding.activity.name
        scene = load_scene(grounding.scene)
        categories = {f.id: f.category for f in scene.furniture} | {i.id: i.category for i in scene.items}
        categories |= {p.id: p.category for p in grounding.placements}
        for name, obj in things.items():
            synset = synset_of(name.partition("_more")[0])
            assert categories[obj] in ACTIVITIES.kinds[synset], name
            assert categories[obj] in ontology


def test_pieces_that_the_robot_cannot_get_at_are_not_chosen() -> None:
    for grounding in groundings():
        reachable = reachable_in(load_scene(grounding.scene))
        added = {p.id for p in grounding.placements}
        pieces = [o for n, o in grounding.scope.items() if synset_of(n) not in GROUND and o not in added]
        assert all(map(reachable, pieces)), grounding.activity.name


# --- what is shipped -----------------------------------------------------------------------------------------------


def test_enough_is_certified_and_nothing_is_rejected() -> None:
    assert SHIPPED.rejected == ()
    groups = Counter(record.meta["group"] for record in RECORDS)
    assert groups["core"] >= 260
    assert groups["core"] + groups["extended"] >= 450


def test_every_reference_plan_meets_the_goal_that_does_not_hold_at_the_start() -> None:
    for record in RECORDS:
        start, goal = start_of(record), record.goal()
        assert unmet(goal, start), record.id
        end, violation = rollout(start, record.reference_plan())
        assert violation is None, (record.id, violation)
        assert unmet(goal, end) == (), record.id
        assert unsafe(start, end, goal) == (), record.id


def test_the_last_step_of_a_plan_is_needed() -> None:
    """Without it the goal is missed, something is left open or on, or the hand is not empty."""
    for record in RECORDS:
        start, goal, plan = start_of(record), record.goal(), record.reference_plan()
        end, _ = rollout(start, plan[:-1])
        assert unmet(goal, end) or unsafe(start, end, goal) or end.holding, record.id


def test_what_starts_behind_a_door_is_said() -> None:
    said = 0
    for record in RECORDS:
        graph = start_of(record)
        for placement in record.placements:
            container = graph.closed_container(placement.id or "")
            if container is not None:
                said += 1
                assert "At the start" in record.text, record.id
                assert "which is shut" in record.text, record.id
    assert said > 100


def test_texts_begin_with_the_title_and_none_is_given_twice() -> None:
    assert len({record.text for record in RECORDS}) == len(RECORDS)
    for record in RECORDS:
        assert record.text.startswith(title_of(str(record.meta["activity"])) + ". In the end, "), record.id
        assert record.text.endswith("."), record.id


@pytest.mark.parametrize(
    ("activity", "title"),
    [
        ("putting_away_Halloween_decorations", "Put away Halloween decorations"),
        ("clean_a_LED_screen", "Clean an LED screen"),
        ("de_clutter_your_garage", "De-clutter your garage"),
        ("re_shelving_library_books", "Re-shelve library books"),
        ("storing_food", "Store food"),
        ("heating_food_up", "Heat food up"),
        ("boxing_books_up_for_storage", "Box books up for storage"),
        ("spring_clean_your_skateboard", "Spring clean your skateboard"),
    ],
)
def test_titles_are_commands(activity: str, title: str) -> None:
    assert title_of(activity) == title


def test_words_change_as_english_wants() -> None:
    assert [imperative(w) for w in ("mopping", "taking", "loading", "bag")] == ["mop", "take", "load", "bag"]
    assert [plural(w) for w in ("box of candy", "table knife", "berry", "tray", "dish", "jeans")] == [
        "boxes of candy",
        "table knives",
        "berries",
        "trays",
        "dishes",
        "jeans",
    ]


def test_a_record_with_conditions_is_read_back_from_its_json() -> None:
    record = next(r for r in RECORDS if r.tasks[0].conditions)
    assert parse_instruction(msgspec.json.encode(record), "here") == record


# --- nearness, dirt and weight -------------------------------------------------------------------------------------


def test_next_to_is_reached_by_letting_go_beside_a_thing() -> None:
    record = SHIPPED["behavior-bringing_in_kindling"]
    assert record.reference_plan()[-1] == Action(Primitive.RELEASE)
    start = start_of(record)
    end, _ = rollout(start, record.reference_plan())
    (fireplace,) = end.world.by_category["wood_fireplace"]
    logs = end.world.by_category["firewood"]
    assert all(end.beside(log, fireplace) for log in logs)
    assert not any(start.beside(log, fireplace) for log in logs)


def test_something_dirty_is_clean_after_the_plan_and_not_before() -> None:
    cleaned = 0
    for record in RECORDS:
        start = start_of(record)
        if start.flags[Flag.DIRTY]:
            end, _ = rollout(start, record.reference_plan())
            cleaned += end.flags[Flag.DIRTY] < start.flags[Flag.DIRTY]
    assert cleaned > 150


# --- the environment -----------------------------------------------------------------------------------------------


def success_of(ids: list[str]) -> dict[str, bool]:
    """Return whether the oracle carries each instruction out."""
    env = gym.make("Gavel-Behavior-v0", observation="symbolic", terminate_on_success=False)
    oracle = gavel_agents.make("oracle")
    assert isinstance(oracle, OracleAgent)
    found = {}
    for seed, name in enumerate(ids):
        observation, info = env.reset(seed=seed, options={"instruction": name})
        oracle.reveal(env)
        oracle.reset(observation, info)
        while (action := oracle.act(observation, info)) is not None:
            observation, _, terminated, truncated, info = env.step(action)
            if terminated or truncated:
                break
        found[name] = unwrapped(env).judge().success
    return found


def test_the_environment_resets_steps_and_says_its_text() -> None:
    env = gym.make("Gavel-Behavior-v0", scenes=["Rs_int"])
    observation, info = env.reset(seed=3)
    assert observation["instruction"] == SHIPPED[info["instruction_id"]].text
    assert env.observation_space.contains(observation)
    assert info["scene"] == "Rs_int"
    observation, _, _, truncated, info = env.step(env.action_space.sample())
    assert env.observation_space.contains(observation)
    assert not truncated


def test_the_oracle_carries_out_a_sample() -> None:
    found = success_of([record.id for record in SAMPLE])
    assert [name for name, success in found.items() if not success] == []


@pytest.mark.slow
def test_the_oracle_carries_out_every_shipped_activity() -> None:
    found = success_of(sorted(SHIPPED, key=lambda name: SHIPPED[name].scene))
    assert [name for name, success in found.items() if not success] == []


# --- command line --------------------------------------------------------------------------------------------------


def printed(*arguments: str) -> str:
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert main(["activities", *arguments]) == 0
    return out.getvalue()


def test_the_command_lists_and_shows() -> None:
    assert "279 activities, 279 expressible" in printed("list", "--group", "core")
    definition = printed("show", "setting_the_table")
    assert "(inside cupcake.n.01_1 electric_refrigerator.n.01_1)" in definition
    grounded = printed("show", "setting_the_table", "--scene", "Benevolence_1_int")
    assert "cupcake_0 in fridge_0" in grounded
    assert "(forpairs (?plate_n_04 plate_0 plate_1) (?cupcake_n_01 cupcake_0 cupcake_1)" in grounded
