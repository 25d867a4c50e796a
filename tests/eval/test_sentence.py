"""`gavel run`: sentences carried out in houses, what is put where, what is asked, told and drawn."""

from __future__ import annotations

import base64
import gzip
import io
import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from rich.console import Console

import eval as gavel
from eval.cli import main
from eval.sentence import run as sentence_run
from eval.sentence.shell import Shell
from eval.sentence.staging import Staged, stage
from eval.sentence.telling import tell
from gavel_agents.understanding import Abstention, Decomposition, Question, RulesUnderstanding, TaskUnderstanding
from gavel_env.errors import BadOption, BadPlacement, NotInHouse
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.world_model.goals import Designator, parse_goal, unmet

MUG = "Put the mug in the dishwasher."


def task(*goal: str, objects: tuple[str, ...] = (), said: tuple[str, ...] = ()) -> TaskUnderstanding:
    return TaskUnderstanding("", tuple(map(Designator.parse, objects)), parse_goal(said).literals, parse_goal(goal))


def staged(
    *goal: str, scene: str = "Beechwood_0_int", seed: int = 0, places: tuple[str, ...] = (), **more: Any
) -> Staged:
    return stage("text", scene, [task(*goal, **more)], seed=seed, places=places)


def told(run: gavel.SentenceRun) -> str:
    console = Console(file=io.StringIO(), width=100)
    tell(run, console)
    return console.file.getvalue()  # type: ignore[attr-defined, no-any-return]


