"""The report in a real browser: it opens at its top, filters, sorts, plays an episode; links lead back."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from eval import evaluate
from eval.records.conversations import ConversationWriter, Exchange, read_conversations
from eval.records.journal import RecordFile, read_records
from eval.records.schema import Contestant, EpisodeRecord, Scenery, Step
from eval.report.html import html_report
from eval.run.contestants import choose
from eval.run.episodes import EnvironmentSettings
from eval.run.runner import run, schedule
from gavel_agents.llm import Completion, Message
from gavel_env.instructions.record import read_instructions, shipped

CHROMIUM = next((path for path in map(shutil.which, ("chromium", "chromium-browser", "google-chrome")) if path), None)
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--virtual-time-budget=60000",
)
WATCH = """<script>
window.wrong = [];
addEventListener("error", (e) => window.wrong.push(e.message));
// In virtual time nothing is drawn, so there are no frames.
window.requestAnimationFrame = (f) => setTimeout(() => f(performance.now()), 16);
window.cancelAnimationFrame = clearTimeout;
</script>"""


def in_browser(
    page: str, folder: Path, script: str, *, width: int = 1200, link: str = "", flags: tuple[str, ...] = ()
) -> Any:
    """Return what an async script answers once the page is unpacked; fail on any error of the page."""
    run = (
        "<script>(async()=>{const wait=(ms)=>new Promise((r)=>setTimeout(r,ms));"
        "while(document.getElementById('episodes').hidden)await wait(20);await wait(50);"
        f"const answer=await(async()=>{{{script}}})();"
        "document.body.dataset.answer=JSON.stringify({answer,wrong:window.wrong});})()</script>"
    )
    file = folder / "report.html"
    file.write_text(page.replace("<head>", f"<head>{WATCH}").replace("</body>", f"{run}</body>"), "utf-8")
    command = [str(CHROMIUM), *FLAGS, *flags, f"--user-data-dir={folder / 'profile'}", f"--window-size={width},900"]
    done = subprocess.run(
        [*command, "--dump-dom", f"file://{file}{link}"], capture_output=True, text=True, timeout=120, check=True
    )
    found = re.search(r'data-answer="([^"]*)"', done.stdout)
    assert found, done.stdout[-2000:] + done.stderr[-2000:]
    result = json.loads(html.unescape(found[1]))
    assert result["wrong"] == []
    return result["answer"]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    out: Path = tmp_path_factory.mktemp("run")
    few = list(read_instructions(shipped("multi")).values())[:2]
    evaluate(["epog", "gavel-full", "oracle"], few, planner="reference:multi", out=out)
    return html_report(read_records([out]), conversations=read_conversations([out]))


def test_it_opens_at_its_top_with_charts_and_tables(page: str, tmp_path: Path) -> None:
    top, charts, tables, rows = in_browser(
        page,
        tmp_path,
        "return [scrollY, document.querySelectorAll('.chart rect').length, document.querySelectorAll('table').length,"
        "document.querySelectorAll('#list button').length]",
    )
    assert (top, rows) == (0, 6)
    assert charts >= 6
    assert tables >= 1


def test_an_episode_plays_to_its_end_and_every_literal_turns_true(page: str, tmp_path: Path) -> None:
    script = """
      const agent = document.getElementById("agent"), all = (what) => [...document.querySelectorAll(what)];
      agent.value = [...agent.options].map((o) => o.value).find((v) => v.startsWith("gavel-full"));
      agent.dispatchEvent(new Event("change"));
      const before = all(".side li").filter((li) => li.textContent.startsWith("✓")).length;
      const heat = all(".heat").filter((p) => Number(p.getAttribute("fill-opacity")) > 0).length;
      document.querySelector(".player button").click();
      const slider = document.querySelector(".player input");
      for (let i = 0; i < 4000 && slider.value !== slider.max; i++) await wait(10);
      const goal = [...document.querySelectorAll(".side ul li")].map((li) => li.textContent[0]);
      const shown = all("#list button").length;
      return [shown, before, heat, slider.value, slider.max, [...new Set(goal)], all(".turn").length, location.hash];
    """
    shown, before, heat, value, most, goal, turns, link = in_browser(page, tmp_path, script)
    assert shown == 2
    assert before == 0
    assert heat >= 2
    assert value == most
    assert goal == ["✓"]
    assert turns >= 2
    assert link.endswith(f"/{most}")


def test_a_link_leads_to_its_episode_and_step_on_a_phone_in_the_dark(page: str, tmp_path: Path) -> None:
    script = "document.querySelectorAll('#list button')[2].click(); return location.hash"
    link = in_browser(page, tmp_path, script).removesuffix("/0") + "/3"
    script = """
      const sum = (c) => (c.match(/[0-9.]+/g) ?? []).slice(0, 3).map(Number).reduce((a, b) => a + b, 0);
      const dark = [document.body, document.querySelector("svg.plan")]
        .map((n) => sum(getComputedStyle(n).backgroundColor));
      const row = document.querySelector("#list [aria-current]").textContent;
      const overflow = document.documentElement.scrollWidth - innerWidth;
      return [document.querySelector(".player input").value, row, overflow, dark];
    """
    step, row, overflow, dark = in_browser(
        page, tmp_path, script, width=390, link=link, flags=("--blink-settings=preferredColorScheme=0",)
    )
    assert step == "3"
    assert "oracle" in row
    assert overflow <= 0
    assert max(dark) < 3 * 60


def test_headings_sort_and_keys_move(page: str, tmp_path: Path) -> None:
    script = """
      const cells = () => [...document.querySelector("table tbody").children].map((row) => row.children[0].textContent);
      const before = cells();
      const heading = document.querySelector("table th button");
      heading.click();
      const up = cells();
      heading.click();
      const press = (key) => document.dispatchEvent(new KeyboardEvent("keydown", { key }));
      press("j"); press("ArrowRight"); press("ArrowRight"); press("ArrowLeft");
      const row = [...document.querySelectorAll("#list button")].findIndex((b) => b.hasAttribute("aria-current"));
      return [before, up, cells(), row, document.querySelector(".player input").value];
    """
    before, up, down, row, step = in_browser(page, tmp_path, script)
    assert sorted(before) == sorted(up)
    assert up == list(reversed(down))
    assert up != down
    assert (row, step) == (1, "1")


CONTRAST = """
  const parsed = (colour) => colour.match(/[0-9.]+/g).map(Number);
  const light = (rgb) => rgb.slice(0, 3).map((v) => v / 255)
    .map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const behind = (node) => {
    for (let n = node; n; n = n.parentElement) {
      const found = parsed(getComputedStyle(n).backgroundColor);
      if (found.length < 4 || found[3] === 1) return found;
    }
    return [255, 255, 255];
  };
  document.querySelectorAll("details").forEach((n) => { n.open = true; });
  for (let k = 0; k < 3; k++) document.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight" }));
  const poor = new Set(), seen = new Set();
  for (const node of document.querySelectorAll("body *:not(script):not(style):not(option)")) {
    const own = [...node.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    if (!own || !node.getClientRects().length) continue;
    const style = getComputedStyle(node);
    const colour = parsed(node instanceof SVGElement ? style.fill : style.color);
    const [a, b] = [light(colour), light(behind(node))];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    seen.add(node.tagName.toLowerCase());
    if (ratio < 4.5) poor.add(`${node.tagName} ${node.className.baseVal ?? node.className}: ${ratio.toFixed(2)}`);
  }
  return [[...poor], [...seen]];
"""


@pytest.fixture(scope="module")
def repaired(tmp_path_factory: pytest.TempPathFactory) -> str:
    """An instruction some of whose plans a small model would get wrong."""
    out: Path = tmp_path_factory.mktemp("repaired")
    few = list(read_instructions(shipped("multi")).values())[2:3]
    evaluate(["gavel-full"], few, planner="simulated:qwen3-4b", out=out)
    return html_report(read_records([out]), conversations=read_conversations([out]))


@pytest.mark.parametrize("scheme", [0, 1], ids=["dark", "light"])
def test_every_text_stands_out_from_what_is_behind_it(repaired: str, tmp_path: Path, scheme: int) -> None:
    flags = (f"--blink-settings=preferredColorScheme={scheme}",)
    poor, seen = in_browser(repaired, tmp_path, CONTRAST, flags=flags)
    assert {"td", "text", "small", "li", "del", "ins", "summary", "pre", "button"} <= set(seen)
    assert poor == []


def test_rows_of_one_agent_are_told_apart_and_chosen_by_planner(tmp_path: Path) -> None:
    few = read_instructions(shipped("multi"))
    chosen = choose(["gavel-full"], EnvironmentSettings(), planners=["reference:multi", "simulated:qwen3-8b"])
    page = html_report(read_records([run(schedule(chosen, [few], limit=2), tmp_path)]))
    script = """
      const all = (what) => [...document.querySelectorAll(what)], planner = document.getElementById("planner");
      const before = all("#list button").length;
      planner.value = "simulated:qwen3-8b";
      planner.dispatchEvent(new Event("change"));
      return [before, [...planner.options].map((o) => o.value), all("#list small").map((row) => row.textContent)];
    """
    before, options, rows = in_browser(page, tmp_path, script)
    assert before == 4
    assert options == ["", "reference:multi", "simulated:qwen3-8b"]
    assert len(rows) == 2
    assert all("simulated:qwen3-8b" in row for row in rows)


EVIL = "</script><img src=x onerror=window.wrong.push(1)><b>"


def test_hostile_names_and_texts_stay_text_and_play(tmp_path: Path) -> None:
    names = ("constructor", "__proto__", "toString", EVIL)
    steps = tuple(Step(f"GRASP({name})", "ok", 0.5, name, ((0.0, 0.0), (1.0, 0.0))) for name in names)
    beliefs = ((0, "constructor", {"toString": 0.5, "kitchen_0": 0.5}),)
    record = EpisodeRecord(
        seed=0, instruction=EVIL, kind="single", scene="Rs_int", text=EVIL, data="d", code="c", steps=steps,
        contestant=Contestant("__proto__", config="constructor"), outcome="unmet", failure="unmet:open", error=EVIL,
        scenery=Scenery((0.0, 0.0), dict.fromkeys(names, (0.0, 0.0)), names, ((0, (0,)),), beliefs),
    )  # fmt: skip
    script = """
      document.querySelector(".player button").click();
      const slider = document.querySelector(".player input");
      for (let i = 0; i < 2000 && slider.value !== slider.max; i++) await wait(10);
      const marks = document.querySelectorAll("img, b:not(.turn b)").length;
      return [slider.value, marks, document.querySelector("#episode h3").textContent];
    """
    value, marks, heading = in_browser(html_report(RecordFile((), {record.key: record}, ())), tmp_path, script)
    assert value == "4"
    assert marks == 0
    assert EVIL in heading


def test_an_answer_that_was_cut_is_called_so(tmp_path: Path) -> None:
    with ConversationWriter(tmp_path / "conversations.jsonl.gz") as writer:
        calls = writer.add(
            [
                Exchange("m", {}, (Message("user", reason),), Completion("OPEN(", finish_reason=reason))
                for reason in ("stop", "length", "filter")
            ]
        )
    record = EpisodeRecord(
        seed=0, instruction="i", kind="single", scene="Rs_int", text="Open it.", data="d", code="c",
        contestant=Contestant("llm-only", config="c"), outcome="unmet", failure="unmet:open", calls=tuple(calls),
    )  # fmt: skip
    page = html_report(RecordFile((), {record.key: record}, ()), conversations=read_conversations([tmp_path]))
    script = "return [...document.querySelectorAll('.cut')].map((p) => p.textContent)"
    assert in_browser(page, tmp_path, script) == [
        "answer cut at the most tokens",
        "answer cut by a content filter",
    ]
