"""Certificates: each check passes on a good record and fails on the record that it is there for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from eval.cli import main
from gavel_env.data import shipped_data
from gavel_env.errors import InstructionError
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.record import Instruction, Placement, TaskSpec, read_instructions
from gavel_env.tasks.broken import LEAST, Broken, broken_path, broken_variants, read_broken
from gavel_env.tasks.certificate import CHECKS, certify, certify_set, check_broken
from gavel_env.tasks.driving import drive
from gavel_env.tasks.generator import Knobs, generate
from gavel_env.tasks.judging import judge
from gavel_env.world_model.goals import parse_goal

Change = Callable[[Instruction], Instruction]


@pytest.fixture(scope="module")
def good() -> Instruction:
    """Two errands in a house, one out of the fridge."""
    for record in generate(Knobs(count=30, seed=1, houses=("Ihlen_1_int",), tasks=(2, 2), distractors=0)):
        if any("inside" in r for t in record.meta["targets"] for r in t["relations"]):
            assert certify(record) == ()
            return record
    raise AssertionError("no record with a stated container")


def with_task(record: Instruction, index: int, **changes: Any) -> Instruction:
    tasks = list(record.tasks)
    tasks[index] = msgspec.structs.replace(tasks[index], **changes)
    return msgspec.structs.replace(record, tasks=tuple(tasks))


def failed(record: Instruction) -> set[str]:
    return {problem.check for problem in certify(record)}


def test_a_plan_that_stops_early_fails_alone_and_in_every_order(good: Instruction) -> None:
    record = with_task(good, 0, reference_plan=good.tasks[0].reference_plan[:-1])
    assert {"alone", "orders"} <= failed(record)


def test_a_plan_that_does_not_run_fails_alone(good: Instruction) -> None:
    record = with_task(good, 1, reference_plan=good.tasks[1].reference_plan[1:])
    assert "alone" in failed(record)


def test_a_goal_that_holds_at_the_start_fails(good: Instruction) -> None:
    placement = good.placements[0]
    relation = {"on": "on_top", "in": "inside", "floor": "in_room"}[placement.relation]
    holds = f"{relation}({placement.category}, {placement.target})"
    assert failed(with_task(good, 0, goal=(holds,))) == {"start"}
    lamp = "not toggled(floor_lamp)"  # one of several literals
    assert "start" in failed(with_task(good, 0, goal=(*good.tasks[0].goal, lamp)))
    assert failed(with_task(good, 0, goal=(*good.tasks[0].goal, holds))) == {"placement"}  # in two places at once


def test_a_placement_that_does_not_fit_fails(good: Instruction) -> None:
    nowhere = msgspec.structs.replace(good, placements=(Placement("mug", "on", "throne"), *good.placements))
    assert failed(nowhere) == {"placement"}


def test_two_tasks_about_one_thing_fail(good: Instruction) -> None:
    first = good.placements[0].category
    other = with_task(good, 1, goal=(*good.tasks[1].goal, f"on_top({first}, bed)"))
    assert "independence" in failed(other)


def test_a_furniture_category_in_two_rooms_fails(good: Instruction) -> None:
    record = with_task(
        with_task(good, 0, goal=("on_top(mug, bed@bedroom)",)), 1, goal=("on_top(bowl, bed@living_room)",)
    )
    assert any("several rooms" in p.detail for p in certify(record) if p.check == "independence")


def test_a_second_instance_makes_the_referent_ambiguous(good: Instruction) -> None:
    twin = Placement(good.placements[0].category, "floor", "living_room_0")
    assert "referents" in failed(msgspec.structs.replace(good, placements=(*good.placements, twin)))


def with_targets(record: Instruction, change: Callable[[dict[str, Any]], None]) -> Instruction:
    targets = msgspec.json.decode(msgspec.json.encode(record.meta["targets"]))
    for target in targets:
        change(target)
    return msgspec.structs.replace(record, meta={**record.meta, "targets": targets})


def test_a_hidden_thing_that_the_text_does_not_place_fails(good: Instruction) -> None:
    assert "hidden" in failed(with_targets(good, lambda target: target.update(relations=[])))


def test_a_false_statement_fails(good: Instruction) -> None:
    moved = msgspec.structs.replace(
        good,
        placements=tuple(msgspec.structs.replace(p, relation="floor", target="living_room_0") for p in good.placements),
    )
    assert {"referents", "alone"} & failed(moved)


@pytest.mark.parametrize(
    ("change", "check"),
    [
        (lambda text: text.replace("the ", "teh ", 1).replace("The ", "Teh ", 1), "spelling"),
        (lambda text: text + " Bring a apple too.", "spelling"),
        (lambda text: text + " Also bring the umbrella.", "sentence"),
        (lambda text: text + " All this in the garden.", "sentence"),
        (lambda text: "Do it.", "sentence"),
    ],
)
def test_texts_are_read(good: Instruction, change: Callable[[str], str], check: str) -> None:
    assert check in failed(msgspec.structs.replace(good, text=change(good.text)))


def test_the_executor_finds_what_the_graph_cannot(good: Instruction) -> None:
    """A plan that names an instance in a place that the robot cannot get at runs on the graph alone."""
    graph = instruction_graph(load_scene(good.scene), good)
    assert drive(graph, good).faults == ()
    ghost = with_task(good, 0, reference_plan=("NAVIGATE_TO(ghost_7)", *good.tasks[0].reference_plan))
    assert any("unknown_object" in fault for fault in drive(graph, ghost).faults)


def test_duplicates_within_a_set_are_found(good: Instruction) -> None:
    twin = msgspec.structs.replace(good, id="twin")
    problems = {r.id: p for r, p in certify_set([good, twin], executor=False)}
    assert problems[good.id] == ()
    assert [p.check for p in problems["twin"]] == ["duplicate"]


def test_a_record_of_an_unknown_scene_is_a_problem_and_not_a_crash(good: Instruction) -> None:
    lost = msgspec.structs.replace(good, scene="Atlantis_int")
    results = list(certify_set([lost, good], executor=False))
    assert [problem.check for problem in results[0][1]] == ["placement"]
    assert results[1][1] == ()


def test_orders_are_all_tried() -> None:
    """Two errands that only work in the order written: the second takes what the first has brought into the open."""
    scene = load_scene("Rs_int")
    record = Instruction(
        "order",
        "Rs_int",
        "x",
        (Placement("apple", "in", "fridge_0", "apple_0"), Placement("mug", "in", "fridge_0", "mug_0")),
        (
            TaskSpec(
                "a",
                ("on_top(apple, sofa)", "open(fridge)"),
                (
                    "NAVIGATE_TO(fridge_0)",
                    "OPEN(fridge_0)",
                    "GRASP(apple_0)",
                    "NAVIGATE_TO(sofa_0)",
                    "PLACE_ON_TOP(sofa_0)",
                ),
            ),
            TaskSpec(
                "b",
                ("on_top(mug, sofa)",),
                ("NAVIGATE_TO(mug_0)", "GRASP(mug_0)", "NAVIGATE_TO(sofa_0)", "PLACE_ON_TOP(sofa_0)"),
            ),
        ),
        "multi",
    )
    assert scene.scene == "Rs_int"
    details = [p.detail for p in certify(record, executor=False) if p.check == "orders"]
    assert len(details) == 1
    assert details[0].startswith("order (1,): hidden(mug_0)")


# --- broken variants ------------------------------------------------------------------------------------------------


def test_broken_variants_cover_the_defects_and_end_as_recorded(good: Instruction) -> None:
    graph = instruction_graph(load_scene(good.scene), good)
    for task in good.tasks:
        plan, goal = task.parsed_plan(), task.parsed_goal()
        variants = broken_variants(graph, plan, goal)
        assert len(variants) >= LEAST
        assert len({v.defect for v in variants}) >= 5
        for variant in variants:
            ending = judge(graph, variant.plan(plan), goal)
            assert ending.kind == variant.ending != "valid"
            assert ending.step == variant.at


@pytest.mark.parametrize(
    ("defect", "start", "steps", "ending"),
    [
        ("drop_navigate", 0, (), "not_near"),
        ("drop_open", 1, (), "closed"),
        ("drop_close", 3, (), "left_open"),
        ("navigate_to_room", 0, ("NAVIGATE_TO(kitchen_0)",), "room_target"),
        ("invented_object", 0, ("NAVIGATE_TO(invented_x)",), "unknown_object"),
        ("wrong_relation", 5, ("PLACE_INSIDE(sofa_0)",), "no_interior"),
        ("drop_place", 5, (), "goal_unmet"),
    ],
)
def test_named_defects_end_as_they_must(defect: str, start: int, steps: tuple[str, ...], ending: str) -> None:
    record = Instruction(
        "milk",
        "Rs_int",
        "x",
        (Placement("jug_of_milk", "in", "fridge_0", "jug_of_milk_0"),),
        (
            TaskSpec(
                "x",
                ("on_top(jug_of_milk, sofa)",),
                (
                    "NAVIGATE_TO(fridge_0)",
                    "OPEN(fridge_0)",
                    "GRASP(jug_of_milk_0)",
                    "CLOSE(fridge_0)",
                    "NAVIGATE_TO(sofa_0)",
                    "PLACE_ON_TOP(sofa_0)",
                ),
            ),
        ),
    )
    graph = instruction_graph(load_scene("Rs_int"), record)
    plan = record.reference_plan()
    assert judge(graph, plan, record.goal()).kind == "valid"
    broken = Broken(defect, start, start + 1, steps)
    assert judge(graph, broken.plan(plan), record.goal()).kind == ending
    assert defect in {v.defect for v in broken_variants(graph, plan, record.goal(), most=99)}


def test_wrong_endings_and_missing_variants_are_found(good: Instruction) -> None:
    graph = instruction_graph(load_scene(good.scene), good)
    variants = [broken_variants(graph, t.parsed_plan(), t.parsed_goal()) for t in good.tasks]
    assert check_broken(good, variants) == ()
    wrong = [msgspec.structs.replace(variants[0][0], ending="not_found"), *variants[0][1:]]
    assert [p.check for p in check_broken(good, [wrong, variants[1]])] == ["broken"]
    assert "only 2" in check_broken(good, [variants[0][:2], variants[1]])[0].detail


def test_left_on_is_an_ending_of_its_own() -> None:
    scene = load_scene("Rs_int")
    record = Instruction(
        "on",
        "Rs_int",
        "x",
        (Placement("plate", "on", "sofa_0", "plate_0"),),
        (TaskSpec("x", ("on_top(plate, bed)",), ("NAVIGATE_TO(plate_0)",)),),
    )
    graph = instruction_graph(scene, record)
    stays_on = [f"{v}(dishwasher_0)" for v in ("NAVIGATE_TO", "TOGGLE_ON")]
    task = TaskSpec("x", ("on_top(plate, sofa)",), (*stays_on,))
    assert judge(graph, task.parsed_plan(), parse_goal(("on_top(plate, sofa)",))).kind == "left_on"


# --- command line ---------------------------------------------------------------------------------------------------


def write(path: Path, *records: Instruction) -> Path:
    path.write_bytes(b"".join(msgspec.json.encode(record) + b"\n" for record in records))
    return path


def test_validate_exits_1_and_names_record_and_check(
    good: Instruction, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bad = with_task(msgspec.structs.replace(good, id="bad"), 0, reference_plan=("RELEASE()",))
    path = write(tmp_path / "set.jsonl", good, bad)
    assert main(["tasks", "validate", str(path)]) == 1
    out = capsys.readouterr().out
    assert "bad: alone: tasks[0] ends hand_empty at step 0" in out
    assert "1 certified in the executor, 1 not" in out
    assert main(["tasks", "validate", str(write(tmp_path / "good.jsonl", good))]) == 0


def test_broken_files_are_read_beside_the_set(tmp_path: Path) -> None:
    path = broken_path(tmp_path / "set.jsonl")
    path.parent.mkdir()
    path.write_text('{"id": "a", "tasks": [[["drop_open", 1, 2, [], "closed", 1]]]}\n', "utf-8")
    assert read_broken(path) == {"a": ((Broken("drop_open", 1, 2, (), "closed", 1),),)}
    path.write_text("{}\n", "utf-8")
    with pytest.raises(InstructionError, match=r"set\.jsonl:1"):
        read_broken(path)


def test_generate_and_show(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "fresh.jsonl"
    command = ["tasks", "generate", "--kind", "single", "--n", "2", "--seed", "9", "--houses", "Rs_int"]
    assert main([*command, "--out", str(out)]) == 0
    record = msgspec.json.decode(out.read_bytes().splitlines()[0], type=Instruction)
    picture = tmp_path / "route.png"
    capsys.readouterr()
    assert main(["tasks", "show", record.id, str(out), "--png", str(picture)]) == 0
    shown = capsys.readouterr().out
    assert record.text in shown
    assert all(action in shown for action in record.tasks[0].reference_plan)
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert main(["tasks", "show", "nobody", str(out)]) == 2


def test_what_is_generated_in_a_file_s_house_runs_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine").mkdir()
    house = tmp_path / "mine" / "flat.json"
    house.write_bytes(shipped_data("scenes", "Rs_int.json").read_bytes())
    command = ["tasks", "generate", "--kind", "single", "--n", "1", "--houses", str(house)]
    out = house.with_name("tasks.jsonl")
    assert main([*command, "--out", str(out)]) == 0
    assert msgspec.json.decode(out.read_bytes(), type=Instruction).scene == "flat.json"
    [record] = read_instructions(out).values()
    assert record.scene == str(house)
    assert main(["tasks", "validate", str(out)]) == 0
    monkeypatch.chdir(tmp_path)
    capsys.readouterr()
    assert main(command) == 0
    assert msgspec.json.decode(capsys.readouterr().out, type=Instruction).scene == "mine/flat.json"
    (tmp_path / "other").mkdir()
    assert main([*command, "--out", "other/tasks.jsonl"]) == 2
    assert "flat.json lies outside other" in capsys.readouterr().err
    assert not any((tmp_path / "other").iterdir())


@pytest.mark.parametrize("span", ["5-2", "a-b", "-3"])
def test_bad_ranges_are_refused(span: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["tasks", "generate", f"--horizon={span}"])
    assert stopped.value.code == 2
    assert "--horizon" in capsys.readouterr().err


def test_every_check_says_what_it_means() -> None:
    assert all(CHECKS.values())


def test_the_documented_instruction_is_certified() -> None:
    page = (Path(__file__).parents[2] / "docs" / "howto" / "instructions.md").read_text("utf-8")
    blocks = page.split("```json\n")[1:]
    record = msgspec.json.decode(blocks[0].split("```")[0].encode(), type=Instruction)
    target = msgspec.json.decode(blocks[1].split("```")[0].encode())
    assert certify(record) == ()
    said = msgspec.structs.replace(
        record,
        text=target["text"],
        tasks=(msgspec.structs.replace(record.tasks[0], text=target["text"]),),
        meta={"targets": [target]},
    )
    assert certify(said) == ()
