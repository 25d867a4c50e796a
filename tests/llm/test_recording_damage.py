"""Recordings that are cut off, damaged, secret-laden, shared or larger than anything: nothing that reads is lost."""

from __future__ import annotations

import contextlib
import gzip
import multiprocessing
import os
import resource
from collections.abc import Sequence
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eval.studies.recording import recorder
from gavel_agents.llm import Completion, Message, Prompt
from gavel_agents.llm.replay import Recorded, RecordingModel, ReplayModel, compact, read_recording
from gavel_env.errors import DataError
from gavel_env.instructions.lookup import About

WORDS = [f"word {number}" for number in range(30)]


class Echo:
    """Answers with the last turn."""

    name = "echo"
    decoding = {"temperature": 0.0}  # noqa: RUF012

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        return [Completion(prompt.messages[-1].content.upper(), 7, 3, 0.5) for prompt in prompts]


class Gone(Echo):
    """Cannot be reached."""

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        raise ConnectionError("no route to the host")


class Half(Echo):
    """Answers with half a character at the end."""

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        return [Completion(prompt.messages[-1].content.upper() + " \ud800") for prompt in prompts]


def prompt(text: str) -> Prompt:
    return Prompt((Message("user", text),), About(text), 0)


def recorded(path: Path, words: list[str] = WORDS) -> bytes:
    model = RecordingModel(Echo(), path)
    for word in words:
        model.complete([prompt(word)])
    model.close()
    return path.read_bytes()


def texts(path: Path) -> list[str]:
    return [record.text for record in read_recording(path)]


def open_again(path: Path) -> Path | None:
    """Open the recording as `gavel record` does, with a model that cannot be reached; return what was set aside."""
    model = RecordingModel(Gone(), path)
    model.close()
    return model.set_aside


@pytest.mark.parametrize("compacted", [False, True])
def test_a_recording_cut_off_anywhere_keeps_what_reads_and_is_itself_set_aside_untouched(
    tmp_path: Path, compacted: bool
) -> None:
    path = tmp_path / "echo.jsonl.gz"
    whole = recorded(path)
    if compacted:
        compact(path)
        whole = path.read_bytes()
    for kept in [*range(1, len(whole), 61), *range(len(whole) - 30, len(whole))]:
        path.write_bytes(whole[:kept])
        before = texts(path)
        aside = open_again(path)
        assert set(texts(path)) == set(before)
        if aside is not None:
            assert aside.read_bytes() == whole[:kept]
            aside.unlink()
        path.unlink()


def test_one_byte_off_the_end_costs_nothing_and_the_run_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "echo.jsonl.gz"
    recorded(path)
    compact(path)
    path.write_bytes(path.read_bytes()[:-1])
    aside = open_again(path)
    assert aside is not None
    assert sorted(texts(path)) == sorted(word.upper() for word in WORDS)
    RecordingModel(Echo(), path).complete([prompt("one more")])
    assert len(ReplayModel(str(path)).complete([prompt(word) for word in [*WORDS, "one more"]])) == 31


def test_a_byte_changed_anywhere_costs_at_most_the_members_around_it(tmp_path: Path) -> None:
    path = tmp_path / "echo.jsonl.gz"
    whole = recorded(path)
    for at in range(0, len(whole), 97):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
        aside = open_again(path)
        kept = texts(path)
        assert len(kept) >= len(WORDS) - 2
        assert set(kept) <= {word.upper() for word in WORDS}
        if aside is not None:
            aside.unlink()
        path.unlink()


def test_damage_in_the_middle_is_said_when_it_is_replayed_and_leaves_the_file_to_compact_as_it_is(
    tmp_path: Path,
) -> None:
    path = tmp_path / "echo.jsonl.gz"
    whole = recorded(path)
    middle = len(whole) // 2
    path.write_bytes(whole[:middle] + b"\xff" * 20 + whole[middle + 20 :])
    damaged = path.read_bytes()
    with pytest.raises(DataError, match=r"bytes \d+ to \d+ cannot be unpacked; `gavel record` sets it aside"):
        ReplayModel(str(path))
    with pytest.raises(DataError, match="stays as it is"):
        compact(path)
    assert path.read_bytes() == damaged


