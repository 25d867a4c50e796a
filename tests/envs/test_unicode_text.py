"""The space of instruction texts holds whatever people write, in every kind of vector environment."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import msgspec
import pytest
from gymnasium.spaces.utils import flatten, flatten_space, unflatten
from support.houses import INSTRUCTIONS

import gavel_env  # noqa: F401  (registers the environments)
from gavel_env.envs.unicode_text import UnicodeText

TEXTS = ("", "Put the mug 😴 away", "把杯子放进洗碗机", "ضع الكوب في الغسالة", "café\n→ done\t…", "a" * 64)
RECORD = next(iter(INSTRUCTIONS.values()))


@pytest.mark.parametrize("text", TEXTS)
def test_any_text_is_in_the_space_and_survives_flattening(text: str) -> None:
    space = UnicodeText(64)
    assert text in space
    flat = flatten(space, text)
    assert flat in flatten_space(space)
    assert unflatten(space, flat) == text


@pytest.mark.parametrize("text", ["a" * 65, "half \ud83d of one", 3, None])
def test_what_cannot_be_written_is_not(text: Any) -> None:
    assert text not in UnicodeText(64)


def test_samples_are_in_the_space_and_depend_on_the_seed_alone() -> None:
    one, other = UnicodeText(200, seed=3), UnicodeText(200, seed=3)
    samples = [one.sample() for _ in range(20)]
    assert samples == [other.sample() for _ in range(20)]
    assert all(sample in one for sample in samples)
    assert one == other
    assert one != UnicodeText(201)


def test_an_environment_tells_what_people_wrote_alone_and_in_vectors() -> None:
    text = TEXTS[1]
    said: dict[str, Any] = {"instructions": [{**_plain(RECORD), "text": text}], "observation": "symbolic"}
    observation, _ = gym.make("Gavel-SingleTask-v0", **said).reset(seed=0)
    assert observation["instruction"] == text
    # With shared memory, Gymnasium 1.x hands out the texts that were there when the vector environment was made.
    for kind, how in (("sync", {}), ("async", {"shared_memory": False})):
        many = gym.make_vec("Gavel-SingleTask-v0", num_envs=2, vectorization_mode=kind, vector_kwargs=how, **said)
        observations, _ = many.reset(seed=0)
        assert tuple(observations["instruction"]) == (text, text)
        many.close()


def _plain(record: Any) -> dict[str, Any]:
    return dict(msgspec.to_builtins(record))
