"""The environments from outside: spaces, episodes, rewards, bad input."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import msgspec
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from houses import FILE, INSTRUCTIONS, by_reference, make, send, start

from gavel_env.actions import Primitive, parse_action
from gavel_env.codec import BadAction
from gavel_env.config import RobotConfig
from gavel_env.dynamics import Violation, ViolationKind
from gavel_env.env import BadEnvironmentOption, GavelEnv
from gavel_env.errors import GavelError, InstructionError, UnknownInstruction, UnknownScene
from gavel_env.graph import Flag
from gavel_env.observation import (
    AFFORDANCES,
    MAX_CATEGORIES,
    NO_ROOM,
    NODE_COLUMNS,
    OUTCOMES,
    ROOM_TYPES,
    EdgeType,
    NodeKind,
    TooManyNodes,
)
from gavel_env.observed import EnvAction
from gavel_env.ontology import default_ontology
from gavel_env.rewards import RewardWeights
from gavel_env.scenes import load_scene, scene_names

COLUMN = {name: i for i, name in enumerate(NODE_COLUMNS)}
GO, GRASP, PUT, INSERT = Primitive.NAVIGATE_TO, Primitive.GRASP, Primitive.PLACE_ON_TOP, Primitive.PLACE_INSIDE


def steps(env: gym.Env[Any, Any], *plan: str) -> tuple[Any, float, bool, bool, dict[str, Any]]:
    last: Any = None
    for text in plan:
        last = env.step(EnvAction.of(parse_action(text)))
    return last


# --- Gymnasium's contract ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "kwargs",
    [
        {},
        {"observation": "symbolic"},
        {"on_violation": "noop"},
        {"terminate_on_success": False},
        {"profile": "omnigibson"},
        {"render_mode": "rgb_array"},
        {"render_mode": "ansi"},
    ],
    ids=str,
)
def test_check_env_has_nothing_to_say(kwargs: dict[str, Any]) -> None:
    check_env(make(**kwargs).unwrapped)


@pytest.mark.parametrize("name", ["Gavel-SingleTask-v0", "Gavel-MultiTask-v0"])
def test_shipped_instructions_are_the_default(name: str) -> None:
    env = gym.make(name)
    observation, info = env.reset(seed=4)
    assert observation in env.observation_space
    assert info["instruction_id"] in env.unwrapped.instruction_ids
    assert info["scene"] in scene_names()


def test_every_observation_and_action_of_an_episode_is_in_its_space() -> None:
    for name, instruction in INSTRUCTIONS.items():
        env = start(name)
        for action in instruction.reference_plan():
            encoded = env.unwrapped.encode(send(env, action))
            assert encoded in env.action_space
            observation, *_, info = env.step(encoded)
            assert observation in env.observation_space
            assert info["outcome"] == "ok"


@pytest.mark.parametrize(("mode", "options"), [("sync", {}), ("async", {"shared_memory": False})])
def test_vector_environments(mode: str, options: dict[str, Any]) -> None:
    envs = gym.make_vec(
        "Gavel-SingleTask-v0",
        num_envs=2,
        vectorization_mode=mode,
        vector_kwargs=options,
        instructions=str(FILE),
        on_violation="noop",
    )
    observation, _ = envs.reset(seed=5)
    envs.action_space.seed(1)
    assert len(observation["graph"]) == 2
    for _ in range(5):
        observation, rewards, _, _, info = envs.step(envs.action_space.sample())
        assert observation["metres"].shape == (2, 1)
        assert rewards.shape == (2,)
    assert set(info["outcome"]) <= set(OUTCOMES)
    envs.close()


def test_long_episodes_are_truncated() -> None:
    env = start("rs_apple_to_table", on_violation="noop")
    for _ in range(199):
        assert not env.step(EnvAction(Primitive.RELEASE))[3]
    assert env.step(EnvAction(Primitive.RELEASE))[3]


def test_class_docstring_has_gymnasiums_headings() -> None:
    text = GavelEnv.__doc__ or ""
    for heading in (
        "Action Space",
        "Observation Space",
        "Starting State",
        "Rewards",
        "Episode End",
        "Information",
        "Arguments",
        "Version History",
    ):
        assert f"## {heading}" in text


# --- episodes ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", INSTRUCTIONS)
def test_reference_plans_succeed(name: str) -> None:
    env = start(name, terminate_on_success=False)
    plan = INSTRUCTIONS[name].reference_plan()
    for action in plan:
        *_, terminated, _, info = env.step(send(env, action))
        assert (info["outcome"], terminated) == ("ok", False), str(action)
        assert "success" not in info
    assert env.unwrapped.judge().success


def test_success_ends_the_episode_only_when_all_is_safe() -> None:
    env = start("rs_milk_into_fridge")
    *_, terminated, _, info = steps(
        env,
        "NAVIGATE_TO(fridge)",
        "OPEN(fridge)",
        "NAVIGATE_TO(carton)",
        "GRASP(carton)",
        "NAVIGATE_TO(fridge)",
        "PLACE_INSIDE(fridge)",
    )
    assert (terminated, info["success"]) == (False, False)
    judgement = env.unwrapped.judge()
    assert judgement.unmet == ()
    assert judgement.unsafe == ("open(fridge_0)",)
    _, reward, terminated, _, info = steps(env, "CLOSE(fridge)")
    assert (reward, terminated, info["success"]) == (1.0, True, True)
    assert env.unwrapped.judge().success


def test_refused_action_ends_the_episode_and_says_why() -> None:
    env = start("rs_apple_to_table")
    _, reward, terminated, truncated, info = steps(env, "GRASP(coffee_table)")
    assert terminated
    assert not truncated
    assert reward == -0.1
    assert info["outcome"] == "not_near"
    assert info["violation"] == Violation(ViolationKind.NOT_NEAR, "coffee_table_0")
    assert info["success"] is False
    assert env.unwrapped.judge().violation == info["violation"]


def test_refused_action_is_a_noop_if_so_wanted() -> None:
    env = start("rs_apple_to_table", on_violation="noop")
    before = env.unwrapped.observed.graph
    observation, reward, terminated, _, info = steps(env, "GRASP(coffee_table)")
    assert (reward, terminated, info["outcome"]) == (-0.1, False, "not_near")
    assert OUTCOMES[observation["outcome"]] == "not_near"
    assert env.unwrapped.observed.graph == before
    *_, terminated, _, info = by_reference(env, INSTRUCTIONS["rs_apple_to_table"])
    assert terminated
    assert info["success"]


def test_unobserved_ids_are_unknown_whether_they_exist_or_not() -> None:
    env = start("benevolence_cook_apple", on_violation="noop")
    assert "apple_0" in env.unwrapped.privileged_state().graph.world.nodes
    existing = steps(env, "GRASP(apple_0)")[-1]
    absent = steps(env, "GRASP(apple_77)")[-1]
    assert existing["outcome"] == absent["outcome"] == "unknown_object"
    going = steps(env, "NAVIGATE_TO(apple_0)")[-1]
    assert (going["outcome"], going["step_metres"]) == ("unknown_object", 0.0)


def test_opening_a_container_shows_what_is_in_it() -> None:
    env = start("benevolence_cook_apple")
    steps(env, "NAVIGATE_TO(fridge)")
    assert "apple_0" not in env.unwrapped.observed.graph.world.nodes
    info = steps(env, "OPEN(fridge)")[-1]
    assert info["seen"] == ("apple_0",)
    assert env.unwrapped.observed.positions["apple_0"] == env.unwrapped.observed.positions["fridge_0"]


def test_reveal_makes_every_object_observed_and_changes_nothing_else() -> None:
    env = start("benevolence_cook_apple", terminate_on_success=False)
    before = env.unwrapped.privileged_state().graph
    revealed = env.unwrapped.reveal()
    assert revealed.graph == before
    assert revealed.instruction == INSTRUCTIONS["benevolence_cook_apple"]
    assert set(env.unwrapped.observed.graph.world.nodes) == set(before.world.nodes)
    for action in INSTRUCTIONS["benevolence_cook_apple"].reference_plan():
        observation, *_, info = env.step(EnvAction.of(action))
        assert info["outcome"] == "ok"
    assert len(observation["graph"].nodes) == 1 + len(before.world.rooms) + len(before.world.nodes)
    assert env.unwrapped.judge().success


def test_search_that_finds_nothing_is_refused_and_costs_metres() -> None:
    env = start("benevolence_cook_apple")
    *_, terminated, _, info = steps(env, "NAVIGATE_TO(washer)")
    assert terminated
    assert info["outcome"] == "not_found"
    assert info["step_metres"] > 0
    assert info["observed"].searched == frozenset(env.unwrapped.observed.graph.world.rooms)


def test_omnigibson_profile_wants_an_empty_hand_at_doors() -> None:
    plan = ("NAVIGATE_TO(carton)", "GRASP(carton)", "NAVIGATE_TO(fridge)", "OPEN(fridge)")
    assert steps(start("rs_milk_into_fridge"), *plan)[-1]["outcome"] == "ok"
    assert steps(start("rs_milk_into_fridge", profile="omnigibson"), *plan)[-1]["outcome"] == "hand_full"


def test_rewards_are_the_documented_sum() -> None:
    weights = {"success": 5.0, "metre": 0.5, "violation": 2.0}
    env = start("rs_apple_to_table", reward=weights)
    total, metres = 0.0, 0.0
    for text in ("NAVIGATE_TO(apple)", "GRASP(apple)", "NAVIGATE_TO(coffee_table)", "PLACE_ON_TOP(coffee_table)"):
        _, reward, terminated, _, info = steps(env, text)
        assert reward == pytest.approx(5.0 * terminated - 0.5 * info["step_metres"])
        total += reward
        metres += info["step_metres"]
    assert terminated
    assert total == pytest.approx(5.0 - 0.5 * metres)
    assert info["metres"] == pytest.approx(metres)
    assert steps(start("rs_apple_to_table", reward=weights), "GRASP(bed)")[1] == -2.0
    assert make(reward=RewardWeights(violation=3.0)).unwrapped.reward == RewardWeights(1.0, 0.01, 3.0)


def test_without_termination_on_success_nothing_tells_the_agent() -> None:
    env = start("rs_apple_to_table", terminate_on_success=False)
    _, reward, terminated, _, info = by_reference(env, INSTRUCTIONS["rs_apple_to_table"])
    assert (reward, terminated) == (0.0, False)
    assert "success" not in info
    assert env.unwrapped.judge().success
    steps(env, "GRASP(apple)")
    assert env.unwrapped.judge().unmet == ("on_top(apple, coffee_table)",)


# --- names, designators, search ------------------------------------------------------------------------------------


def test_other_than_goes_to_another_instance() -> None:
    env = start("rs_two_apples")
    first = steps(env, "NAVIGATE_TO(apple)")[-1]["observed"].reached
    again = steps(env, "NAVIGATE_TO(apple)")[-1]["observed"].reached
    other = env.step(EnvAction(GO, "apple", other_than=(first,)))[-1]["observed"].reached
    assert first == again
    assert {first, other} == {"apple_0", "apple_1"}


def test_designators_with_a_room_mean_instances_there() -> None:
    env = start("rs_steak_on_floor")
    assert steps(env, "NAVIGATE_TO(countertop@kitchen)")[-1]["observed"].reached == "countertop_0"
    assert steps(env, "NAVIGATE_TO(countertop@living_room_0)")[-1]["observed"].reached == "countertop_1"
    assert steps(env, "NAVIGATE_TO(countertop@bathroom)")[-1]["outcome"] == "not_found"


@pytest.mark.parametrize(
    "target", ["countertop@kitchen", "countertop@living_room", "countertop@bathroom", "countertop", "countertop_1"]
)
def test_the_dict_form_does_what_the_names_do(target: str) -> None:
    named, encoded = start("rs_steak_on_floor"), start("rs_steak_on_floor")
    action = EnvAction(GO, target, {"kitchen_0": 3.0, "bedroom_0": 1.0})
    first = named.step(action)[-1]
    second = encoded.step(encoded.unwrapped.encode(action))[-1]
    assert first["route"] == second["route"]
    assert first["observed"].reached == second["observed"].reached
    assert first["outcome"] == second["outcome"]


def test_rooms_of_negative_weight_are_not_meant() -> None:
    env = start("rs_steak_on_floor")
    rooms = list(env.unwrapped.observed.graph.world.rooms)
    action = env.unwrapped.encode(EnvAction(GO, "countertop"))
    for excluded, reached in (("kitchen_0", "countertop_1"), ("living_room_0", "countertop_0")):
        action["search_prior"] = np.array([-1.0 * (room == excluded) for room in rooms] + [0.0] * (64 - len(rooms)))
        assert env.step(action)[-1]["observed"].reached == reached
        assert env.unwrapped.decode(action).target == "countertop"


def test_encode_and_decode_are_inverse() -> None:
    env = start("rs_steak_on_floor").unwrapped
    rooms = list(env.observed.graph.world.rooms)
    for action in (
        EnvAction(Primitive.RELEASE),
        EnvAction(GO, "sofa_0"),
        EnvAction(GRASP, "apple"),
        EnvAction(GO, "kitchen_0"),
        EnvAction(GO, "apple", {rooms[0]: 0.25, rooms[2]: 1.0}),
    ):
        assert env.decode(env.encode(action)) == action
    assert env.encode(EnvAction(GO, "apple"), {rooms[1]: 0.5})["search_prior"].tolist()[:2] == [0.0, 0.5]


@pytest.mark.parametrize(("where", "elsewhere"), [("bathroom_0", "kitchen_0"), ("kitchen_0", "bathroom_0")])
def test_heavier_rooms_are_searched_first(where: str, elsewhere: str) -> None:
    placements = [{"category": "apple", "relation": "floor", "target": where}]
    task = {"text": "Bring it.", "goal": ["on_top(apple, sofa)"], "reference_plan": ["NAVIGATE_TO(apple_0)"]}
    record = {"id": "x", "scene": "Rs_int", "text": "Bring it.", "placements": placements, "tasks": [task]}
    metres = {}
    for likely, unlikely in ((where, elsewhere), (elsewhere, where)):
        env = make()
        env.reset(seed=0, options={"instruction": record})
        assert not {where, elsewhere} & env.unwrapped.observed.searched
        info = env.step(EnvAction(GO, "apple", {likely: 1.0, unlikely: 0.5}))[-1]
        assert info["outcome"] == "ok"
        metres[likely] = info["step_metres"]
    assert metres[where] < metres[elsewhere]


def test_categories_stand_for_something_near_in_other_primitives() -> None:
    env = start("rs_two_apples")
    reached = steps(env, "NAVIGATE_TO(apple)")[-1]["observed"].reached
    assert steps(env, "GRASP(apple)")[-1]["action"] == f"GRASP({reached})"


# --- the observation says what the graph says ----------------------------------------------------------------------


def relations(env: gym.Env[Any, Any], observation: dict[str, Any]) -> set[tuple[str, str, str]]:
    graph = observation["graph"]

    def name(node: int) -> str:
        return env.unwrapped.node_name(int(node)) or "robot"

    return {
        (EdgeType(kind).name.lower(), name(a), name(b))
        for kind, (a, b) in zip(graph.edges, graph.edge_links, strict=True)
    }


@pytest.mark.parametrize("name", INSTRUCTIONS)
def test_graph_observation_agrees_with_the_observed_graph(name: str) -> None:
    env = make()
    observation, info = env.reset(seed=1, options={"instruction": name})
    plan = INSTRUCTIONS[name].reference_plan()
    seen: list[str] = []
    for action in (None, *plan):
        if action is not None:
            observation, *_, info = env.step(send(env, action))
        graph = info["observed"].graph
        nodes = observation["graph"].nodes
        first = 1 + len(graph.world.rooms)
        names = list(graph.world.nodes)
        assert names[: len(seen)] == seen, "a node keeps its index"
        seen = names
        assert relations(env, observation) == set(graph.edges())
        assert nodes.shape == (first + len(names), len(NODE_COLUMNS))
        for row, obj in zip(nodes[first:], names, strict=True):
            node = graph.world.nodes[obj]
            assert row[COLUMN["kind"]] == NodeKind.OBJECT
            assert default_ontology().index[node.category.name] == row[COLUMN["type"]]
            assert tuple(row[[COLUMN["x_m"], COLUMN["y_m"]]]) == pytest.approx(info["observed"].positions[obj])
            room = graph.room_of(obj)
            assert row[COLUMN["room"]] == (-1 if room is None else 1 + list(graph.world.rooms).index(room))
            assert (row[COLUMN["near"]], row[COLUMN["held"]]) == (obj in graph.near, obj == graph.holding)
            assert row[COLUMN["fixed"]] == node.fixed
            for flag in Flag:
                assert row[COLUMN[flag.name.lower()]] == graph.has(flag, obj)
            for affordance in AFFORDANCES:
                assert row[COLUMN[affordance]] == getattr(node.category, affordance)
        for row, room_id in zip(nodes[1:first], graph.world.rooms, strict=True):
            assert row[COLUMN["kind"]] == NodeKind.ROOM
            assert ROOM_TYPES[int(row[COLUMN["type"]])] == graph.world.rooms[room_id].type
            assert row[COLUMN["searched"]] == (room_id in info["observed"].searched)


def test_small_observation_says_the_rest() -> None:
    env = start("rs_apple_to_table", observation="symbolic")
    observation, *_, info = steps(env, "NAVIGATE_TO(apple)", "GRASP(apple)")
    observed = info["observed"]
    assert "graph" not in observation
    assert env.unwrapped.node_name(observation["holding"]) == "apple_0"
    assert observation["instruction"] == INSTRUCTIONS["rs_apple_to_table"].text
    assert observation["metres"] == pytest.approx([observed.metres])
    assert tuple(observation["pose"][:2]) == pytest.approx(observed.layout.point(observed.cell))
    rooms = list(observed.graph.world.rooms)
    assert rooms[observation["room"]] == observed.graph.robot_room
    assert {rooms[i] for i in np.flatnonzero(observation["searched"])} == observed.searched
    assert NO_ROOM not in range(len(rooms))


def test_all_shipped_scenes_fit_the_vocabulary() -> None:
    for name in scene_names():
        assert {room.type for room in load_scene(name).rooms} <= set(ROOM_TYPES)
    assert len(default_ontology()) <= MAX_CATEGORIES


# --- bad input -----------------------------------------------------------------------------------------------------

APPLE = {"category": "apple", "relation": "on", "target": "bed_0"}
RECORD = msgspec.to_builtins(INSTRUCTIONS["rs_apple_to_table"])


@pytest.mark.parametrize(
    ("change", "error", "said"),
    [
        ({"scene": "Rs_in"}, UnknownScene, "Rs_int"),
        ({"tasks": []}, InstructionError, "no tasks"),
        ({"tasks": "none"}, InstructionError, "malformed"),
        ({"placements": [{**APPLE, "category": "aple"}]}, InstructionError, "apple"),
        ({"placements": [{**APPLE, "relation": "in"}]}, InstructionError, "no interior"),
        ({"placements": [{**APPLE, "target": "moon"}]}, InstructionError, "moon"),
        ({"placements": [{**APPLE, "target": "coffee_table_0"}]}, InstructionError, "holds at the start"),
        ({"text": "a" * 5000}, InstructionError, "characters"),
        ({"text": "把苹果拿来"}, InstructionError, "character"),
    ],
    ids=lambda value: str(value)[:40],
)  # fmt: skip
def test_malformed_records_are_typed_errors(change: dict[str, Any], error: type[GavelError], said: str) -> None:
    with pytest.raises(error) as raised:
        make().reset(options={"instruction": RECORD | change})
    assert said in str(raised.value)


def test_an_environment_goes_on_after_a_bad_record() -> None:
    env = make()
    with pytest.raises(InstructionError):
        env.reset(options={"instruction": RECORD | {"tasks": []}})
    with pytest.raises(BadEnvironmentOption, match="call reset"):
        env.unwrapped.step(EnvAction(Primitive.RELEASE))
    assert env.reset(seed=1)[1]["instruction_id"] in INSTRUCTIONS


def test_records_are_taken_in_every_form() -> None:
    for form in ("rs_apple_to_table", RECORD, INSTRUCTIONS["rs_apple_to_table"]):
        assert make().reset(options={"instruction": form})[1]["instruction_id"] == "rs_apple_to_table"
    assert make(instructions=[RECORD]).unwrapped.instruction_ids == ("rs_apple_to_table",)
    assert make(instructions=FILE).unwrapped.instruction_ids == tuple(INSTRUCTIONS)


def test_unknown_ids_name_the_nearest() -> None:
    with pytest.raises(UnknownInstruction, match="rs_apple_to_table"):
        make().reset(options={"instruction": "rs_aple_to_table"})
    with pytest.raises(UnknownInstruction, match="singel"):
        gym.make("Gavel-SingleTask-v0", instructions="singel")
    with pytest.raises(InstructionError, match="cannot be read"):
        make(instructions="nowhere.jsonl")


@pytest.mark.parametrize(
    ("kwargs", "said"),
    [
        ({"on_violation": "ignore"}, "'terminate'"),
        ({"observation": "pixels"}, "'symbolic'"),
        ({"profile": "strict"}, "'omnigibson'"),
        ({"robot": {"radius": 0.3}}, "robot_radius_m"),
        ({"robot": {"reach_m": "far"}}, "reach_m"),
        ({"reward": {"sucess": 1.0}}, "success"),
    ],
    ids=str,
)
def test_bad_arguments_name_the_alternatives(kwargs: dict[str, Any], said: str) -> None:
    with pytest.raises(BadEnvironmentOption) as raised:
        GavelEnv(FILE, **kwargs)
    assert said in str(raised.value)


def test_scenes_select_instructions() -> None:
    kept = make(scenes=["Benevolence_1_int"]).unwrapped.instruction_ids
    assert kept == ("benevolence_cook_apple",)
    with pytest.raises(InstructionError, match="Benevolence_1_int"):
        make(scenes=["Merom_1_int"])


def test_robot_fields_reach_the_map() -> None:
    env = start("rs_apple_to_table", robot={"cell_m": 0.2, "reach_m": 1.0})
    assert env.unwrapped.observed.layout.robot == RobotConfig(cell_m=0.2, reach_m=1.0)


def test_scenes_larger_than_the_spaces_are_refused_at_reset() -> None:
    with pytest.raises(TooManyNodes, match="max_nodes=20"):
        make(max_nodes=20).reset(seed=0)


def test_steps_outside_an_episode_are_refused() -> None:
    env = make().unwrapped
    with pytest.raises(BadEnvironmentOption, match="call reset"):
        env.step(EnvAction(Primitive.RELEASE))
    env.reset(seed=0)
    assert env.step(EnvAction(Primitive.RELEASE))[2]
    with pytest.raises(BadEnvironmentOption, match="over"):
        env.step(EnvAction(Primitive.RELEASE))
    with pytest.raises(BadEnvironmentOption, match="no option 'scene'"):
        env.reset(options={"scene": "Rs_int"})


@pytest.mark.parametrize(
    "action",
    [
        None,
        3,
        "OPEN(fridge)",
        {},
        {"primitive": 9, "target": 0, "search_prior": np.zeros(64)},
        {"primitive": 0, "target": 10**6, "search_prior": np.zeros(64)},
        {"primitive": 0, "target": 0, "search_prior": np.zeros(3)},
        {"primitive": 0, "target": "fridge", "search_prior": np.zeros(64)},
    ],
    ids=str,
)
def test_actions_of_another_form_are_refused(action: Any) -> None:
    env = start("rs_apple_to_table").unwrapped
    with pytest.raises(BadAction):
        env.step(action)
    assert env.step(EnvAction(GO, "apple"))[-1]["outcome"] == "ok"


@pytest.mark.parametrize(
    ("action", "said"),
    [
        (EnvAction(GO, "frige"), "fridge"),
        (EnvAction(GO, "apple", {"kitchen": 1.0}), "kitchen_0"),
        (EnvAction(GO, "apple", {"kitchen_0": -1.0}), "weights >= 0"),
        (EnvAction(GO, "apple", {"kitchen_0": float("nan")}), "weights >= 0"),
        (EnvAction(GO, "apple", other_than=("apple_0",)), "other_than"),
    ],
    ids=str,
)
def test_what_the_action_space_cannot_say(action: EnvAction, said: str) -> None:
    with pytest.raises(BadAction) as raised:
        start("rs_apple_to_table").unwrapped.encode(action)
    assert said in str(raised.value)


def test_unknown_names_are_a_violation_not_an_error() -> None:
    assert steps(start("rs_apple_to_table"), "NAVIGATE_TO(frige)")[-1]["outcome"] == "unknown_object"
    assert steps(start("rs_apple_to_table"), "NAVIGATE_TO(@)")[-1]["outcome"] == "unknown_object"
    assert steps(start("rs_apple_to_table"), "NAVIGATE_TO(kitchen_0)")[-1]["outcome"] == "room_target"


# --- pictures ------------------------------------------------------------------------------------------------------


def test_pictures_show_the_episode_move_on() -> None:
    env = start("rs_apple_to_table", render_mode="rgb_array")
    first = env.render()
    steps(env, "NAVIGATE_TO(apple)")
    second = env.render()
    assert first.dtype == second.dtype == np.uint8
    assert first.shape == second.shape
    assert (first != second).any()


def test_ansi_says_what_is_known_and_nothing_else() -> None:
    env = start("benevolence_cook_apple", render_mode="ansi")
    steps(env, "NAVIGATE_TO(fridge)")
    assert "apple_0" not in env.render()
    steps(env, "OPEN(fridge)")
    assert "fridge_0 (open, near)" in env.render()
    assert "inside: apple_0 (near)" in env.render()


def test_no_picture_without_a_render_mode() -> None:
    assert start("rs_apple_to_table").unwrapped.render() is None
