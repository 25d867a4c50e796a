"""Files of every kind, broken in every way: said in a typed error, within limits, and nothing is lost."""

from __future__ import annotations

import gzip
import json
import os
import resource
import struct
import subprocess
import sys
import zlib
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.hostile import changed_within, fuzzed, harmless, times

from eval.cli import main
from eval.records.journal import RecordWriter, read_records
from gavel_agents.llm.scripted import ScriptedModel
from gavel_env.data import read_bytes, shipped_data
from gavel_env.errors import DataError, SceneError
from gavel_env.house.omnigibson.layout_maps import read_layout
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.record import read_instructions
from gavel_env.world_model.ontology import load_ontology

pytestmark = pytest.mark.hostile

READERS = {
    "scene.json": load_scene,
    "mine.jsonl": read_instructions,
    "ontology.json": load_ontology,
    "answers.jsonl": ScriptedModel,
    "records.jsonl": lambda path: read_records([path]),
}


def made(folder: Path, name: str, kind: str) -> Path:
    path = folder / name
    if kind == "fifo":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "nested":
        path.write_bytes(b"[" * 200_000)
    elif kind == "not utf-8":
        path.write_bytes(b'{"scene": "\xff\xfe"}\n')
    elif kind == "empty":
        path.write_bytes(b"")
    elif kind == "bomb":
        path = folder / f"{name}.gz"
        path.write_bytes(gzip.compress(b" " * (300 << 20), 1))
    elif kind == "long name":
        path = folder / ("x" * 300 + name)
    elif kind == "nul":
        path = Path(f"{folder}/\0{name}")
    return path


@pytest.mark.parametrize(
    "kind", ["fifo", "folder", "nested", "not utf-8", "empty", "bomb", "missing", "long name", "nul"]
)
@pytest.mark.parametrize("name", READERS)
def test_a_file_that_is_none_is_said(tmp_path: Path, name: str, kind: str) -> None:
    path = made(tmp_path, name, kind)
    with pytest.raises(DataError):
        READERS[name](path if name != "answers.jsonl" else str(path))  # type: ignore[operator]


JUNK: st.SearchStrategy[Any] = st.sampled_from(
    [None, True, -1, 0, 1e6, 1e300, -1e300, 10**40, "", "x", "a\nb", "robot", "kitchen_0", [], {}, [[]]]
)
SCENE = json.loads(shipped_data("scenes", "Rs_int.json").read_bytes())
ONTOLOGY = json.loads(shipped_data("ontology.json").read_bytes())
ONTOLOGY["categories"] = ONTOLOGY["categories"][:40]


@given(st.lists(st.integers(0, 50), min_size=1, max_size=5), JUNK)
@fuzzed(80, 20_000)
def test_a_scene_with_one_thing_changed_is_read_or_said(tmp_path_factory: Any, way: list[int], to: Any) -> None:
    from gavel_env.house.floor_map import floor_map

    path = tmp_path_factory.mktemp("scene") / "mine.json"
    path.write_bytes(msgspec.json.encode(changed_within(SCENE, way, to)))
    scene = harmless(load_scene, path)
    if not isinstance(scene, Exception):
        harmless(lambda: floor_map(scene).reachable)


@given(st.lists(st.integers(0, 50), min_size=1, max_size=4), JUNK)
@fuzzed(80, 20_000)
def test_an_ontology_with_one_thing_changed_is_read_or_said(tmp_path_factory: Any, way: list[int], to: Any) -> None:
    path = tmp_path_factory.mktemp("ontology") / "mine.json"
    path.write_bytes(msgspec.json.encode(changed_within(ONTOLOGY, way, to)))
    harmless(load_ontology, path)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"polygon": [[0, 0], [1e6, 0], [0, 1]]}, "expected metres"),
        ({"polygon": [[0, 0], [900, 0], [0, 1]]}, "extend over"),
        ({"polygon": [[0, 0], [200, 200]] * 1000}, "m long"),
        ({"polygon": [[0, 0]]}, "needs 3"),
    ],
)
def test_a_house_larger_than_any_is_not_drawn(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    path = tmp_path / "mine.json"
    rooms = [{**SCENE["rooms"][0], **changes}, *SCENE["rooms"][1:]]
    path.write_bytes(msgspec.json.encode({**SCENE, "rooms": rooms}))
    with pytest.raises(SceneError, match=message):
        load_scene(path)


def test_a_picture_of_gigabytes_is_not_unpacked(tmp_path: Path) -> None:
    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    for width, bits in ((40_000, 8), (1_000, 16)):
        head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, width, bits, 0, 0, 0, 0))
        png = b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(b"\0" * 1000)) + chunk(b"IEND", b"")
        for name in ("floor_insseg_0.png", "floor_semseg_0.png", "floor_trav_no_obj_0.png"):
            (tmp_path / name).write_bytes(png)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        with pytest.raises(SceneError, match="pixels of"):
            read_layout(tmp_path, frozenset({"kitchen_0"}), None)
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000


FRESH = """
import sys
from eval.records.journal import RecordWriter
from eval.records.schema import RunHeader
from gavel_env.errors import DataError
path, kept = sys.argv[1], 0
for number in range(40):
    try:
        with RecordWriter(path) as writer:
            writer.set_aside()
            for line in range(3):
                writer.write(RunHeader("", {}, f"{sys.argv[2]}-{number}-{line}", {}, (), (), (), {}))
                kept += 1
    except DataError:
        pass
print(kept)
"""


def test_runs_that_start_anew_beside_each_other_lose_no_line(tmp_path: Path) -> None:
    path = tmp_path / "records.jsonl"
    for _ in range(times(1, 8)):
        running = [
            subprocess.Popen([sys.executable, "-c", FRESH, str(path), str(i)], stdout=subprocess.PIPE) for i in range(3)
        ]
        written = sum(int(process.communicate(timeout=120)[0]) for process in running)
        found = [line for file in tmp_path.glob("records*.jsonl") for line in file.read_bytes().splitlines()]
        assert len(found) == len(set(found)) == written
        for file in tmp_path.glob("records*.jsonl"):
            file.unlink()


def test_what_the_disk_does_not_take_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tables", "x" * 300]) == 2
    assert "File name too long" in capsys.readouterr().err
    assert main(["scenes", "show", "Rs_int", "--png", str(tmp_path / "a.png"), "--pixels-per-m", "inf"]) == 2
    assert main(["scenes", "show", "Rs_int", "--png", str(tmp_path / "a.png"), "--pixels-per-m", "1999"]) == 2
    with open("/dev/full", "w") as full:
        ran = subprocess.run(
            [sys.executable, "-m", "eval", "scenes", "list"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert (ran.returncode, ran.stderr) == (2, "gavel: No space left on device\n")


def test_a_record_file_is_read_past_what_is_no_record(tmp_path: Path) -> None:
    path = tmp_path / "records.jsonl"
    with RecordWriter(path) as writer:
        from eval.records.schema import RunHeader

        writer.write(RunHeader("", {}, "code", {}, (), (), (), {}))
    path.write_bytes(b"\xff\xfe\n" + read_bytes(path, "records") + b"[" * 100_000 + b"\n")
    assert len(read_records([path]).damaged) == 2


def test_a_folder_called_as_what_ships_is_no_file_of_that_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("single", "multi"):
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path)
    assert main(["eval", "--limit", "1", "--out", str(tmp_path / "run"), "--quiet"]) == 0
