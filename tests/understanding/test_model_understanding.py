"""Understanding by a language model: what it answers is read with distrust, and only what the text says is believed."""

from __future__ import annotations

import json
import random
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import jsonschema
import pytest
from support.broken_text import believe

import gavel_agents
from eval.studies.understanding import evaluate
from gavel_agents.llm import Completion, Prompt
from gavel_agents.understanding import Abstention, ModelUnderstanding, UnknownUnderstanding, load_understanding
from gavel_agents.understanding.answer import answer_schema, read_answer, write_answer
from gavel_agents.understanding.chat import EXAMPLES, chat_prompt
from gavel_agents.understanding.mentions import Mentions
from gavel_agents.understanding.pairs import Sample, read_samples
from gavel_env.errors import DataError
from gavel_env.instructions.record import read_instructions, shipped

TEXT = "Get the potato out of the fridge in the kitchen and put it on the coffee table. Then wash the mug."


class Said:
    """A model that has an answer for every text."""

    name = "said"
    decoding: Mapping[str, str | float | int] = {}

    def __init__(self, answers: Mapping[str, str]) -> None:
        self.answers = answers
        self.asked: list[Prompt] = []

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        self.asked += prompts
        return [Completion(self.answers[p.messages[-1].content], 10, 5, 2.5) for p in prompts]


def answer(*goal: str, relations: Sequence[str] = (), objects: Sequence[str] = ()) -> str:
    return json.dumps({"tasks": [{"relations": relations, "objects": objects, "goal": goal}]})


@pytest.mark.parametrize("file", ["validation", "single", "multi"])
def test_answers_say_all_that_targets_do(file: str) -> None:
    samples = read_samples(file)
    model = Said({sample.text: write_answer(sample.tasks) for sample in samples})
    report = evaluate(ModelUnderstanding("said", model, trained=True), samples)
    assert report.exact == report.instructions
    assert report.parts["tasks"].exact == report.instructions


def test_a_task_has_the_words_between_its_start_and_the_next() -> None:
    said = {"tasks": [{"start": "get the potato", "goal": ["on_top(potato, coffee_table)"]},
                      {"start": "wash the mug", "goal": ["washed(mug)"]}]}  # fmt: skip
    first, second = read_answer(json.dumps(said), TEXT).tasks
    assert first.text.startswith("Get the potato out of")
    assert second.text == "wash the mug."
    lost = {"tasks": [said["tasks"][0], {**said["tasks"][1], "start": "polish"}]}
    assert [task.text for task in read_answer(json.dumps(lost), TEXT).tasks] == [TEXT, TEXT]


def test_names_may_be_written_as_the_text_says_them() -> None:
    text = "Put the teddy bear that's in the lounge into the fridge in the kitchen and the mug on the bookshelf."
    said = answer(
        "inside(teddy bear, fridge@kitchen)", "on_top(Mug, bookshelf)", relations=["in_room(teddy bear, lounge)"]
    )
    [task] = read_answer(f"Sure! ```json\n{said}\n```", text).tasks
    assert task.goal.text() == ("inside(teddy_bear, fridge@kitchen)", "on_top(mug, bookcase)")
    assert [str(literal) for literal in task.relations] == ["in_room(teddy_bear, living_room)"]


