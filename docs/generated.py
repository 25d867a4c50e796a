"""The pages that are made from the code when the site is built: commands, actions, schemas, and the API.

MkDocs calls `on_files`; `pages()` gives the same pages to the tests.
"""

from __future__ import annotations

import argparse
import importlib
import inspect
import json
import os
import re
from collections.abc import Iterator, Mapping
from typing import Any

import msgspec

MADE = "<!-- Made from the code by docs/generated.py. -->\n\n"


# --- the command line ------------------------------------------------------------------------------------------------


def commands_page() -> str:
    """Return the reference of every command, from the argument parsers."""
    from eval.cli import build_parser

    parts = [MADE, "# Commands\n\n`gavel COMMAND --help` prints the same. `python -m eval` is `gavel`.\n\n"]
    for parser, summary, level in _commands(build_parser()):
        usage = re.sub(r"^usage: ", "", parser.format_usage()).rstrip()
        parts.append(f"{'#' * level} {parser.prog}\n\n")
        text = parser.description or (summary[:1].upper() + summary[1:] if summary else "")
        if text:
            parts.append(f"{_escaped(text.rstrip('.'))}.\n\n")
        parts.append(f"```text\n{usage}\n```\n\n{_arguments(parser)}")
    return "".join(parts)


def _commands(
    parser: argparse.ArgumentParser, summary: str = "", level: int = 2
) -> Iterator[tuple[argparse.ArgumentParser, str, int]]:
    """Yield the commands and their parts, each with the line that the list of its parent says of it."""
    if level > 2:
        yield parser, summary, level - 1
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            lines = {choice.dest: choice.help or "" for choice in action._choices_actions}
            for name, part in action.choices.items():
                if part.prog.endswith(f" {name}"):  # not an alias
                    yield from _commands(part, lines.get(name, ""), level + 1)


def _arguments(parser: argparse.ArgumentParser) -> str:
    """Return the tables of a command's arguments, one for each group."""
    parts = []
    for group in parser._action_groups:
        rows = []
        for action in group._group_actions:
            if isinstance(action, argparse._HelpAction | argparse._SubParsersAction):
                continue
            names = ", ".join(f"`{name}`" for name in action.option_strings)
            if not names:
                names = f"`{action.metavar or action.dest}`"
            elif action.nargs != 0:
                names += f" `{_metavar(action)}`"
            help_text = _escaped((action.help or "") % {**vars(action), "prog": parser.prog} if action.help else "")
            if action.choices and not isinstance(action.metavar, str):
                help_text = "; ".join(
                    filter(None, (help_text, "one of " + ", ".join(f"`{c}`" for c in action.choices)))
                )
            rows.append(f"| {names} | {help_text} |")
        if rows:
            title = group.title or ""
            if title not in ("options", "positional arguments"):
                parts.append(f"*{title[:1].upper()}{title[1:]}*\n\n")
            head = "argument" if title == "positional arguments" else "option"
            parts.append(f"| {head} | meaning |\n|---|---|\n" + "\n".join(rows) + "\n\n")
    return "".join(parts)


def _metavar(action: argparse.Action) -> str:
    if isinstance(action.metavar, str):
        return action.metavar
    return action.dest.upper()


