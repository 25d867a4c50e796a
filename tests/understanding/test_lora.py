"""Training an adapter: what is learned, and that a killed run ends where an undisturbed one does."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest.importorskip("torch")
pytest.importorskip("transformers")
pytest.importorskip("peft")

import safetensors.numpy
from support.tiny_transformer import tiny_model

from gavel_agents.llm import BadPlannerSpec
from gavel_agents.llm.service import ModelError
from gavel_agents.understanding import load_understanding
from gavel_agents.understanding.lora import LoraSettings, fit_lora
from gavel_agents.understanding.pairs import read_samples
from gavel_agents.understanding.train import main
from gavel_env.errors import DataError

pytestmark = pytest.mark.filterwarnings("ignore::FutureWarning", "ignore::UserWarning")

PAIRS = [sample for sample in read_samples("validation") if len(sample.text) < 60][:6]


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tiny_model(tmp_path_factory.mktemp("base") / "tiny-chat", context=1024)


def weights(folder: Path) -> dict[str, bytes]:
    tensors = safetensors.numpy.load_file(folder / "adapter_model.safetensors")
    return {name: tensor.tobytes() for name, tensor in tensors.items()}


class Killed(Exception):
    """The run is over before its time."""


def test_a_killed_run_goes_on_to_the_same_adapter(base: Path, tmp_path: Path) -> None:
    settings = LoraSettings(str(base), epochs=10, batch=3, rank=2, learning_rate=1e-2)
    assert fit_lora(PAIRS, tmp_path / "whole", settings) == 20

    def kill(line: str) -> None:
        if line.startswith("[10/20]"):
            raise Killed

    with pytest.raises(Killed):
        fit_lora(PAIRS, tmp_path / "killed", settings, checkpoint_every=4, report=kill)
    assert not (tmp_path / "killed" / "adapter_config.json").exists()
    with pytest.raises(DataError, match="other settings"):
        fit_lora(PAIRS[:3], tmp_path / "killed", settings)
    said: list[str] = []
    fit_lora(PAIRS, tmp_path / "killed", settings, report=said.append)
    assert said[0] == "goes on after step 8 of 20"
    assert weights(tmp_path / "killed") == weights(tmp_path / "whole")
    assert not (tmp_path / "killed" / "checkpoint").exists()


def test_the_adapter_learns_says_its_base_and_answers(
    base: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pairs = tmp_path / "pairs.jsonl"
    shipped = Path(__file__).parents[2] / "envs_data" / "instructions" / "pairs" / "validation.jsonl"
    pairs.write_text("\n".join(shipped.read_text(encoding="utf-8").splitlines()[:8]), encoding="utf-8")
    monkeypatch.chdir(base.parent)
    arguments = ["--base", base.name, "--out", str(tmp_path / "adapter"), "--pairs", str(pairs)]
    assert main([*arguments, "--epochs", "15", "--batch", "4", "--rank", "4", "--learning-rate", "3e-2"]) == 0
    losses = [float(line.split()[2].rstrip(",")) for line in capsys.readouterr().out.splitlines() if "loss" in line]
    assert losses[-1] < 0.7 * losses[0]
    config = json.loads((tmp_path / "adapter" / "adapter_config.json").read_text(encoding="utf-8"))
    assert config["base_model_name_or_path"] == base.name
    assert str(tmp_path) not in (tmp_path / "adapter" / "adapter_config.json").read_text(encoding="utf-8")
    got = load_understanding(f"adapter:{tmp_path / 'adapter'}").understand("Put the mug on the desk.")
    assert got.asked is not None
    assert got.asked.completion_tokens > 0
    assert bool(got.tasks) != bool(got.refused)


def test_a_base_that_cannot_be_had_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises((ModelError, BadPlannerSpec), match="nowhere"):
        fit_lora(PAIRS, tmp_path, LoraSettings(str(tmp_path / "nowhere")))
    assert main(["--base", str(tmp_path / "nowhere"), "--out", str(tmp_path)]) == 2
    assert "nowhere" in capsys.readouterr().err
