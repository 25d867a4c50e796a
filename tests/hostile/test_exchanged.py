"""What people exchange: stored conversations, graphs and categories as files, and commands of the text game."""

from __future__ import annotations

import gzip
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.hostile import changed_within, fuzzed, harmless
from support.houses import make

from eval.records.conversations import ConversationWriter, Exchange, read_conversations
from gavel_agents.llm import Completion, Message
from gavel_env import TextGame
from gavel_env.errors import BadAction, CategoryError, DataError, GraphError, ResetNeeded
from gavel_env.world_model.graph_file import graph_from_json, graph_to_json
from gavel_env.world_model.narration import look
from gavel_env.world_model.ontology import default_ontology

pytestmark = pytest.mark.hostile

JUNK: st.SearchStrategy[Any] = st.sampled_from(
    [None, True, -1, 0, 1.5, 1e300, 10**40, "", "x", "a\nb", "robot", "fridge_0", "any_x", [], {}, [[]], [[0, 1]] * 3]
)
WAY = st.lists(st.integers(0, 50), min_size=1, max_size=5)


# --- stored conversations


def asked(question: str) -> Exchange:
    return Exchange("m", {"seed": 0}, (Message("user", question),), Completion(f"answer to {question}", 1, 2, 0.5))


def stored(path: Path, *questions: str) -> list[str]:
    with ConversationWriter(path) as writer:
        return [call for question in questions for call in writer.add([asked(question)])]


@given(st.integers(0, 10**6), st.binary(min_size=1, max_size=12))
@fuzzed(60, 8_000)
def test_bytes_over_conversations_cost_the_calls_that_they_hit(tmp_path_factory: Any, at: int, junk: bytes) -> None:
    path = tmp_path_factory.mktemp("said") / "conversations.jsonl.gz"
    keys = stored(path, *"abcdef")
    content = bytearray(path.read_bytes())
    at %= len(content)
    content[at : at + len(junk)] = junk
    path.write_bytes(content)
    found = read_conversations([path])
    assert sum(found.get(key) is None for key in keys) <= 2
    before = path.read_bytes()
    again = stored(path, "g")
    assert found.damaged or path.read_bytes().startswith(before)
    after = read_conversations([path])
    assert all(after.get(key) == found.get(key) for key in keys if key in found)
    assert after.get(again[0]) is not None


LINES = st.lists(
    st.sampled_from(
        [
            b'{"kind":"text","id":"a","text":"b"}', b'{"kind":"text","id":"a"}', b'{"kind":"call"}', b"[]", b"\xff",
            b"[" * 100_000, b'{"kind":"text","id":"a","text":"b","x":' + b"[" * 100_000, b'{"kind":"x"}', b"", b"null",
            b'{"kind":"call","id":"c","model":"m","decoding":{},"messages":[["user","a"]],"completion":"a"}',
            b'{"kind":"call","id":"c","model":"m","decoding":{},"messages":[["judge","a"]],"completion":"a"}',
            b'{"kind":"call","id":"c","model":"m","decoding":{"x":[]},"messages":[],"completion":"a"}',
            b'{"kind":"call","id":"c","model":"m","decoding":{},"messages":[],"completion":"zz","seconds":1e999}',
        ]
    ),
    max_size=6,
)  # fmt: skip


@given(LINES)
@fuzzed(60, 8_000)
def test_lines_that_are_no_calls_are_passed_over(tmp_path_factory: Any, lines: list[bytes]) -> None:
    path = tmp_path_factory.mktemp("said") / "conversations.jsonl.gz"
    path.write_bytes(gzip.compress(b"\n".join(lines)))
    found = read_conversations([path])
    for key in ("a", "c"):
        found.get(key)
    found.changed()
    before = path.read_bytes()
    [key] = stored(path, "a")
    assert read_conversations([path]).get(key) is not None
    assert path.read_bytes().startswith(before)