def _escaped(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*").replace("\n", " ")


# --- the actions -----------------------------------------------------------------------------------------------------


def actions_page() -> str:
    """Return the semantics of the nine primitives, from the table of rules."""
    from gavel_env.world_model import dynamics
    from gavel_env.world_model.actions import Primitive

    rows = []
    for primitive in Primitive:
        rule = dynamics.RULES.get(primitive)
        if rule is None:
            continue
        needs = [_need(check) for check in rule.preconditions]
        needs += [f"{_need(check)} *(profile `omnigibson` alone)*" for check in rule.omnigibson]
        effect = inspect.getdoc(rule.effect) or ""
        rows.append(f"| `{primitive.name}` | {'<br>'.join(needs)} | {_escaped(effect)} |")
    kinds = "\n".join(f"| `{kind.value}` | {text} |" for kind, text in _reasons())
    return f"""{MADE}# Actions

What the nine primitives need and do. The table is made from the rules that the hidden world and the agents' world
model share (`gavel_env.world_model.dynamics.RULES`), in the order in which violations are reported; each
precondition is followed by the kind of its violation. An action whose preconditions do not hold is *invalid* and
changes nothing.

| action | needs | does |
|---|---|---|
{chr(10).join(rows)}

Only the executor knows geometry, so `NAVIGATE_TO` can also end as `unreachable` (no free way leads there) or
`not_found` (every room was searched). Which category opens, runs, cooks, washes, or can be lifted comes from the
[ontology](data.md#ontology). Actions of your own
are [further rows of the table](../howto/worlds.md).

## Violations

| kind | in words |
|---|---|
{kinds}

## Safe

A plan is safe if, at its end, everything that it opened is shut, and every safety-critical appliance that it
switched on is off, unless the goal asks for open or on ([what counts as safety-critical](data.md#decided-by-rule)).
"""


def _need(check: Any) -> str:
    """Return a precondition in words, with the kinds of violation that its function names."""
    kinds = re.findall(r"ViolationKind\.(\w+)", inspect.getsource(check))
    return f"{_escaped(inspect.getdoc(check) or '').rstrip('.')} " + ", ".join(f"`{kind.lower()}`" for kind in kinds)


def _reasons() -> list[tuple[Any, str]]:
    from gavel_env.world_model.narration import REASONS

    return [(kind, text.replace("{x}", "x").replace("{blocker}", "y")) for kind, text in REASONS.items()]


# --- schemas ---------------------------------------------------------------------------------------------------------


def schemas() -> dict[str, tuple[str, Any]]:
    """Return what is written and read as JSON: name of the schema -> (one line, type)."""
    from eval.records.schema import EpisodeRecord, RunHeader
    from gavel_env.instructions.record import Instruction

    return {
        "instruction": ("a line of an instruction file ([fields](../howto/instructions.md))", Instruction),
        "record": ("an episode in `records.jsonl`", EpisodeRecord),
        "run": ("a start or resumption of a run in `records.jsonl`", RunHeader),
    }


def schema_text(kind: Any) -> str:
    """Return the JSON schema of a type."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return json.dumps({**head, **msgspec.json.schema(kind)}, indent=2) + "\n"


def schemas_page() -> str:
    """Return the page of the schemas, with the fields of records as their docstrings tell them."""
    from eval.records.schema import OUTCOMES

    rows = [f"| [`{name}`](schemas/{name}.schema.json) | {line} |" for name, (line, _) in schemas().items()]
    rows += [
        "| [`graph`](schemas/graph.schema.json) | a graph of your own, `gavel-graph/1` |",
        "| [`categories`](schemas/categories.schema.json) | categories of your own |",
        "| [`verdict`](schemas/verdict.schema.json) | what `gavel verify --json` prints, `gavel-verdict/1` |",
    ]
    outcomes = "\n".join(f"| `{name}` | {_escaped(text)} |" for name, text in OUTCOMES.items())
    fields = "\n\n".join(
        f"::: {kind.__module__}.{kind.__qualname__}\n    options: {{ heading_level: 3, members: false }}"
        for _, kind in schemas().values()
    )
    return f"""{MADE}# Schemas

JSON Schema (draft 2020-12) of the files that the project writes and reads. Records name theirs in `"schema"`, and
newer versions read older records.

| schema | of |
|---|---|
{chr(10).join(rows)}

## Outcomes

How an episode ends. All of them count in the denominator.

| outcome | meaning |
|---|---|
{outcomes}

## Fields

{fields}
"""


# --- the API ---------------------------------------------------------------------------------------------------------

API: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "gavel_env": ("Importing `gavel_env` registers the environments. What it offers:", ()),
    "gavel_agents": ("Agents by name, what they are made of, and the verifier.", ()),
    "eval": (
        "Runs and their results. `gavel_eval` is the same package, for folders that hold an `eval.py` of their own.",
        (),
    ),
    "world_model": (
        "Graphs, goals and the transition model: pure functions, without geometry and without agents.",
        (
            "gavel_env.world_model.actions",
            "gavel_env.world_model.graph",
            "gavel_env.world_model.goals",
            "gavel_env.world_model.dynamics",
            "gavel_env.world_model.verdict",
            "gavel_env.world_model.ontology",
            "gavel_env.world_model.own_categories",
            "gavel_env.world_model.own_actions",
            "gavel_env.world_model.graph_file",
            "gavel_env.world_model.concepts",
            "gavel_env.world_model.planning_task",
        ),
    ),
    "instructions": (
        "Instructions and scenes: reading, drawing, generating.",
        ("gavel_env.instructions.record", "gavel_env.house.scenes", "gavel_env.house.robot_config", "gavel_env.render"),
    ),
    "planning": (
        "The parts of the agents' pipeline, in its order.",
        (
            "gavel_agents.agent",
            "gavel_agents.methods",
            "gavel_agents.understanding",
            "gavel_agents.llm",
            "gavel_agents.rsn",
            "gavel_agents.beliefs.believed_graph",
            "gavel_agents.beliefs.belief",
            "gavel_agents.verification",
            "gavel_agents.edits.repair",
            "gavel_agents.ordering.cost",
            "gavel_agents.ordering.order",
        ),
    ),
    "errors": (
        "Every error about a user's input is a `GavelError`. It names the value, the place and the alternatives.",
        ("gavel_env.errors",),
    ),
}


def api_pages() -> dict[str, str]:
    """Return the pages of the API: directives that mkdocstrings fills from signatures and docstrings."""
    made = {}
    for name, (line, modules) in API.items():
        title = name if not modules else name.replace("_", " ").capitalize()
        body = "\n\n".join(_directives(module) for module in modules or (name,))
        made[f"reference/api/{name}.md"] = f"{MADE}# {title}\n\n{line}\n\n{body}\n"
    return made


def _directives(module: str) -> str:
    """Return a heading for a module and a directive for each of its public names that has a definition to show."""
    loaded = importlib.import_module(module)
    lines = [] if "." not in module else [f"## {module}\n\n{_first_paragraph(loaded)}"]
    for name in loaded.__all__:
        value = inspect.unwrap(getattr(loaded, name))  # of what is cached, the function
        if inspect.isclass(value) or inspect.isfunction(value):
            lines.append(f"::: {value.__module__}.{value.__qualname__}\n    options: {{ heading_level: 3 }}")
    return "\n\n".join(lines)


def _first_paragraph(module: Any) -> str:
    return (inspect.getdoc(module) or "").partition("\n\n")[0]


# --- MkDocs ----------------------------------------------------------------------------------------------------------


def pages() -> dict[str, str]:
    """Return every page and file that is made, by its path in docs."""
    made = {
        "reference/commands.md": commands_page(),
        "reference/actions.md": actions_page(),
        "reference/schemas.md": schemas_page(),
        **api_pages(),
    }
    for name, (_, kind) in schemas().items():
        made[f"reference/schemas/{name}.schema.json"] = schema_text(kind)
    return made


def on_files(files: Any, config: Any) -> Any:
    """Add the pages to the site (a hook of MkDocs)."""
    from mkdocs.structure.files import File

    os.environ["COLUMNS"] = "88"  # width of usage lines
    for path, content in pages().items():
        files.append(File.generated(config, path, content=content))
    return files