@pytest.mark.parametrize(
    ("said", "reason"),
    [
        ("", "malformed"),
        ("I cannot help with that.", "malformed"),
        ('{"tasks": [{"goal": "cooked(potato)"}]}', "malformed"),
        ('{"tasks": [{"goal": ["cooked(potato)"]', "malformed"),
        (answer("potato on table"), "malformed"),
        (answer("cooked(potato, fridge)"), "malformed"),
        (answer("on_top(potato, coffee_table)", relations=["not inside(potato, fridge)"]), "malformed"),
        (answer("on_top(potato, coffee_table)", relations=["cooked(potato)"]), "malformed"),
        ('{"tasks": []}', "no_goal"),
        (answer(), "no_goal"),
        (answer("on_top(frobnicator, coffee_table)"), "unknown_name"),
        (answer("on_top(potato, coffee_table@dungeon)"), "unknown_name"),
        (answer("on_top(apple, coffee_table)"), "not_in_text"),
        (answer("on_top(potato, coffee_table@living_room)"), "not_in_text"),
        (answer("on_top(potato, coffee_table)", relations=["in_room(potato, bedroom)"]), "not_in_text"),
        (answer("on_top(potato, coffee_table)", objects=["oven"]), "not_in_text"),
        (answer("on_top(potato, coffee_table)", "inside(potato, fridge)"), "contradiction"),
        (answer("inside(mug, mug)"), "contradiction"),
        (answer("inside(potato, coffee_table)"), "cannot_hold"),
        (answer("on_top(fridge, coffee_table)"), "cannot_move"),
        (answer("toggled(mug)"), "cannot_switch"),
        (answer("open(potato)"), "cannot_open"),
        (answer("cooked(mug)"), "cannot_process"),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_refused_with_its_reason(said: str, reason: str) -> None:
    with pytest.raises(Abstention, match=rf"^{reason}: .") as refusal:
        read_answer(said, TEXT)
    assert refusal.value.kind == reason
    got = ModelUnderstanding("said", Said({TEXT: said}), trained=True).understand(TEXT)
    assert got.tasks == ()
    assert got.refused == str(refusal.value)


def test_a_vague_name_is_what_the_text_calls_so_or_refused() -> None:
    said = answer("on_top(mug, table)")
    [task] = read_answer(said, "Put the mug on the coffee table.").tasks
    assert task.goal.text() == ("on_top(mug, coffee_table)",)
    for text in ("Take the mug off the coffee table and put it on the breakfast table.", "Put the mug on the table."):
        with pytest.raises(Abstention, match=r"^ambiguous: 'table' may be any of breakfast_table, coffee_table"):
            read_answer(said, text)


def test_texts_are_asked_once_and_together() -> None:
    samples = read_samples("validation")[:6]
    model = Said({sample.text: write_answer(sample.tasks) for sample in samples})
    understanding = ModelUnderstanding("said", model, trained=True)
    texts = [sample.text for sample in samples]
    together = understanding.understand_all([*texts, *texts, " ", "a" * 5000, "Hello!"])
    assert [prompt.messages[-1].content for prompt in model.asked] == texts
    assert together[:6] == together[6:12] == [understanding.understand(text) for text in texts]
    assert len(model.asked) == 6
    assert [got.refused.partition(":")[0] for got in together[12:]] == ["empty", "too_long", "no_goal"]


def test_a_chat_model_is_shown_and_held_to_the_same_form() -> None:
    for text, tasks in EXAMPLES:
        said = {"tasks": tasks}
        jsonschema.validate(said, answer_schema(Mentions(text).phrases, Mentions(text).room_phrases))
        believe(read_answer(json.dumps(said), text).tasks)
    model = Said({TEXT: answer("washed(mug)")})
    assert load_understanding("llm", model=model).understand(TEXT).tasks
    [asked] = model.asked
    assert asked.messages == chat_prompt(TEXT)
    for name, valid in (("mug", True), ("coffee_table", True), ("coffee_table@kitchen", True), ("fork", False)):
        said = {"tasks": [{"start": "", "relations": [], "objects": [name], "goal": ["washed(mug)"]}]}
        assert jsonschema.Draft202012Validator(asked.schema).is_valid(said) is valid


@pytest.mark.parametrize("file", ["validation", "single", "multi"])
def test_an_adapter_is_held_to_what_the_text_speaks_of_and_can_say_every_target(file: str) -> None:
    for sample in read_samples(file):
        mentions = Mentions(sample.text)
        schema = answer_schema({name: [name] for name in mentions.categories}, mentions.rooms, brief=True)
        jsonschema.validate(json.loads(write_answer(sample.tasks)), schema)


def test_words_of_longer_nouns_speak_of_nothing_else() -> None:
    assert Mentions("Put the mug on the coffee table.").categories == ("coffee_table", "mug")
    assert Mentions("Lay it on the swivel chair.").categories == ("swivel_chair",)


def test_the_examples_are_not_of_the_benchmarks() -> None:
    known = {sample.text for file in ("single", "multi", "validation", "train") for sample in read_samples(file)}
    assert not known & {text for text, _ in EXAMPLES}


def test_what_a_model_was_asked_for_understanding_is_in_the_trace() -> None:
    instruction = next(iter(read_instructions(shipped("single")).values()))
    [sample] = [s for s in read_samples("single") if s.id == instruction.id]
    understanding = ModelUnderstanding("said", Said({sample.text: write_answer(sample.tasks)}), trained=True)
    env = gym.make("Gavel-SingleTask-v0", instructions=[instruction])
    for _ in range(2):
        agent: Any = gavel_agents.make("epog", understanding=understanding)
        agent.reset(*env.reset(seed=0))
        assert (agent.trace.prompt_tokens, agent.trace.completion_tokens) == (10, 5)
        assert agent.trace.seconds["understand"] == 2.5
    env.close()


def test_what_is_missing_is_said(tmp_path: Any) -> None:
    with pytest.raises(UnknownUnderstanding, match="add --planner"):
        load_understanding("llm")
    with pytest.raises(DataError, match=r"adapter_config\.json"):
        load_understanding(f"adapter:{tmp_path}")


def broken(rng: random.Random, samples: Sequence[Sample]) -> tuple[str, str]:
    """Return a text, and an answer to it or to another one, with parts cut, doubled or moved."""
    sample = rng.choice(samples)
    said = write_answer((sample if rng.random() < 0.7 else rng.choice(samples)).tasks)
    for _ in range(rng.randrange(4)):
        i, j = sorted(rng.randrange(len(said) + 1) for _ in range(2))
        said = rng.choice((said[:i] + said[j:], said[:j] + said[i:], said[:i] + chr(rng.randrange(0x2FF)) + said[i:]))
        said = said[:4000]
    return sample.text, said


def fuzz(count: int, seed: int) -> int:
    rng = random.Random(seed)
    samples = read_samples("multi")
    understood = 0
    for _ in range(count):
        text, said = broken(rng, samples)
        got = ModelUnderstanding("said", Said({text: said}), trained=True).understand(text)
        assert bool(got.tasks) != bool(got.refused)
        if got.tasks:
            understood += 1
            believe(got.tasks)
    return understood


def test_any_answer_is_believed_or_refused() -> None:
    assert fuzz(1_500, seed=0) > 200


@pytest.mark.slow
def test_a_hundred_thousand_answers_are_believed_or_refused() -> None:
    fuzz(100_000, seed=1)
