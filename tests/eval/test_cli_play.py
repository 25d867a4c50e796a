"""`gavel play`: a session at the prompt."""

from __future__ import annotations

import io
from pathlib import Path

import cv2
import pytest
from support.houses import FILE

from eval.cli import main


def played(monkeypatch: pytest.MonkeyPatch, lines: str, *arguments: str) -> int:
    monkeypatch.setattr("sys.stdin", io.StringIO(lines))
    return main(["play", "--file", str(FILE), *arguments])


def test_an_instruction_is_carried_out_at_the_prompt(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    lines = "look\ncommands\nmap\nfind apple\ntake apple_0\nfind coffee_table\nput on coffee_table_0\n"
    picture = tmp_path / "map.png"
    assert played(monkeypatch, lines, "--instruction", "rs_apple_to_table", "--map", str(picture)) == 0
    said = capsys.readouterr().out
    assert "You have done it." in said
    assert "score 100%" in said
    assert "  find apple" in said
    assert picture.as_uri() in said
    shown = cv2.imread(str(picture))
    assert shown is not None
    assert shown.shape[2] == 3


def test_who_leaves_has_not_won(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert played(monkeypatch, "quit\n", "--scene", "Rs_int") == 1
    assert played(monkeypatch, "", "--scene", "Rs_int") == 1
    assert capsys.readouterr().out.count("score 0%") == 2


def test_unknown_names_are_said(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert played(monkeypatch, "", "--instruction", "rs_apple_to_tabel") == 2
    assert "did you mean 'rs_apple_to_table'" in capsys.readouterr().err