def test_what_is_not_a_file_of_conversations_is_said_and_stays_as_it_is(tmp_path: Path) -> None:
    pipe, folder, text = tmp_path / "pipe.jsonl.gz", tmp_path / "folder.jsonl.gz", tmp_path / "text.jsonl.gz"
    os.mkfifo(pipe)
    (folder / "conversations.jsonl.gz").mkdir(parents=True)
    for path in (pipe, folder):
        with pytest.raises(DataError, match="not a regular file"):
            read_conversations([path])
    with pytest.raises(DataError, match="not a regular file"):
        ConversationWriter(pipe)
    text.write_bytes(b"notes that somebody wrote")
    [key] = stored(text, "a")
    assert text.read_bytes().startswith(b"notes that somebody wrote")
    assert read_conversations([text]).get(key) is not None
    for path in (tmp_path / ("x" * 300 + ".gz"), Path(f"{tmp_path}/\0.gz")):
        assert not len(read_conversations([path]))
        with pytest.raises(DataError):
            stored(path, "a")


def test_conversations_that_unpack_to_gigabytes_are_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eval.records.conversations.MOST_BYTES", 10_000)
    path = tmp_path / "conversations.jsonl.gz"
    stored(path, *map(str, range(100)))
    with pytest.raises(DataError, match="unpack to more than 10000 bytes"):
        read_conversations([path])


# --- graphs and categories

GRAPH: dict[str, Any] = {
    "format": "gavel-graph/1",
    "rooms": [
        {"id": "lab_0", "type": "lab", "position": [0, 0], "footprint": [[0, 0], [1, 0], [1, 1]]},
        {"id": "hall_0"},
    ],
    "connections": [{"rooms": ["lab_0", "hall_0"], "distance_m": 2.5}],
    "robot": {"room": "lab_0", "near": ["fridge_0"], "position": [1, 1]},
    "nodes": [
        {"id": "fridge_0", "category": "fridge", "room": "lab_0", "flags": ["open"], "position": [2, 1]},
        {"id": "vial_0", "category": "vial", "inside": "fridge_0"},
        {"id": "apple_0", "category": "apple", "held": True},
        {"id": "mug_0", "category": "mug", "on_top": "fridge_0", "room": "lab_0", "fixed": False},
    ],
    "next_to": [["fridge_0", "mug_0"]],
    "categories": {"vial": {"like": "bottle_of_soup", "words": ["test tube"], "size_m": [0.1, 0.1, 0.2]}},
}


@given(WAY, JUNK)
@fuzzed(200, 40_000)
def test_a_graph_with_one_thing_changed_is_read_or_said(way: list[int], to: Any) -> None:
    graph = harmless(graph_from_json, json.dumps(changed_within(GRAPH, way, to)))
    if not isinstance(graph, Exception):
        look(graph)
        assert graph_from_json(graph_to_json(graph)) == graph


@given(WAY, JUNK | st.sampled_from([float("nan"), float("inf"), object(), b"x", {1: 2}]))
@fuzzed(100, 20_000)
def test_a_mapping_with_one_thing_changed_is_read_or_said(way: list[int], to: Any) -> None:
    given = changed_within(GRAPH, way, to)
    harmless(graph_from_json, given if isinstance(given, dict) else {"nodes": given})


CATEGORIES = {
    "vial": {"like": "flask", "words": ["test tube"], "size_m": [0.1, 0.1, 0.2], "mass_kg": 0.1, "heat": True},
    "flask": {"like": "bottle", "graspable": True, "concepts": ["any_container"], "mount": "floor"},
}


@given(WAY, JUNK)
@fuzzed(150, 30_000)
def test_a_category_with_one_thing_changed_is_read_or_said(tmp_path_factory: Any, way: list[int], to: Any) -> None:
    path = tmp_path_factory.mktemp("own") / "mine.json"
    path.write_text(json.dumps(changed_within({"categories": CATEGORIES}, way, to)))
    harmless(default_ontology().extend, path)


@given(st.text(alphabet="[]categories.vl=\"\n{}' 1,#\\u\ud7ff", max_size=120) | st.text(max_size=60))
@fuzzed(100, 20_000)
def test_any_text_as_toml_is_read_or_said(tmp_path_factory: Any, text: str) -> None:
    path = tmp_path_factory.mktemp("own") / "mine.toml"
    path.write_text(text, "utf-8")
    found = harmless(default_ontology().extend, path)
    assert not isinstance(found, Exception) or isinstance(found, CategoryError)
    assert not isinstance(found, Exception) or str(path) in str(found)


