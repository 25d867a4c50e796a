"""The pages that are made from the code hold what the code has, and the site's navigation has every page."""

from __future__ import annotations

import argparse
import importlib
import json
import re
import runpy
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from support.commands import commands_of

from eval.cli import build_parser
from gavel_env.instructions.record import shipped
from gavel_env.world_model.actions import Primitive
from gavel_env.world_model.dynamics import RULES, ViolationKind

DOCS = Path(__file__).parent.parent / "docs"


@pytest.fixture(scope="module")
def made() -> dict[str, str]:
    pages: dict[str, str] = runpy.run_path(str(DOCS / "generated.py"))["pages"]()
    return pages


def test_every_command_and_option_is_in_the_reference(made: dict[str, str]) -> None:
    page = made["reference/commands.md"]
    sections = dict(re.findall(r"^#{2,4} (gavel .+)\n((?:(?!^#).*\n)*)", page, re.MULTILINE))
    for parser in commands_of(build_parser()):
        section = sections[parser.prog]
        for action in parser._actions:
            if not isinstance(action, argparse._HelpAction | argparse._SubParsersAction):
                for option in action.option_strings:
                    assert f"`{option}`" in section, (parser.prog, option)


def test_the_table_of_actions_has_every_rule_and_every_kind_of_violation(made: dict[str, str]) -> None:
    rows = dict(re.findall(r"^\| `([A-Z_]+)` \| (.+)$", made["reference/actions.md"], re.MULTILINE))
    assert set(rows) == {primitive.name for primitive in Primitive if primitive in RULES}
    assert "`closed`" in rows["PLACE_INSIDE"]
    assert "`hand_full` *(profile `omnigibson` alone)*" in rows["OPEN"]
    for row in rows.values():
        needs, effect = row.removesuffix(" |").split(" | ")
        assert all(re.match(r"\w.* `\w+`", need) for need in needs.split("<br>")), needs
        assert len(effect) > 10
    assert set(re.findall(r"`(\w+)`", made["reference/actions.md"])) >= {kind.value for kind in ViolationKind}


def test_every_public_name_of_the_packages_is_in_the_api(made: dict[str, str]) -> None:
    for package in ("gavel_env", "gavel_agents", "eval"):
        module = importlib.import_module(package)
        page = made[f"reference/api/{package}.md"]
        for name in module.__all__:
            assert re.search(rf"^::: [\w.]+\.{name}$", page, re.MULTILINE), name


def test_a_shipped_instruction_is_valid_under_its_schema(made: dict[str, str]) -> None:
    schema: dict[str, Any] = json.loads(made["reference/schemas/instruction.schema.json"])
    line = json.loads(shipped("single").read_text("utf-8").splitlines()[0])
    jsonschema.validate(line, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**line, "scene": 3}, schema)


def test_the_navigation_has_every_page(made: dict[str, str]) -> None:
    named = set(re.findall(r": ([\w/-]+\.md)$", (DOCS.parent / "mkdocs.yml").read_text("utf-8"), re.MULTILINE))
    written = {path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")}
    assert named == written | {name for name in made if name.endswith(".md")}
