"""The HTML report: everything in it comes from the records, nothing in a record becomes markup."""

from __future__ import annotations

import base64
import gzip
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import msgspec
import pytest

from eval.cli import main
from eval.records.journal import RecordFile, RecordWriter, read_records
from eval.records.schema import Contestant, EpisodeRecord, Step
from eval.report.grid import grids
from eval.report.html import html_report
from eval.report.tables import results
from gavel_agents.agent import AgentTrace, TaskTrace
from gavel_env.data import shipped_data
from gavel_env.house.scenes import load_scene

EVIL = "</script><img src=x onerror=alert(1)> & <b>bold</b>"


class Elements(HTMLParser):
    """Collects the tags of a page and the text of its data element."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.data = ""
        self._inside = False
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._inside = dict(attrs).get("id") == "data"

    def handle_endtag(self, tag: str) -> None:
        self._inside = False

    def handle_data(self, data: str) -> None:
        if self._inside:
            self.data += data


def records() -> RecordFile:
    who = Contestant("epog", understanding="reference", config="c0")
    trace = AgentTrace(tasks=[TaskTrace(text="t", proposed=("OPEN(fridge)",), plan=("RELEASE()",), edits=("e",))])
    steps = (Step("NAVIGATE_TO(fridge)", "ok", 2.0, "fridge_0", ((0.0, 0.0), (2.0, 0.0))),)
    made = [
        EpisodeRecord(
            seed=0, instruction=f"i{n}", kind="single", scene=scene, text=text, data="d", code="c", contestant=who,
            outcome="unmet", failure="unmet:open", trace=trace, steps=steps, metres=2.0, error=text,
        )
        for n, (scene, text) in enumerate([("Rs_int", "Do it."), ("Rs_int", EVIL), ("/gone/house.json", "Do it.")])
    ]  # fmt: skip
    return RecordFile((), {record.key: record for record in made}, ())


def page_data(files: RecordFile) -> tuple[Elements, dict[str, Any]]:
    elements = Elements(html_report(files, title="My <results>"))
    return elements, unpacked(elements)


def unpacked(elements: Elements) -> dict[str, Any]:
    return dict(json.loads(gzip.decompress(base64.b64decode(elements.data))))


def test_nothing_in_a_record_becomes_markup() -> None:
    elements, data = page_data(records())
    assert {tag for tag, _ in elements.tags}.isdisjoint({"img", "b", "iframe", "link"})
    assert sum(tag == "script" for tag, _ in elements.tags) == 2
    assert [e["text"] for e in data["episodes"]] == ["Do it.", EVIL, "Do it."]
    assert data["title"] == "My <results>"


def test_a_record_opens_no_file_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    beside, elsewhere = tmp_path / "run", tmp_path / "home"
    house = shipped_data("scenes", "Rs_int.json").read_bytes()
    for folder in (beside, elsewhere):
        folder.mkdir()
        (folder / "house.json").write_bytes(house)
    (beside / "link.json").symlink_to(elsewhere / "house.json")
    monkeypatch.chdir(beside)
    [first, *_] = records().records.values()
    scenes = {
        str(beside / "house.json"): True, "house.json": True, "link.json": False,
        str(elsewhere / "house.json"): False, "../home/house.json": False,
    }  # fmt: skip
    for scene, opens in scenes.items():
        (beside / "records.jsonl").unlink(missing_ok=True)
        with RecordWriter(beside / "records.jsonl") as writer:
            writer.write(msgspec.structs.replace(first, scene=scene))
        assert (page_data(read_records([beside]))[1]["scenes"].keys() == {scene}) is opens


def test_the_page_asks_for_nothing_from_outside() -> None:
    page = html_report(records())
    assert set(re.findall(r"https?://[^\s\"']+", page)) == {"http://www.w3.org/2000/svg"}
    assert "src=" not in page.replace(EVIL.replace("<", "\\u003c"), "")


def test_the_tables_are_the_tables() -> None:
    files = records()
    _, data = page_data(files)
    expected = grids(results(files), failures=True)
    assert [tuple(map(tuple, grid["rows"])) for grid in data["tables"]] == [grid.rows for grid in expected]
    assert [grid["title"] for grid in data["tables"]] == [grid.title for grid in expected]
    assert [tuple(grid["facts"]) for grid in data["tables"]] == [grid.facts for grid in expected]


def test_every_episode_can_be_replayed_where_its_scene_is_shipped() -> None:
    _, data = page_data(records())
    assert list(data["scenes"]) == ["Rs_int"]
    [step] = data["episodes"][0]["steps"]
    assert step == ["NAVIGATE_TO(fridge)", "ok", 2.0, "fridge_0", [[0.0, 0.0], [2.0, 0.0]], ""]
    assert data["episodes"][0]["tasks"][0]["edits"] == ["e"]


def test_footprints_have_the_size_and_place_of_the_pieces() -> None:
    _, data = page_data(records())
    scene = load_scene("Rs_int")
    pieces = {piece.id: piece for piece in scene.furniture}
    drawn = data["scenes"]["Rs_int"]["pieces"]
    assert len(drawn) > 20
    for item in drawn:
        piece = pieces[item["id"]]
        corners = item["points"]
        assert sum(x for x, _ in corners) / 4 == pytest.approx(piece.x, abs=0.01)
        assert sum(y for _, y in corners) / 4 == pytest.approx(piece.y, abs=0.01)
        (x0, y0), (x1, y1), (x2, y2), _ = corners
        assert abs((x1 - x0) * (y2 - y1) - (y1 - y0) * (x2 - x1)) == pytest.approx(
            piece.size_m[0] * piece.size_m[1], abs=0.02 * sum(piece.size_m[:2]) + 0.001
        )
    rooms = data["scenes"]["Rs_int"]["rooms"]
    assert len(rooms) == len(scene.rooms)
    for room, outline in zip(rooms, scene.rooms, strict=True):
        xs, ys = zip(*outline.polygon, strict=True)
        assert min(xs) < room["label"][0] < max(xs)
        assert min(ys) < room["label"][1] < max(ys)


def test_the_command_writes_one_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with RecordWriter(tmp_path / "records.jsonl") as writer:
        for record in records().records.values():
            writer.write(record)
    out = tmp_path / "page.html"
    assert main(["report", str(tmp_path), "--output", str(out)]) == 0
    assert len(unpacked(Elements(out.read_text("utf-8")))["episodes"]) == 3
    assert "page.html" in capsys.readouterr().err
    assert main(["report", str(tmp_path), "--output", str(tmp_path / "no" / "page.html")]) == 2