@pytest.mark.parametrize("name", ["mine.json", "mine.toml"])
@pytest.mark.parametrize("content", [b"\xff\xfe", b"[" * 200_000, b'{"categories": ' + b"[" * 200_000, b"", b"a=" * 9])
def test_categories_that_are_not_readable_name_their_file(tmp_path: Path, name: str, content: bytes) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(CategoryError, match=r"mine\."):
        default_ontology().extend(path)


def test_a_long_line_of_kinds_is_said() -> None:
    table = {f"c{i}": {"like": f"c{i + 1}"} for i in range(5_000)}
    with pytest.raises(CategoryError, match=r"c\d+\.like: .*at most"):
        default_ontology().extend(table)


@pytest.mark.parametrize("size", [[-1, 1, 1], [0, 1, 1], [float("nan"), 1, 1], [1e300, 1, 1]])
def test_a_size_that_nothing_has_is_said(size: list[float]) -> None:
    with pytest.raises(CategoryError, match=r"categories\.vial\.size_m"):
        default_ontology().extend({"vial": {"size_m": size}})


@pytest.mark.parametrize("mass", [-1.0, 0.0, float("nan"), 1e300])
def test_a_mass_that_nothing_has_is_said(mass: float) -> None:
    with pytest.raises(CategoryError, match=r"categories\.vial\.mass_kg"):
        default_ontology().extend({"vial": {"mass_kg": mass}})


def tower(height: int) -> dict[str, Any]:
    """A graph of things that stand on each other, each with its room."""
    nodes = [{"id": "tray_0", "category": "tray", "room": "lab_0"}]
    for i in range(1, height):
        nodes.append({"id": f"tray_{i}", "category": "tray", "on_top": f"tray_{i - 1}", "room": "lab_0"})
    return {"format": "gavel-graph/1", "rooms": [{"id": "lab_0"}], "nodes": nodes}


def test_a_tower_higher_than_any_is_said() -> None:
    assert len(graph_from_json(tower(50)).world.nodes) == 50
    with pytest.raises(GraphError, match=r"nodes\[\d+\]: .*at most"):
        graph_from_json(tower(20_000))


# --- the text game


@pytest.fixture(scope="module")
def game() -> TextGame:
    game = TextGame(make(on_violation="noop", max_episode_steps=10**9), max_commands=10**9)
    game.reset(seed=0)
    return game


SAID = st.text(alphabet="golokpentakXi()[]{}@.,;:= \n\t'\"_-0\x00é\U0001f600", max_size=60) | st.sampled_from(
    ["look", "help", "go to", "find", "take", "put in", "GRASP(", "find any_cabinet@", "find @", "find x@y@z", "drop"]
)


@given(st.lists(SAID | JUNK | st.sampled_from([b"look", object()]), min_size=1, max_size=3))
@fuzzed(60, 8_000)
def test_no_command_raises_anything_else(game: TextGame, said: list[Any]) -> None:
    for command in said:
        found = harmless(game.step, command)
        if isinstance(found, Exception):
            assert isinstance(found, BadAction)
        else:
            assert found[0]
            assert len(found[0]) <= 100_000
            if found[2]:
                game.reset(seed=0)


REPEATED: list[Callable[[int], str]] = [
    lambda n: "x" * n, lambda n: "find " * n, lambda n: "go to " + " " * n + "x", lambda n: "[" * n, lambda n: "é" * n,
]  # fmt: skip


@pytest.mark.parametrize("repeated", REPEATED)
def test_a_command_longer_than_any_is_refused_and_not_read(game: TextGame, repeated: Callable[[int], str]) -> None:
    with pytest.raises(BadAction, match="at most 10000"):
        game.step(repeated(1_000_000))


def test_a_game_begins_with_reset() -> None:
    with pytest.raises(ResetNeeded):
        TextGame(make(on_violation="noop")).step("look")
