"""Texts that are almost instructions, and the house that they are believed in."""

from __future__ import annotations

import random
from collections.abc import Sequence

from gavel_agents.beliefs.believed_graph import believed_graph
from gavel_agents.understanding import TaskUnderstanding
from gavel_agents.understanding.rules.nouns import known_nouns
from gavel_agents.understanding.rules.words import closed_words
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import scene_graph
from gavel_env.world_model.ontology import default_ontology

HOUSE = scene_graph(load_scene("Beechwood_0_int")).world

_WORDS = sorted({" ".join(words) for words in (*known_nouns(), *closed_words())})


def believe(tasks: Sequence[TaskUnderstanding]) -> None:
    believed_graph(HOUSE.rooms, HOUSE.connections, tasks, default_ontology(), next(iter(HOUSE.rooms)))


def salad(rng: random.Random) -> str:
    """Return known words in any order: what trips a grammar, unlike noise, which its lexer refuses."""
    words = [
        rng.choice(_WORDS) if rng.random() < 0.75 else rng.choice((",", ".", ";", ":", "the", "it", "put", "on", "and"))
        for _ in range(rng.randint(1, 14))
    ]
    return " ".join(words)


def broken_sentence(rng: random.Random, sentences: list[str]) -> str:
    """Return a sentence of the benchmarks with words dropped, doubled, moved, replaced or cut in two."""
    words = rng.choice(sentences).split()
    for _ in range(rng.randint(1, 4)):
        i, j = rng.randrange(len(words)), rng.randrange(len(words))
        match rng.randrange(5):
            case 0 if len(words) > 1:
                del words[i]
            case 1:
                words.insert(i, words[j])
            case 2:
                words[i], words[j] = words[j], words[i]
            case 3:
                words[i] = rng.choice(_WORDS)
            case _:
                words = words[: i + 1]
    return " ".join(words)
