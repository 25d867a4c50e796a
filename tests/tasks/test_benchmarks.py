"""The shipped benchmarks: figures, certificates, splits, and that they are what the recipes give."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import msgspec
import pytest

from eval.cli import main
from eval.studies.orders import METHODS, Orders
from gavel_env.instructions.record import Instruction, InstructionSet, read_instructions, shipped
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.tasks.broken import LEAST, broken_path, read_broken
from gavel_env.tasks.certificate import certify_set
from gavel_env.tasks.drafts import pair_split
from gavel_env.tasks.pairs import PairSet, read_pairs
from gavel_env.tasks.recipes import DIFFER, HOUSES, single_benchmark
from gavel_env.tasks.statistics import Statistics, needs_appliance, statistics
from gavel_env.tasks.templates import default_templates, expand
from gavel_env.world_model.goals import Designator

FOLDER = shipped("single").parent
PAIRS = {"validation": FOLDER / "pairs" / "validation.jsonl", "train": FOLDER / "pairs" / "train.jsonl.gz"}


@pytest.fixture(scope="module")
def sets() -> dict[str, InstructionSet]:
    return {name: read_instructions(shipped(name)) for name in ("single", "multi")}


@pytest.fixture(scope="module")
def figures(sets: dict[str, InstructionSet]) -> dict[str, Statistics]:
    return {name: statistics(records.values()) for name, records in sets.items()}


@pytest.fixture(scope="module")
def pairs() -> dict[str, PairSet]:
    return {name: read_pairs(path) for name, path in PAIRS.items()}


# --- figures --------------------------------------------------------------------------------------------------------


def test_single_tasks_are_as_described(figures: dict[str, Statistics]) -> None:
    found = figures["single"]
    assert found.instructions == 100
    assert found.scenes == dict.fromkeys(sorted(HOUSES), 10)
    assert found.steps_mean == pytest.approx(12.2, abs=0.3)
    assert found.steps_range[0] >= 8
    assert found.steps_range[1] <= 17
    wanted = {"inside": 102, "on_top": 97, "washed": 17, "cooked": 12, "toggled": 9, "dried": 3}
    assert set(found.literals) == set(wanted)
    assert all(abs(found.literals[name] - count) <= 5 for name, count in wanted.items())
    assert sum(found.literals.values()) == pytest.approx(240, abs=5)
    assert found.literals_per_task == {2: 67, 3: 26, 4: 7}
    assert found.room_said == pytest.approx(0.5, abs=0.1)


def test_multi_tasks_are_as_described(figures: dict[str, Statistics]) -> None:
    found = figures["multi"]
    assert found.instructions == 500
    assert found.scenes == dict.fromkeys(sorted(HOUSES), 50)
    assert set(found.tasks) == {2, 3, 4, 5}
    assert found.steps_mean == pytest.approx(18.8, abs=0.5)
    assert found.rooms_mean == pytest.approx(4.66, abs=0.3)
    assert found.appliance == pytest.approx(199, abs=5)
    assert found.room_unsaid == pytest.approx(0.54, abs=0.02)
    assert found.templates >= 90


def test_ordering_methods_differ_on_seven_in_ten(sets: dict[str, InstructionSet]) -> None:
    noted = [record.meta["orders_differ"] for record in sets["multi"].values()]
    assert sum(noted) / len(noted) == pytest.approx(DIFFER, abs=0.03)


def test_orders_are_found_by_running_the_methods(sets: dict[str, InstructionSet]) -> None:
    orders = Orders()
    for record in list(sets["multi"].values())[::100]:
        found = orders.of(record)
        assert set(found) == set(METHODS)
        assert all(sorted(order) == list(range(len(record.tasks))) for order in found.values())
        assert orders.differ(record) == (len(set(found.values())) > 1)


def test_appliance_instructions_are_those_with_a_conferred_literal(sets: dict[str, InstructionSet]) -> None:
    records = list(sets["multi"].values())
    by_text = [any(g.startswith(("cooked", "washed", "dried")) for t in r.tasks for g in t.goal) for r in records]
    assert [needs_appliance(r) for r in records] == by_text


def test_stats_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tasks", "list", "single", "--stats"]) == 0
    out = capsys.readouterr().out
    assert "single.jsonl: 100 instructions" in out
    assert "2 67, 3 26, 4 7" in out


# --- certificates ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["single", "multi"])
def test_every_shipped_instruction_is_certified(name: str, sets: dict[str, InstructionSet]) -> None:
    records = sets[name]
    assert records.rejected == ()
    broken = read_broken(broken_path(shipped(name)))
    problems = [str(p) for _, found in certify_set(records.values(), broken) for p in found]
    assert problems == []


@pytest.mark.parametrize("name", ["single", "multi"])
def test_every_task_has_broken_variants_of_many_kinds(name: str, sets: dict[str, InstructionSet]) -> None:
    broken = read_broken(broken_path(shipped(name)))
    assert list(broken) == list(sets[name])
    assert all(len(variants) >= LEAST for tasks in broken.values() for variants in tasks)
    endings = {v.ending for tasks in broken.values() for variants in tasks for v in variants}
    assert endings >= {
        "not_near", "closed", "hand_empty", "hand_full", "not_graspable", "room_target", "unknown_object",
        "no_interior", "no_surface", "door_open", "goal_unmet", "left_open", "left_on",
    }  # fmt: skip


def test_the_shipped_file_is_what_the_recipe_gives(sets: dict[str, InstructionSet]) -> None:
    """The whole single-task benchmark is drawn again (`python -m envs_data.build.instructions` draws all)."""
    again = list(single_benchmark())
    assert [record.id for record in again] == list(sets["single"])
    assert again == list(sets["single"].values())


# --- splits ---------------------------------------------------------------------------------------------------------


def named_pairs(names: list[set[str]]) -> set[tuple[str, str]]:
    return {(a, b) for group in names for a in group for b in group if a < b}


def literal_pairs(target: Mapping[str, Any]) -> list[set[str]]:
    """Return the category pairs that the literals of a target bring together."""
    vocabulary = default_vocabulary()
    known = {*vocabulary.movables, *vocabulary.furniture}
    found = []
    for text in (*target["goal"], *target["relations"]):
        if text.startswith("in_room"):
            continue  # a room is not an object, though a bar is both
        names = {Designator.parse(part).name for part in text.split("(", 1)[1].rstrip(")").split(",")}
        found.append(names & known)
    return found


def benchmark_pairs(records: InstructionSet) -> set[tuple[str, str]]:
    return named_pairs([names for r in records.values() for t in r.meta["targets"] for names in literal_pairs(t)])


def test_pair_files_have_their_sizes(pairs: dict[str, PairSet]) -> None:
    assert len(pairs["train"].pairs) >= 8_000
    assert len(pairs["validation"].pairs) == 500
    for found in pairs.values():
        assert len({pair.text for pair in found.pairs}) == len(found.pairs)


def test_no_sentence_and_no_object_pair_is_in_two_splits(
    sets: dict[str, InstructionSet], pairs: dict[str, PairSet]
) -> None:
    texts = {name: {pair.text for pair in found.pairs} for name, found in pairs.items()}
    texts["benchmark"] = {r.text for records in sets.values() for r in records.values()}
    combined = {
        name: named_pairs([n for p in found.pairs for t in p.tasks for n in literal_pairs(msgspec.to_builtins(t))])
        for name, found in pairs.items()
    }
    combined["benchmark"] = {pair for records in sets.values() for pair in benchmark_pairs(records)}
    for a, b in (("benchmark", "train"), ("benchmark", "validation"), ("validation", "train")):
        assert not texts[a] & texts[b]
        assert not combined[a] & combined[b]
    for name, found in combined.items():
        assert found
        assert all(pair_split(*pair) == name for pair in found)


def test_no_template_of_the_benchmark_is_in_train(sets: dict[str, InstructionSet]) -> None:
    templates = default_templates()
    used = {template for records in sets.values() for r in records.values() for template in r.meta["templates"]}
    trained = {t for by_split in templates.clauses.values() for line in by_split["train"] for t in expand(line)}
    assert used
    assert not {text for line in used for text in expand(line)} & trained


def test_texts_of_the_sets_are_all_different_and_ids_stable(sets: dict[str, InstructionSet]) -> None:
    records: list[Instruction] = [r for found in sets.values() for r in found.values()]
    assert len({r.text for r in records}) == 600
    assert all(r.id.startswith(f"{r.kind}-{r.scene}-") for r in records)
    first = next(islice(sets["multi"], 1))
    assert first == "multi-Beechwood_0_int-00"


def test_files_are_stamped(sets: dict[str, InstructionSet], tmp_path: Path) -> None:
    copy = tmp_path / "single.jsonl"
    copy.write_bytes(shipped("single").read_bytes())
    assert read_instructions(copy).stamp == sets["single"].stamp
    copy.write_bytes(copy.read_bytes().replace(b"mug", b"cup"))
    assert read_instructions(copy).stamp != sets["single"].stamp
