"""Plans in other projects' forms, and the two commands that carry plans out and graphs in."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from agents.test_gate import GOAL, LAB, STEPS
from importers.test_importers import CONCEPTGRAPHS, RELATIONS, VIRTUALHOME
from support.worlds import kitchen

from eval.cli import main
from gavel_env.errors import NotExpressible
from gavel_env.exporters import EXPORTERS, UNCHECKED, to_behavior_tree, to_omnigibson, to_pddl_plan
from gavel_env.world_model.actions import Primitive, parse_action
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.own_actions import OwnAction, registered
from gavel_env.world_model.planning_task import planning_task

PLAN = tuple(map(parse_action, STEPS))
WIPE = OwnAction("WIPE", ("x",), needs=("near(x)",), effects=("not dirty(x)",))
STIR = OwnAction("STIR", ("x", "y"), needs=("near(x)",), effects=("not dirty(y)",))


def test_omnigibson_gets_names_of_its_enumeration() -> None:
    said = json.loads(to_omnigibson(PLAN))
    assert said["enum"] == "StarterSemanticActionPrimitiveSet"
    assert said["checked"] == UNCHECKED
    assert said["calls"][2] == {"primitive": "GRASP", "arguments": ["vial"]}
    assert json.loads(to_omnigibson([parse_action("RELEASE")]))["calls"] == [{"primitive": "RELEASE", "arguments": []}]
    with registered(WIPE, STIR):
        wiped = json.loads(to_omnigibson([parse_action("WIPE(bench)")]))
        assert wiped["enum"] == "SymbolicSemanticActionPrimitiveSet"
        with pytest.raises(NotExpressible, match="no primitive STIR"):
            to_omnigibson([parse_action("STIR(bench, rack)")])


def test_a_pddl_plan_is_read_back_by_its_task() -> None:
    graph = SceneGraph.from_json(LAB)
    task = planning_task(graph, GOAL)
    steps = [line.strip("()").split() for line in to_pddl_plan(PLAN, graph).splitlines() if line.startswith("(")]
    assert tuple(task.action(name, arguments) for name, *arguments in steps) == PLAN
    for name, *arguments in steps:
        [parameters] = re.findall(rf"\(:action {name}\s+:parameters \(([^)]*)\)", task.domain)
        assert parameters.count("?") == len(arguments)
        assert set(arguments) <= set(task.things)


def test_a_pddl_plan_names_what_is_put_down() -> None:
    held = kitchen({"apple_0": "held"})
    assert "(release apple_0)" in to_pddl_plan([parse_action("RELEASE")], held)
    with pytest.raises(NotExpressible, match=r"step 1, RELEASE\(\): nothing is held"):
        to_pddl_plan([parse_action("RELEASE")])
    with registered(STIR):
        assert "(stir bench rack)" in to_pddl_plan([parse_action("STIR(bench, rack)")])


def test_a_behaviour_tree_is_a_sequence_of_declared_nodes() -> None:
    with registered(STIR):
        tree = ET.fromstring(to_behavior_tree([*PLAN, parse_action("STIR(vial, rack)"), parse_action("RELEASE")]))
    assert tree.get("BTCPP_format") == "4"
    [sequence] = tree.findall("./BehaviorTree[@ID='Plan']/Sequence")
    assert [node.tag for node in sequence][-3:] == ["PlaceOnTop", "Stir", "Release"]
    assert (sequence[2].tag, sequence[2].get("target")) == ("Grasp", "vial")
    assert (sequence[6].get("x"), sequence[6].get("y")) == ("vial", "rack")
    ports = {node.get("ID"): [p.get("name") for p in node] for node in tree.findall("./TreeNodesModel/Action")}
    assert set(ports) == {node.tag for node in sequence}
    assert (ports["Stir"], ports["Release"]) == (["x", "y"], [])


@pytest.mark.parametrize("form", EXPORTERS)
def test_every_form_says_every_primitive_and_what_was_checked(form: str) -> None:
    names = [p.name for p in Primitive if p is not Primitive.RELEASE]
    texts = [f"{name}({'apple_0' if name == 'GRASP' else 'table_0'})" for name in names]
    texts = [step for text in texts for step in (("GRASP(apple_0)", text) if text.startswith("PLACE") else (text,))]
    text = EXPORTERS[form]([parse_action(step) for step in (*texts, "GRASP(apple_0)", "RELEASE")], None, "it all")
    assert "it all" in text
    said = re.sub("[^a-z]", "", text.lower())
    assert all(p.name.replace("_", "").lower() in said for p in Primitive)


# --- the commands -------------------------------------------------------------------------------------------------


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    (tmp_path / "lab.json").write_text(json.dumps(LAB))
    (tmp_path / "plan.txt").write_text("\n".join(STEPS))
    (tmp_path / "bad.txt").write_text("\n".join(STEPS[:-1]))
    (tmp_path / "odd.txt").write_text("\n".join([*STEPS, "WOBBLE(vial)"]))
    return tmp_path


@pytest.mark.parametrize("form", EXPORTERS)
def test_a_plan_is_checked_before_it_is_written(lab: Path, capsys: pytest.CaptureFixture[str], form: str) -> None:
    world = ["--graph", str(lab / "lab.json"), "--goal", GOAL]
    assert main(["export-plan", str(lab / "plan.txt"), "--to", form, *world]) == 0
    text = capsys.readouterr().out
    assert "checked" in text
    assert "not geometry" in text
    assert main(["export-plan", str(lab / "bad.txt"), "--to", form, *world]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert "Not reached: on_top(vial, rack)" in err


def test_without_a_world_it_is_only_read(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export-plan", str(lab / "plan.txt"), "--to", "ros", "--out", str(lab / "plan.xml")]) == 0
    assert UNCHECKED in (lab / "plan.xml").read_text()
    assert main(["export-plan", str(lab / "odd.txt"), "--to", "ros"]) == 1
    assert "line 7: 'WOBBLE(vial)'" in capsys.readouterr().err
    assert main(["export-plan", str(lab / "plan.txt"), "--to", "pddl", "--goal", GOAL]) == 2
    assert main(["export-plan", str(lab / "plan.txt"), "--to", "pddl", "--out", str(lab / "no" / "x")]) == 2
    assert main(["export-plan", str(lab / "none.txt"), "--to", "pddl"]) == 2


def test_a_graph_is_imported_by_a_command_and_verified_on(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (lab / "vh.json").write_text(json.dumps(VIRTUALHOME))
    ours = str(lab / "ours.json")
    assert main(["import-graph", str(lab / "vh.json"), "--from", "virtualhome", "--out", ours]) == 0
    assert "2 rooms, 7 things" in capsys.readouterr().out
    (lab / "plan.txt").write_text("RELEASE\nNAVIGATE_TO(fridge_0)\nOPEN(fridge_0)\n")
    verify = ["verify", "--graph", ours, "--plan", str(lab / "plan.txt"), "--goal"]
    assert main([*verify, "open(fridge_0)"]) == 0
    assert main([*verify, "not open(fridge_0)"]) == 1
    (lab / "cg.json").write_text(json.dumps(CONCEPTGRAPHS))
    (lab / "relations.json").write_text(json.dumps(RELATIONS))
    relations = ["--relations", str(lab / "relations.json"), "--out", ours]
    assert main(["import-graph", str(lab / "cg.json"), "--from", "conceptgraphs", *relations]) == 0
    assert main(["import-graph", str(lab / "vh.json"), "--from", "hydra", *relations]) == 2
    assert main(["import-graph", str(lab / "cg.json"), "--from", "procthor", "--out", ours]) == 2
