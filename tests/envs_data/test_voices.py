"""The shipped voices: certified, halves and voices balanced, apart from the templates; nothing here prints a text."""

from __future__ import annotations

import re
from collections import Counter

import pytest

from envs_data.build.voices.voices import VOICES
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.record import read_instructions, shipped
from gavel_env.tasks.certificate import certify
from gavel_env.tasks.templates import default_templates, expand
from gavel_env.world_model.goals import Designator, fitting, parse_literal

RECORDS = read_instructions(shipped("voices"))


def test_as_many_as_promised_in_both_halves() -> None:
    assert not RECORDS.rejected
    count = Counter((r.kind, r.meta["split"]) for r in RECORDS.values())
    assert count["single", "dev"] + count["single", "test"] >= 400
    assert count["multi", "dev"] + count["multi", "test"] >= 200
    assert len({r.scene for r in RECORDS.values()}) >= 12
    assert len({r.text for r in RECORDS.values()}) == len(RECORDS)
    for kind in ("single", "multi"):
        dev, test = count[kind, "dev"], count[kind, "test"]
        assert abs(dev - test) <= 0.1 * (dev + test)


def test_every_voice_speaks_in_both_halves() -> None:
    count = Counter((r.meta["voice"], r.meta["split"]) for r in RECORDS.values())
    assert {voice for voice, _ in count} == set(VOICES)
    assert min(count.values()) >= 12
    assert len(count) == 2 * len(VOICES)


@pytest.mark.parametrize("part", range(8))
def test_a_share_certifies_and_its_targets_denote_what_they_say(part: int) -> None:
    for record in list(RECORDS.values())[part::64]:
        assert certify(record) == ()
        graph = instruction_graph(load_scene(record.scene), record)
        for task, target in zip(record.tasks, record.meta["targets"], strict=True):
            assert list(task.goal) == target["goal"]
            for text, denotes in zip(target["goal"], target["denotes"], strict=True):
                literal = parse_literal(text)
                assert literal.predicate.value in denotes["predicates"]
                for designator, bounds in ((literal.subject, "subject"), (literal.object, "object")):
                    if isinstance(designator, Designator):
                        fits = set(fitting(graph, designator))
                        assert fits <= set(denotes[bounds]["most"])


@pytest.mark.slow
def test_all_certify() -> None:
    assert [str(problem) for record in RECORDS.values() for problem in certify(record)] == []


def test_no_text_is_a_template_filled_in() -> None:
    table = default_templates()
    clauses = [clause for groups in table.clauses.values() for part in groups.values() for clause in part]
    forms = [
        re.compile(re.sub(r"\\\{\w+\\\}", r"[\\w' -]+", re.escape(form.removeprefix("= ").strip())) + r"[.!?]?", re.I)
        for clause in clauses
        for form in expand(clause)
        if len(re.sub(r"\{\w+\}", "", form).split()) >= 3
    ]
    alike = [record.id for record in RECORDS.values() if any(form.fullmatch(record.text.strip()) for form in forms)]
    assert len(alike) <= 0.05 * len(RECORDS)
