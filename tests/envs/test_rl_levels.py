"""The instructions of the levels of Gavel-RL-v0: certified, apart from the benchmarks, and what the build gives."""

from __future__ import annotations

from itertools import islice

import msgspec
import pytest

from envs_data.build.rl_levels import KNOBS, build
from gavel_env.envs.goal_slots import named_slots
from gavel_env.envs.levels import LEVELS, level_instructions
from gavel_env.house.scenes import BENCHMARK_HOUSES
from gavel_env.instructions.record import read_instructions, shipped
from gavel_env.tasks.certificate import certify
from gavel_env.tasks.drafts import pair_split
from gavel_env.world_model.goals import Literal

RECORDS = read_instructions(shipped("rl"))


def pairs(literal: Literal) -> str | None:
    return None if literal.object is None else pair_split(literal.subject.name, literal.object.name)


def test_levels_use_no_house_and_no_pair_of_the_benchmarks() -> None:
    assert not {record.scene for record in RECORDS.values()} & set(BENCHMARK_HOUSES)
    splits = {pairs(literal) for record in RECORDS.values() for literal in record.goal().literals}
    assert splits <= {"train", None}


@pytest.mark.parametrize("name", ["easy", "medium", "hard"])
def test_levels_are_as_described(name: str) -> None:
    level = LEVELS[name]
    train, test = level_instructions(name, "train"), level_instructions(name, "test")
    assert (len(train), len(test)) == (100, 50)
    assert not {record.text for record in train} & {record.text for record in test}
    for record in (*train, *test):
        assert len(named_slots(record.goal())) <= level.slots
        assert len(record.goal().literals) <= level.literals
        assert 2 * len(record.reference_plan()) <= level.max_steps
        assert len(record.tasks) in range(KNOBS[name].tasks[0], KNOBS[name].tasks[1] + 1)


def test_every_benchmark_instruction_fits_its_level() -> None:
    level = LEVELS["benchmark"]
    for record in level_instructions("benchmark"):
        assert len(named_slots(record.goal())) <= level.slots
        assert len(record.goal().literals) <= level.literals


def test_a_sample_is_certified() -> None:
    for record in islice(RECORDS.values(), 0, None, 15):
        assert certify(record) == ()


@pytest.mark.data
def test_the_file_is_what_the_build_gives() -> None:
    content = b"".join(msgspec.json.encode(record) + b"\n" for record in build())
    assert shipped("rl").read_bytes() == content