def _hold(path: str, ready: multiprocessing.synchronize.Event, done: multiprocessing.synchronize.Event) -> None:
    model = RecordingModel(Echo(), path)
    model.complete([prompt("first")])
    ready.set()
    done.wait(60)
    model.close()


def test_a_recording_has_one_writer_at_a_time(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    ready, done = context.Event(), context.Event()
    path = tmp_path / "echo.jsonl.gz"
    other = context.Process(target=_hold, args=(str(path), ready, done))
    other.start()
    try:
        assert ready.wait(60)
        with pytest.raises(DataError, match="written by another run"):
            RecordingModel(Echo(), path)
        with pytest.raises(DataError, match="written by another run"):
            compact(path)
    finally:
        done.set()
        other.join()
    assert texts(path) == ["FIRST"]
    assert open_again(path) is None


def test_a_completion_that_echoes_a_key_is_recorded_without_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOME_API_KEY", 'q"uo\\te-and-more')
    script = tmp_path / "answers.jsonl"
    script.write_bytes(msgspec.json.encode({"instruction": "say it", "completions": ['my key is q"uo\\te-and-more']}))
    path = tmp_path / "keys.jsonl.gz"
    model = recorder(f"scripted:{script}", path, 1)
    assert model.complete([prompt("say it")])[0].text == "my key is [SOME_API_KEY]"
    model.close()
    assert b"uo" not in gzip.decompress(path.read_bytes())


def test_half_a_character_and_a_full_disk_are_no_end_of_the_recording(tmp_path: Path) -> None:
    path = tmp_path / "echo.jsonl.gz"
    model = RecordingModel(Half(), path)
    assert model.complete([prompt("half")])[0].text == "HALF ?"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = path.stat().st_size
    resource.setrlimit(resource.RLIMIT_FSIZE, (before + 100, hard))
    try:
        with pytest.raises(DataError, match="cannot be written"):
            model.complete([prompt("".join(chr(33 + (n * n) % 90) for n in range(4000)))])
        assert path.stat().st_size == before
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    model.complete([prompt("after")])
    model.close()
    assert texts(path) == ["HALF ?", "AFTER ?"]


def test_a_few_megabytes_that_unpack_to_gigabytes_are_not_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "bomb.jsonl.gz"
    line = msgspec.json.encode(Recorded("k", "m", {}, 0, "x" * (8 << 20), 0, 0, 0.0)) + b"\n"
    path.write_bytes(gzip.compress(line * 4) * 12)  # 400 MB in 400 kB
    with pytest.raises(DataError, match="unpacks to more than"):
        ReplayModel(str(path))
    path.write_bytes(gzip.compress(b"[" * (17 << 20)))
    with pytest.raises(DataError, match="a line of"):
        ReplayModel(str(path))


@given(content=st.binary(max_size=300), packed=st.booleans())
@settings(max_examples=200, deadline=None)
def test_any_bytes_are_read_or_said_to_be_no_recording(
    tmp_path_factory: pytest.TempPathFactory, content: bytes, packed: bool
) -> None:
    path = tmp_path_factory.mktemp("any") / "any.jsonl.gz"
    path.write_bytes(gzip.compress(content) if packed else content)
    with contextlib.suppress(DataError):
        list(read_recording(path))


def _dies_at(path: Path, call: str) -> None:
    """Open a recording in a process that ends, as a kill would, when it comes to a call of `os`."""
    setattr(os, call, lambda *_: os._exit(9))
    open_again(path)


@pytest.mark.parametrize("call", ["link", "replace", "write", "fsync"])
def test_a_process_that_dies_while_it_sets_a_recording_aside_loses_nothing(tmp_path: Path, call: str) -> None:
    path = tmp_path / "r.jsonl.gz"
    torn = recorded(path)[:-5]
    path.write_bytes(torn)
    dying = multiprocessing.get_context("fork").Process(target=_dies_at, args=(path, call))
    dying.start()
    dying.join()
    assert dying.exitcode == 9
    assert path.read_bytes() == torn
    aside = open_again(path)
    assert aside is not None
    assert aside.read_bytes() == torn
    assert texts(path) == [word.upper() for word in WORDS]
