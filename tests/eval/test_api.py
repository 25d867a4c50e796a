"""`eval.evaluate` from Python, and `gavel_eval` where another eval.py lies in the way."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import eval as gavel_eval_package
from eval import Results, evaluate
from gavel_agents.agent import AgentTrace
from gavel_env.errors import BadOption, DataError, UnknownAgent
from gavel_env.exchange import EnvAction
from gavel_env.instructions.record import read_instructions, shipped

ROOT = Path(__file__).parents[2]
CONFERRED = ("cooked", "washed", "dried")  # states that epog cannot plan for
SINGLE = read_instructions(shipped("single")).values()
FEW = [one for one in SINGLE if not any(state in str(one.goal()) for state in CONFERRED)][:3]


class GivesUp:
    """Does nothing at all."""

    name = "gives-up"

    def __init__(self) -> None:
        self.trace = AgentTrace()

    def reset(self, observation: Any, info: dict[str, Any]) -> None: ...

    def act(self, observation: Any, info: dict[str, Any]) -> EnvAction | None:
        return None


def test_own_classes_and_names_are_compared_on_instructions_given_as_objects(tmp_path: Path) -> None:
    found = evaluate([GivesUp, "epog", "oracle"], FEW, out=tmp_path)
    assert found.success() == {"gives-up": 0.0, "epog": 1.0, "oracle": 1.0}
    assert sum(found.failures()["gives-up"].values()) == 3
    assert found.path == tmp_path / "records.jsonl"
    assert "gives-up" in str(found)
    assert Results(tmp_path).render("csv") == found.render("csv")
    frame = pytest.importorskip("pandas") and found.dataframe()
    assert len(frame) == 9
    assert frame[frame.agent == "oracle"].success.all()


def test_a_shipped_file_has_its_recording_as_default_planner(tmp_path: Path) -> None:
    found = evaluate("gavel-full", "single", limit=2, out=tmp_path)
    assert {record.contestant.planner for record in found.records} == {"replay:single"}
    assert len(found.records) == 2


def test_wrong_use_is_said(tmp_path: Path) -> None:
    with pytest.raises(UnknownAgent, match="'oracle'"):
        evaluate("oracel", FEW)
    with pytest.raises(BadOption, match="workers=1"):
        evaluate(GivesUp, FEW, workers=2)
    evaluate("oracle", FEW[:1], out=tmp_path)
    with pytest.raises(DataError, match="records already"):
        evaluate("oracle", FEW[:1], out=tmp_path)


def run_beside_another_eval(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    (folder / "eval.py").write_text("print('the other one')\nanswer = 42\n")
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_gavel_eval_loads_the_package_beside_a_script_called_eval(tmp_path: Path) -> None:
    done = run_beside_another_eval(
        tmp_path, "-c", "import gavel_eval, eval; print(gavel_eval.evaluate is eval.evaluate, eval.__file__)"
    )
    assert done.stdout.split() == ["True", str(ROOT / "eval" / "__init__.py")], done.stderr
    done = run_beside_another_eval(tmp_path, "-c", "import gavel_eval; gavel_eval.main()")
    assert "the other one" not in done.stdout
    assert "gavel" in done.stderr + done.stdout


def test_gavel_eval_says_so_if_the_other_one_was_imported_first(tmp_path: Path) -> None:
    done = run_beside_another_eval(tmp_path, "-c", "import eval; import gavel_eval")
    assert done.returncode == 1
    assert f"has been imported from {tmp_path / 'eval.py'}" in done.stderr


def test_the_alias_is_the_package() -> None:
    import gavel_eval

    assert gavel_eval.Results is gavel_eval_package.Results
    with pytest.raises(AttributeError):
        gavel_eval.nothing  # noqa: B018
