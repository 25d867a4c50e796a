"""Killed at any moment and gone on with: evaluations, their workers, and recordings lose nothing and end the same."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
from support.hostile import times

from eval.records.conversations import read_conversations
from eval.records.journal import read_records
from eval.records.schema import EpisodeRecord
from gavel_env.instructions.record import read_instructions, shipped

pytestmark = pytest.mark.hostile

ROOT = Path(__file__).parents[2]
DYING = "tests.support.dying"
KILLED = -signal.SIGKILL


def gavel(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    program = f"import sys, {DYING}; from eval.cli import main; sys.exit(main(sys.argv[1:]))"
    return subprocess.run(
        [sys.executable, "-c", program, *arguments],
        cwd=ROOT, env=os.environ | environment, capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.fixture(scope="module")
def instructions(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("few") / "few.jsonl"
    every = read_instructions(shipped("single")).values()
    few = [r for r in every if r.scene == "Rs_int"][:3]
    path.write_bytes(b"".join(msgspec.json.encode(r) + b"\n" for r in few))
    return str(path)


def moments(folder: Path, command: list[str], count: int, seed: int) -> Iterator[dict[str, str]]:
    """Run a command whole, and yield for some of its moments what makes it die there."""
    counted = folder / "moments"
    done = gavel(*command, GAVEL_TEST_MOMENTS=str(counted))
    assert done.returncode == 0, done.stderr
    last = int(counted.read_text())
    rng = random.Random(seed)
    for moment in sorted(rng.sample(range(1, last + 1), count)) if count <= last else range(1, last + 1):
        yield {"GAVEL_TEST_DIES": str(moment), "GAVEL_TEST_CUT": str(rng.random())}


def timeless(records: dict[Any, EpisodeRecord]) -> dict[Any, EpisodeRecord]:
    """Return records without what differs from run to run: seconds."""
    return {
        key: msgspec.structs.replace(
            record, seconds={}, finished="", trace=msgspec.structs.replace(record.trace, seconds={})
        )
        for key, record in records.items()
    }


def found(folder: Path) -> dict[Any, EpisodeRecord]:
    files = read_records([folder])
    assert not files.damaged
    stored = read_conversations([folder])
    assert all(call in stored for record in files.records.values() for call in record.calls)
    return timeless(dict(files.records))


def evaluation(instructions: str, out: Path, *more: str) -> list[str]:
    return [
        "eval", "--agents", "epog,llm-only", "--instructions", instructions, "--planner", "simulated:qwen3-8b",
        "--out", str(out), *more,
    ]  # fmt: skip


def test_an_evaluation_killed_at_any_moment_goes_on_to_the_same_table(instructions: str, tmp_path: Path) -> None:
    whole, tables = tmp_path / "whole", 0
    dying = moments(tmp_path, evaluation(instructions, whole), times(3, 86), seed=1)
    for number, death in enumerate(dying):
        out = tmp_path / f"killed-{number}"
        assert gavel(*evaluation(instructions, out), **death).returncode == KILLED
        kept = dict(read_records([out]).records) if (out / "records.jsonl").stat().st_size else {}
        resumed = gavel(*evaluation(instructions, out, "--resume"))
        assert resumed.returncode == 0, resumed.stderr
        assert found(out) == found(whole)
        after = read_records([out]).records
        assert all(after[key] == record for key, record in kept.items()), "what was done is not done again"
        tables += 1
    assert tables == times(3, 86)


def test_a_killed_worker_costs_the_episode_that_it_was_in(instructions: str, tmp_path: Path) -> None:
    whole = tmp_path / "whole"
    assert gavel(*evaluation(instructions, whole)).returncode == 0
    expected, rng, died = found(whole), random.Random(2), 0
    for number in range(times(1, 63)):
        out, once = tmp_path / f"out-{number}", tmp_path / f"once-{number}"
        death = {"GAVEL_TEST_DIES": str(rng.randint(1, 12)), "GAVEL_TEST_ONCE": str(once)}
        done = gavel(*evaluation(instructions, out, "--workers", "2", "--plugin", DYING), **death)
        died += once.exists()
        if done.returncode == KILLED:  # it was the runner
            done = gavel(*evaluation(instructions, out, "--resume"))
        assert done.returncode == 0, done.stderr
        records = found(out)
        lost = {key for key, record in records.items() if record.failure == "error:worker_died"}
        assert len(lost) <= 1
        assert records.keys() == expected.keys()
        assert all(record == expected[key] for key, record in records.items() if key not in lost)
    assert died == times(1, 63)


def test_a_recording_killed_at_any_moment_goes_on_to_the_same_answers(instructions: str, tmp_path: Path) -> None:
    def recording(out: Path) -> list[str]:
        few = ["--instructions", instructions, "--agents", "llm-only,gavel-basic", "--threads", "1"]
        return ["record", "--planner", "simulated:qwen3-8b", "--out", str(out), *few]

    whole = tmp_path / "whole.jsonl.gz"
    for number, death in enumerate(moments(tmp_path, recording(whole), times(2, 38), seed=3)):
        out = tmp_path / f"killed-{number}.jsonl.gz"
        assert gavel(*recording(out), **death).returncode == KILLED
        again = gavel(*recording(out))
        assert again.returncode == 0, again.stderr
        assert out.read_bytes() == whole.read_bytes()
