"""Models of the transformers library, through the same loading path, on a tiny model made here."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from support.tiny_transformer import tiny_model

pytest.importorskip("torch")
pytest.importorskip("transformers")
pytest.importorskip("peft")

import peft
import torch
import transformers

from gavel_agents.llm import BadPlannerSpec, Message, Prompt, load_model
from gavel_agents.llm.hf import HfModel
from gavel_agents.llm.sampling import Sampler
from gavel_agents.llm.service import ModelError
from gavel_agents.llm.thinking import without_thinking
from gavel_env.instructions.lookup import About

# The libraries warn about each other's deprecations.
pytestmark = pytest.mark.filterwarnings("ignore::FutureWarning")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tiny_model(tmp_path_factory.mktemp("tiny") / "tiny-chat")


@pytest.fixture(scope="module")
def model(folder: Path) -> HfModel:
    loaded = load_model(f"hf:{folder}?batch=3&max_tokens=12")
    assert isinstance(loaded, HfModel)
    return loaded


def prompts(*texts: str) -> list[Prompt]:
    return [Prompt((Message("system", "plan"), Message("user", text)), About(text)) for text in texts]


SAID = ("put it in", "the apple", "a", "put the apple on the table and then the fridge", "on", "1 2 3", "then")


def test_a_batch_answers_as_one_prompt_at_a_time(model: HfModel) -> None:
    together = model.complete(prompts(*SAID))
    alone = [model.complete([prompt])[0] for prompt in prompts(*SAID)]
    assert [c.text for c in together] == [c.text for c in alone]
    assert len({c.text for c in together}) > 1
    assert [c.prompt_tokens for c in together] == [len(model.render(p)) for p in prompts(*SAID)]
    assert all(0 < c.completion_tokens <= 12 and c.seconds > 0 for c in together)


def test_greedy_answers_repeat(model: HfModel) -> None:
    assert model.complete(prompts("the apple"))[0].text == model.complete(prompts("the apple"))[0].text


def test_samples_follow_their_own_seed_alone(folder: Path) -> None:
    model = load_model(f"hf:{folder}?batch=3&max_tokens=12&temperature=1.5")
    asked = [Prompt(p.messages, seed=i % 4) for i, p in enumerate(prompts(*["the apple"] * 8))]
    together = [c.text for c in model.complete(asked)]
    alone = [model.complete([prompt])[0].text for prompt in reversed(asked)]
    assert together == alone[::-1]
    assert together[:4] == together[4:]
    assert len(set(together)) > 1


def test_samples_are_distributed_as_the_model_says() -> None:
    logits = torch.log(torch.tensor([[0.5, 0.3, 0.2, 0.0]])).repeat(4000, 1)
    sampler = Sampler([{"temperature": 1.0, "seed": seed} for seed in range(4000)], "cpu")
    shares = torch.bincount(sampler(None, logits).argmax(dim=1), minlength=4) / 4000
    assert torch.allclose(shares, torch.tensor([0.5, 0.3, 0.2, 0.0]), atol=0.04)
    greedy = Sampler([{"temperature": 0.0}], "cpu")
    assert torch.equal(greedy(None, logits[:1]), logits[:1])


def test_own_template_with_thinking_switched_off(model: HfModel) -> None:
    [prompt] = prompts("hello")
    assert model.render(prompt) == "<system>plan\n<user>hello\n<assistant><nothink>"


def test_name_and_decoding_for_records(model: HfModel) -> None:
    assert model.name == "tiny-chat"
    assert dict(model.decoding) == {"max_tokens": 12, "temperature": 0.0, "weights": "float32"}


@pytest.mark.parametrize(
    ("said", "left"),
    [
        ("<think>fridge?</think>GRASP apple", "GRASP apple"),
        ("still thinking</think>\nGRASP apple", "GRASP apple"),
        ("GRASP apple <think>never ends", "GRASP apple"),
        ("GRASP apple", "GRASP apple"),
    ],
)
def test_thinking_is_stripped(said: str, left: str) -> None:
    assert without_thinking(said) == left


def test_adapter_changes_the_answers(folder: Path, model: HfModel, tmp_path: Path) -> None:
    base: Any = transformers.AutoModelForCausalLM.from_pretrained(folder)
    torch.manual_seed(1)
    config = peft.LoraConfig(r=4, target_modules=["q_proj", "v_proj"], init_lora_weights=False, task_type="CAUSAL_LM")
    peft.get_peft_model(base, config).save_pretrained(str(tmp_path / "tuned"))
    tuned = load_model(f"hf:{folder}?adapter={tmp_path / 'tuned'}&max_tokens=12")
    assert tuned.name == "tiny-chat+tuned"
    before = [c.text for c in model.complete(prompts(*SAID))]
    assert [c.text for c in tuned.complete(prompts(*SAID))] != before


def test_prompt_longer_than_the_context_is_said(model: HfModel) -> None:
    with pytest.raises(
        ModelError, match=r"the prompt of 'apple apple .*' has \d+ tokens; with 12 new ones that is more than .* 256"
    ):
        model.complete(prompts("apple " * 60))


def test_what_cannot_be_loaded_is_said(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="cannot be loaded"):
        load_model(f"hf:{tmp_path / 'nothing-here'}")
    with pytest.raises(ModelError, match="cannot be loaded"):
        load_model(f"hf:{folder}?adapter={tmp_path / 'nothing-here'}")
    with pytest.raises(BadPlannerSpec, match="known: batch, max_tokens, temperature, adapter, quantize"):
        load_model(f"hf:{folder}?speed=high")
    with pytest.raises(BadPlannerSpec, match="batch is 'many'"):
        load_model(f"hf:{folder}?batch=many")
    with pytest.raises(BadPlannerSpec, match="has no chat template"):
        load_model(f"hf:{tiny_model(tmp_path / 'base', template=None)}")
    if not torch.cuda.is_available():
        with pytest.raises(BadPlannerSpec, match="4 bits need a CUDA device"):
            load_model(f"hf:{folder}?quantize=4bit")


SCHEMA = {
    "type": "object",
    "properties": {"n": {"enum": [1, 2]}},
    "required": ["n"],
    "additionalProperties": False,
}


def test_prompts_with_a_schema_are_answered_in_its_form_beside_others(model: HfModel) -> None:
    pytest.importorskip("llguidance")
    free = prompts("the apple", "on")
    held = [Prompt(prompt.messages, schema=SCHEMA) for prompt in free]
    mixed = model.complete([free[0], held[1]])
    assert all(json.loads(answer.text)["n"] in (1, 2) for answer in model.complete(held))
    assert mixed[1].text == model.complete(held)[1].text
    assert mixed[0].text == model.complete(free)[0].text
    with pytest.raises(ModelError, match="schema"):
        model.complete([Prompt(free[0].messages, schema={"type": "no such type"})])
