"""Reading files: regular ones only, within limits, with typed errors that name file and line."""

from __future__ import annotations

import gzip
import os
from pathlib import Path

import msgspec
import pytest

from gavel_env.data import is_path, read_bytes, read_json, read_lines, shipped_data
from gavel_env.errors import DataError, SceneError


class Form(msgspec.Struct):
    format: str
    number: int


def test_what_is_read_is_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "a.json.gz"
    path.write_bytes(gzip.compress(b'{"format": "x/1", ') + gzip.compress(b'"number": 3}'))
    assert read_json(path, Form, "test file", version="x/1") == Form("x/1", 3)
    lines = tmp_path / "b.jsonl"
    lines.write_bytes(b'{"format": "a", "number": 1}\n\n{"format": "b", "number": 2}')
    assert [line.number for line in read_lines(lines, Form, "test line")] == [1, 2]


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("missing.json", None, "cannot be read"),
        ("bad.json", b"{", "is malformed"),
        ("type.json", b'{"format": "x/1", "number": "3"}', "Expected `int`"),
        ("utf8.json", b'{"format": "\xff", "number": 3}', "is malformed"),
        ("deep.json", b"[" * 100_000, "is malformed"),
        ("old.json", b'{"format": "x/0", "number": 3}', "has format 'x/0'; this version reads 'x/1'"),
        ("plain.json.gz", b"not gzip", "cannot be unpacked"),
        ("torn.json.gz", gzip.compress(b'{"format": "x/1", "number": 3}' * 99, mtime=0)[:-9], "cannot be unpacked"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, name: str, content: bytes | None, said: str) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(SceneError, match=said) as raised:
        read_json(tmp_path / name, Form, "scene file", SceneError, version="x/1")
    assert name in str(raised.value)


def test_a_malformed_line_is_named(tmp_path: Path) -> None:
    path = tmp_path / "b.jsonl"
    path.write_bytes(b'{"format": "a", "number": 1}\n{"format": "b"}\n')
    lines = read_lines(path, Form, "test line")
    assert next(lines).number == 1
    with pytest.raises(DataError, match=r"b\.jsonl:2: malformed test line"):
        next(lines)


def test_limits_hold_before_anything_large_is_made(tmp_path: Path) -> None:
    bomb = tmp_path / "bomb.gz"
    bomb.write_bytes(gzip.compress(b"\0" * (64 << 20)))
    with pytest.raises(DataError, match="more than 1048576 bytes"):
        read_bytes(bomb, "test file", most=1 << 20)
    (tmp_path / "large").write_bytes(b"x" * 11)
    with pytest.raises(DataError, match="has 11 bytes; at most 10"):
        read_bytes(tmp_path / "large", "test file", most=10)


def test_only_regular_files_are_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path, tmp_path / "pipe", Path("/dev/zero")):
        with pytest.raises(DataError, match="is not a regular file"):
            read_bytes(path, "test file")
    for name in ("n" * 300, "nul\0byte"):
        with pytest.raises(DataError, match="cannot be read"):
            read_bytes(tmp_path / name, "test file")


@pytest.mark.parametrize(
    ("source", "path"), [("single", False), ("single.jsonl", True), ("./single", True), (Path("single"), True)]
)
def test_paths_are_told_from_names(source: str | Path, path: bool) -> None:
    assert is_path(source) is path


def test_shipped_data_is_there() -> None:
    assert shipped_data("scenes", "Rs_int.json").is_file()
