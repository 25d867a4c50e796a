"""The project as a whole: packages import lightly, the command line answers, the pieces agree with one another."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from support.commands import commands_of

from eval.cli import build_parser, main

ROOT = Path(__file__).parent.parent


def run_python(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, cwd=ROOT, check=False)


@pytest.mark.parametrize(
    ("statement", "heavy"),
    [
        ("import gavel_env", ["gavel_agents", "eval", "torch", "pandas", "matplotlib", "numba", "cv2", "openai"]),
        (
            "import gavel_agents",
            ["eval", "gavel_env.envs.env", "gavel_env.sim.executor", "gavel_env.sim.sensor", "torch"],
        ),
        ("from eval.cli import build_parser; build_parser()", ["pandas", "numba", "cv2", "torch", "rich"]),
    ],
)
def test_import_stays_light(statement: str, heavy: list[str]) -> None:
    code = f"import sys; {statement}; print([m for m in {heavy!r} if m in sys.modules])"
    result = run_python("-c", code)
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip() == "[]"


def test_house_order_of_imports() -> None:
    """gavel_env <- gavel_agents <- eval: nobody imports the packages to the right of its own."""
    forbidden = {"gavel_env": ("gavel_agents", "eval"), "gavel_agents": ("eval",)}
    for package, others in forbidden.items():
        for path in sorted((ROOT / package).rglob("*.py")):
            found = re.findall(rf"^\s*(?:from|import)\s+({'|'.join(others)})\b", path.read_text("utf-8"), re.MULTILINE)
            assert not found, f"{path.relative_to(ROOT)} imports {found[0]}"


def test_python_dash_m_eval_is_the_console_script() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert project["scripts"]["gavel"] == "gavel_eval:main"
    result = run_python("-m", "eval", "--help")
    assert result.returncode == 0
    assert "scenes" in result.stdout


def test_unknown_command_exits_2_and_lists_the_known(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["scnes"])
    assert stopped.value.code == 2
    assert "scenes" in capsys.readouterr().err


COMMANDS = {parser.prog: parser for parser in commands_of(build_parser())}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_and_something_to_run(name: str) -> None:
    assert callable(COMMANDS[name].get_default("run"))
    assert name.rsplit(maxsplit=1)[-1] in COMMANDS[name].format_help()


def test_every_requirement_is_pinned() -> None:
    """constraints.txt pins each requirement of the core and of dev, data and docs."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    extras = project["optional-dependencies"]
    wanted = [*project["dependencies"], *extras["dev"], *extras["data"], *extras["docs"]]
    names = {re.split(r"[<>=\[ ]", requirement)[0].lower() for requirement in wanted} - {"gavel-env"}
    pinned = dict(re.findall(r"^([\w.-]+)==(\S+)$", (ROOT / "constraints.txt").read_text("utf-8"), re.MULTILINE))
    assert names <= {name.lower().replace("_", "-") for name in pinned}
    assert pinned["bddl"] == "3.6.0"


def test_ci_runs_the_readme_test_command() -> None:
    assert re.search(r"^\$ make test\b", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE)
    assert re.search(r"^make test\b", (ROOT / ".ci" / "run").read_text("utf-8"), re.MULTILINE)


def test_readme_shows_pictures_that_exist() -> None:
    pictures = re.findall(r"!\[[^]]*\]\(([^)]+)\)", (ROOT / "README.md").read_text("utf-8"))
    assert pictures
    for picture in pictures:
        assert (ROOT / picture).is_file(), picture


PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]


@pytest.mark.parametrize(
    "page", [page for page in PAGES if "```python" in page.read_text("utf-8")], ids=lambda p: p.name
)
def test_python_in_readme_and_docs_runs(page: Path, tmp_path: Path) -> None:
    """The blocks of a page are run in their order, as one program, in an empty folder."""
    blocks = re.findall(r"^```python\n(.*?)^```", page.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    program = "\n".join(blocks)
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, cwd=tmp_path, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_commands_in_readme_and_docs_exist(page: Path) -> None:
    """Every `$ gavel ...` line parses, and every `$ make ...` line names a target."""
    targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
    for line in re.findall(r"^\$ (.+)$", page.read_text("utf-8").replace("\\\n", ""), re.MULTILINE):
        program, *arguments = shlex.split(line, comments=True)
        if program == "make":
            assert arguments[0] in targets, line
        elif program == "gavel":
            build_parser().parse_args(arguments)


def test_notebooks_are_their_pages_and_run(tmp_path: Path) -> None:
    """The pages themselves are run above; a notebook holds the same blocks in the same order."""
    assert run_python("docs/notebooks.py", "--check").returncode == 0
    for path in (ROOT / "docs" / "tutorial").glob("*.ipynb"):
        cells = json.loads(path.read_text("utf-8"))["cells"]
        code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
        page = path.with_suffix(".md").read_text("utf-8")
        assert code == [
            block.strip("\n") for block in re.findall(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
        ]
        assert len(code) >= 4