# --- end to end ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sentence", "scene"),
    [
        (MUG, "Beechwood_0_int"),
        ("Heat the potato in the microwave, then put it on the breakfast table.", "Rs_int"),
        ("Take the apple from the fridge to the breakfast table. Switch on the floor lamp.", "Wainscott_0_int"),
    ],
)
def test_a_sentence_is_carried_out_and_told(sentence: str, scene: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", sentence, "--scene", scene]) == 0
    shown = capsys.readouterr().out
    for heading in ("Understood", "In the house", "Believed at the start", "Plan", "Driven", "Done in"):
        assert heading in shown
    assert sentence.split(".", maxsplit=1)[0] in shown
    assert "found" in shown  # something was searched for


def test_python_gives_the_same_as_the_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    run = gavel.run_sentence(MUG, "Pomaria_1_int", seed=2)
    assert run.success
    assert main(["run", *MUG.split(), "--scene", "Pomaria_1_int", "--seed", "2", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["metres"] == run.record.metres > 0
    assert [step["action"] for step in record["steps"]] == [step.action for step in run.record.steps]
    assert record["contestant"]["agent"] == "gavel-full"
    assert record["trace"]["tasks"][0]["verdict"] == "valid"


def test_searches_that_come_back_are_told() -> None:
    sentence = "bring the mug to the sofa, put the notebook on the bed and wash the plate in the dishwasher"
    run = gavel.run_sentence(sentence, "Wainscott_0_int", agent="gavel-plus")
    assert run.success
    early = [s for s in run.record.steps if s.return_when is not None and s.reached is None]
    assert early
    assert " ".join(told(run).split()).count("came back to decide again") == len(early)


@pytest.mark.parametrize("agent", ["llm-only", "llm+p", "gavel-static", "gavel-plus", "epog"])
def test_any_planning_method_does_it(agent: str) -> None:
    assert gavel.run_sentence(MUG, agent=agent).success


def test_a_plan_that_needs_repair_is_told_with_what_was_changed_and_why(tmp_path: Path) -> None:
    answer = "NAVIGATE_TO mug\nGRASP mug\nNAVIGATE_TO dishwasher\nPLACE_INSIDE dishwasher"
    answers = tmp_path / "answers.jsonl"
    answers.write_text(json.dumps({"instruction": MUG, "completions": [answer]}) + "\n")
    run = gavel.run_sentence(MUG, planner=f"scripted:{answers}", agent="gavel-basic")
    assert run.success
    shown = told(run)
    assert "repaired: " in shown
    assert "open dishwasher" in shown
    assert not gavel.run_sentence(MUG, planner=f"scripted:{answers}", agent="llm-only").success


def test_failure_has_its_own_exit_status_and_says_what_is_missing(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", MUG, "--place", "mug in fridge"]) == 1
    shown = " ".join(capsys.readouterr().out.split())
    assert "mug_0 is behind the door of fridge_0, and no search opens doors" in shown
    assert "go to mug: not_found(mug); looked in" in shown
    assert "unmet: inside(mug, dishwasher)" in shown


def test_another_plan_is_checked_against_the_sentence() -> None:
    run = gavel.run_sentence(MUG, seed=1)
    found = run.verify("GRASP mug_0\nNAVIGATE_TO dishwasher_0\nPLACE_INSIDE dishwasher_0")
    assert not found.valid
    assert found.final.valid
    assert found.edits


# --- wrong use -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([""], "not understood: empty"),
        (["Put the sofa in the mug"], "not understood: cannot_move: 'sofa'"),
        (["Frobnicate the mug"], "not understood: unknown_word"),
        ([MUG, "--scene", "Beechwod_0_int"], "did you mean 'Beechwood_0_int'"),
        (
            [MUG, "--scene", "Wainscott_1_int"],
            "Wainscott_1_int has no dishwasher; houses that have one: Beechwood_0_int",
        ),
        ([MUG, "--place", "mug"], "is not a place; write THING on PLACE"),
        ([MUG, "--place", "mgu on desk"], "'mgu' is unknown"),
        ([MUG, "--place", "sofa on desk"], "'sofa' is not carried about"),
        ([MUG, "--place", "mug on fridgee"], "the house has no 'fridgee'; near to it: fridge"),
        ([MUG, "--place", "mug in sofa"], "nothing is put in a 'sofa'"),
        ([MUG, "--place", "mug at attic"], "no room is a 'attic'; rooms: bathroom_0"),
        ([MUG, "--agent", "gavel-ful"], "gavel-full"),
        ([MUG, "--agent", "oracle"], "not one of the planning methods"),
        ([MUG, "--planner", "clasical"], "did you mean 'classical'"),
    ],
)
def test_wrong_use_says_what_is_wrong(arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", *arguments]) == 2
    assert said in capsys.readouterr().err


def test_markup_in_a_sentence_is_only_text() -> None:
    class Reader:
        name = "reader"

        def understand(self, text: str, **_: Any) -> Decomposition:
            found = RulesUnderstanding().understand(MUG).tasks[0]
            return Decomposition((found,), passed_over=("[/red]",))

    run = gavel.run_sentence("Put the [bold]mug[/red] in the dishwasher ☂", understanding=Reader())
    assert "Put the [bold]mug[/red] in the dishwasher ☂" in told(run)
    assert "passed over: [/red]" in told(run)
    assert run.record.text == "Put the [bold]mug[/red] in the dishwasher ☂"


# --- questions -----------------------------------------------------------------------------------------------------


class Asking:
    """An understanding that wants to know which cabinet."""

    name = "asking"
    QUESTION = Question("cabinet", "Which cabinet?", "cabinet", ("bottom_cabinet", "top_cabinet@kitchen"))

    def understand(self, text: str, *, answers: Mapping[str, str] | None = None, **_: Any) -> Decomposition:
        if not answers:
            return Decomposition((), "ambiguous: 'cabinet' could be two", self.QUESTION)
        return RulesUnderstanding().understand(f"Put the mug in the {answers['cabinet'].replace('_', ' ')}.")


@pytest.fixture
def asking(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sentence_run, "load_understanding", lambda *_: Asking())


@pytest.mark.usefixtures("asking")
def test_a_question_without_an_answer_is_shown_with_its_choices(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "Put the mug in the cabinet"]) == 2  # the tests have no terminal
    shown = capsys.readouterr()
    assert "Which cabinet?\n  1. bottom cabinet\n  2. top cabinet in the kitchen\n" in shown.out
    assert "not understood: ambiguous: 'cabinet' could be two" in shown.err


@pytest.mark.usefixtures("asking")
@pytest.mark.parametrize("answer", ["1", "bottom cabinet"])
def test_answers_are_numbers_or_words(answer: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "Put the mug in the cabinet", "--answer", answer]) == 0
    shown = capsys.readouterr().out
    assert "mug in bottom cabinet" in shown
    assert "(cabinet)" in shown


@pytest.mark.usefixtures("asking")
def test_questions_are_asked_on_a_terminal(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setattr("sys.stdin", Terminal("1\n"))
    assert main(["run", "Put the mug in the cabinet"]) == 0
    assert "Which cabinet?" in capsys.readouterr().out


@pytest.mark.usefixtures("asking")
def test_python_gets_the_question_or_gives_the_answers() -> None:
    with pytest.raises(Abstention, match="ambiguous") as error:
        gavel.run_sentence("Put the mug in the cabinet")
    assert error.value.question == Asking.QUESTION
    run = gavel.run_sentence("Put the mug in the cabinet", answers={"cabinet": "bottom_cabinet"})
    assert run.answers == {"cabinet": "bottom_cabinet"}
    assert run.success


# --- where things are ----------------------------------------------------------------------------------------------


def test_the_same_seed_puts_things_in_the_same_place_and_others_elsewhere() -> None:
    places = [staged("inside(mug, dishwasher)", seed=seed).put[0].placement.target for seed in range(12)]
    assert places == [staged("inside(mug, dishwasher)", seed=seed).put[0].placement.target for seed in range(12)]
    assert len(set(places)) > 3


def test_nothing_is_drawn_behind_a_door_or_where_it_shall_go() -> None:
    for seed in range(30):
        found = staged("on_top(plate, breakfast_table)", "on_top(apple, countertop)", seed=seed)
        graph = instruction_graph(load_scene("Beechwood_0_int"), found.instruction)
        assert len(unmet(found.instruction.goal(), graph)) == 2
        for put in found.put:
            assert put.why == "drawn"
            assert graph.closed_container(put.placement.id or "") is None


def test_what_the_sentence_says_is_kept() -> None:
    for seed in range(8):
        found = staged("on_top(apple, desk)", said=("inside(apple, fridge)",), seed=seed)
        assert (found.put[0].placement.relation, found.put[0].placement.target) == ("in", "fridge_0")
        assert found.put[0].why == "as the sentence says"
        found = staged("inside(mug, dishwasher)", objects=("mug",), said=("in_room(mug, private_office)",), seed=seed)
        assert found.put[0].room == "private_office_0"
        found = staged("inside(mug@dining_room, dishwasher)", seed=seed)
        assert found.put[0].room == "dining_room_0"


def test_things_on_other_things_are_put_in_that_order() -> None:
    found = staged("on_top(apple, desk)", objects=("apple", "plate"), said=("on_top(apple, plate)",))
    plate, apple = found.put
    assert apple.placement.target == plate.placement.id == "plate_0"
    assert apple.room == plate.room


def test_what_the_caller_says_goes_before_the_sentence_and_the_rest_is_put_besides() -> None:
    places = ("apple on desk@private_office", "ball on the floor of the corridor", "the plate on the breakfast table")
    found = staged("on_top(apple, countertop)", said=("inside(apple, fridge)",), places=places)
    apple, *others = found.put
    assert apple.room == "private_office_0"
    assert apple.why == "as you said"
    assert {(put.placement.relation, put.room) for put in others} >= {("floor", "corridor_0")}
    assert [put.placement.category for put in others][1] == "plate"


def test_things_fit_where_they_are_put() -> None:
    for seed in range(20):
        found = staged("inside(mug, dishwasher)", seed=seed)
        graph = instruction_graph(load_scene("Beechwood_0_int"), found.instruction)
        size, place = graph.category("mug_0").size_m, graph.category(found.put[0].placement.target).size_m
        assert size is not None
        assert place is None or sorted(size)[1] <= sorted(place)[1]


def test_what_the_house_lacks_is_said() -> None:
    with pytest.raises(NotInHouse, match="Rs_int has no private office; rooms: "):
        staged("inside(mug, bookcase@private_office)", scene="Rs_int")
    with pytest.raises(NotInHouse, match="has no pool table"):
        staged("on_top(mug, pool_table)", scene="Rs_int")
    with pytest.raises(NotInHouse, match="has no sofa to put anything in"):
        staged("on_top(mug, desk)", said=("inside(mug, sofa)",))
    with pytest.raises(BadPlacement, match="is not a place"):
        staged("inside(mug, dishwasher)", places=("mug",))


def test_what_goes_without_saying_is_filled_in_and_said() -> None:
    dish, cloth = staged("washed(plate)"), staged("washed(t_shirt)")
    assert "dishwasher" in map(str, dish.tasks[0].objects)
    assert dish.notes == ("no appliance is named for it to be washed in: the dishwasher is used",)
    assert {"washer"} <= set(map(str, cloth.tasks[0].objects))
    named = staged("washed(plate)", objects=("plate", "washer"))
    assert not named.notes
    with pytest.raises(NotInHouse, match="nothing to make jersey dried"):
        staged("dried(jersey)", scene="Rs_int")


def test_what_shall_be_shut_is_open_at_the_start() -> None:
    run = gavel.run_sentence("Close the fridge.")
    assert run.staged.instruction.initial == ("open(fridge_0)",)
    assert run.success
    assert any("CLOSE" in step.action for step in run.record.steps)


@pytest.mark.parametrize("seed", range(4))
def test_the_one_that_is_on_is_looked_for_among_several(seed: int, capsys: pytest.CaptureFixture[str]) -> None:
    """Beechwood_0 has floor lamps in three rooms; which one is on is drawn."""
    assert main(["run", "Turn off the floor lamp.", "--seed", str(seed)]) == 0
    assert "on (or nothing would have to be done)" in capsys.readouterr().out


def test_what_cannot_be_planned_says_why() -> None:
    run = gavel.run_sentence("Take the mug to the corridor.")
    assert not run.success
    assert "no plan: no sequence of actions known here" in told(run)


def test_only_planning_methods_carry_out_sentences() -> None:
    with pytest.raises(BadOption, match="not one of the planning methods"):
        gavel.run_sentence(MUG, agent="oracle")


# --- files ---------------------------------------------------------------------------------------------------------


def test_files_show_the_drive(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = {kind: tmp_path / f"run.{kind}" for kind in ("html", "png", "gif", "webp")}
    options = [f"--{kind}={files[kind]}" for kind in ("html", "png", "gif")]
    assert main(["run", MUG, *options]) == 0
    packed = re.search(r'id="data"[^>]*>([^<]+)<', files["html"].read_text("utf-8"))
    assert packed
    page = json.loads(gzip.decompress(base64.b64decode(packed[1])))
    assert page["title"] == MUG
    assert page["episodes"][0]["steps"][0][0] == "NAVIGATE_TO(mug)"
    picture = cv2.imread(str(files["png"]))
    assert picture is not None
    assert min(picture.shape[:2]) > 400
    gavel.run_sentence(MUG).save(gif=files["webp"])
    for kind in ("gif", "webp"):
        read, film = cv2.imreadanimation(str(files[kind]))
        assert read
        assert len(film.frames) > 10
        assert np.abs(film.frames[0].astype(int) - film.frames[-1].astype(int)).mean() > 1
    assert str(files["gif"]) in capsys.readouterr().out.replace("\n", "")


def test_a_gif_without_pillow_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "PIL", None)
    assert main(["run", MUG, "--gif", str(tmp_path / "run.gif")]) == 2
    assert "a GIF needs Pillow: pip install 'gavel-env[gif]', or name the file .webp" in capsys.readouterr().err
    assert not (tmp_path / "run.gif").exists()


def test_a_file_that_cannot_be_written_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for option in ("--html", "--gif"):
        assert main(["run", MUG, option, str(tmp_path / "no" / "such" / "file.gif")]) == 2
        assert "cannot be written" in capsys.readouterr().err


# --- the prompt ----------------------------------------------------------------------------------------------------


def typed(*lines: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> str:
    monkeypatch.setattr("sys.stdin", io.StringIO("".join(f"{line}\n" for line in lines)))
    assert main(["run"]) == 0
    return capsys.readouterr().out


def test_the_prompt_takes_sentences_and_commands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = tmp_path / "plan.txt"
    plan.write_text("NAVIGATE_TO mug_0\nGRASP mug_0\nNAVIGATE_TO dishwasher_0\nPLACE_INSIDE dishwasher_0")
    page = tmp_path / "page.html"
    lines = [":plan", MUG, ":plan", ":why", ":verify", f":verify {plan}", f":html {page}", ":map", ":nonsense"]
    shown = typed(
        *lines,
        ":scene Rs_int",
        ":seed 3",
        ":place plate on bed",
        "Wash the plate.",
        ":quit",
        "Put",
        monkeypatch=monkeypatch,
        capsys=capsys,
    )
    assert shown.index("nothing has been done yet") < shown.index("Done in")
    assert shown.count("go to mug → take mug") == 2
    assert f"{MUG}: valid" in shown
    assert "fails at step 4" in shown or "not valid; repaired so:" in shown
    assert page.exists()
    assert "file://" in shown
    assert "no command 'nonsense'" in shown
    assert "plate_0 on bed_0" in shown
    assert "Rs_int, seed 3" in shown
    assert not shown.endswith("Put")


def test_the_prompt_survives_what_is_not_understood(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shown = typed(
        "Frobnicate the mug",
        ":seed x",
        ":scene nowhere",
        ":verify nofile",
        ":png",
        MUG,
        monkeypatch=monkeypatch,
        capsys=capsys,
    )
    for said in ("unknown_word", "a seed is a whole number", "unknown scene 'nowhere'", "write :png FILE", "Done in"):
        assert said in shown


def test_the_prompt_lists_scenes_and_draws_a_house_before_anything_is_done() -> None:
    console = Console(file=io.StringIO(), width=200)
    shell = Shell(lambda *_: pytest.fail("nothing was said"), console, "Rs_int", 0)
    shell.take(":scene")
    shell.take(":map")
    shown = console.file.getvalue()  # type: ignore[attr-defined]
    assert "Beechwood_0_int" in shown
    assert "gavel-Rs_int.png" in shown
