"""`run_sentence`: understand a sentence, make a house ready for it, plan, verify, repair, drive."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import gavel_agents
from eval.records.schema import EpisodeRecord
from eval.sentence.drive import Drive, Understood, drive
from eval.sentence.staging import Put, Staged, stage
from gavel_agents.llm import ChatModel, load_model
from gavel_agents.methods import METHODS
from gavel_agents.pipeline import PlanningAgent
from gavel_agents.understanding import Abstention, Decomposition, Question, Understanding, load_understanding
from gavel_agents.verification import Verified, verify_on_graph
from gavel_env.errors import BadOption
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import scene_graph

__all__ = ["MOST_QUESTIONS", "Ask", "SentenceRun", "run_sentence", "understand"]

MOST_QUESTIONS = 5
"""Questions about one sentence before it is given up."""

Ask = Callable[[Question], str | None]
"""Answers a question, or returns None to leave it unanswered."""


class SentenceRun(NamedTuple):
    """What came of a sentence.

    Attributes:
        text: the sentence.
        scene: name of the scene.
        seed: of the places that were drawn.
        understood: tasks, what was passed over, and notes.
        answers: questions that were asked, by their keys, with their answers.
        staged: where things were put, and what was taken for granted.
        driven: the episode: record, beliefs, graphs at start and end, and what each step showed.
    """

    text: str
    scene: str
    seed: int
    understood: Decomposition
    answers: Mapping[str, str]
    staged: Staged
    driven: Drive

    @property
    def record(self) -> EpisodeRecord:
        """The episode's record, as `gavel eval` writes them."""
        return self.driven.record

    @property
    def success(self) -> bool:
        """Whether the sentence was carried out: no violation, goal met, everything safe."""
        return self.record.success

    @property
    def put(self) -> tuple[Put, ...]:
        """Where things were put before the robot began."""
        return self.staged.put

    def verify(self, plan: str | Sequence[str]) -> Verified:
        """Check (and repair) another plan for the same sentence in the same house, as it stood at the start."""
        return verify_on_graph(self.driven.start, self.staged.instruction.goal(), plan)

    def html(self) -> str:
        """Return the replay as one HTML file."""
        from eval.sentence.pictures import replay

        return replay(self)

    def save(
        self, *, html: str | Path | None = None, png: str | Path | None = None, gif: str | Path | None = None
    ) -> None:
        """Write the replay (one HTML file), the picture of the whole drive, or the drive as an animation.

        Raises:
            DataError: a file cannot be written.
        """
        from eval.sentence.pictures import save

        save(self, html=html, png=png, gif=gif)


def understand(
    text: str,
    scene: str,
    *,
    understanding: Understanding | str = "rules",
    answers: Mapping[str, str] | None = None,
    ask: Ask | None = None,
    model: ChatModel | None = None,
) -> tuple[Decomposition, dict[str, str]]:
    """Return what a sentence asks for in a house whose rooms are known, and the answers that it took.

    Args:
        text: the sentence.
        scene: name of a scene, or path of a scene file.
        understanding: who understands.
        answers: to questions that are known to come.
        ask: answers the others.
        model: the language model that understanding `llm` asks.

    Raises:
        Abstention: says what is not understood; its `question` is what one would have to know.
        UnknownScene, SceneError: the scene cannot be read.
    """
    reader = load_understanding(understanding, (), model) if isinstance(understanding, str) else understanding
    rooms = scene_graph(load_scene(scene)).world.rooms
    known = dict(answers or {})
    for _ in range(MOST_QUESTIONS + 1):
        found = reader.understand(text, rooms=rooms, answers=known)
        if found.tasks:
            return found, known
        answer = ask(found.question) if found.question is not None and ask is not None else None
        if found.question is None or not answer:
            break
        known[found.question.key] = answer
    kind, _, detail = found.refused.partition(": ")
    raise Abstention(kind, detail, found.question)


def run_sentence(
    text: str,
    scene: str = "Beechwood_0_int",
    *,
    seed: int = 0,
    place: Sequence[str] = (),
    agent: str = "gavel-full",
    planner: str = "classical",
    understanding: Understanding | str = "rules",
    prior: str = "choice",
    answers: Mapping[str, str] | None = None,
    ask: Ask | None = None,
) -> SentenceRun:
    """Carry a sentence out in a house, and return everything that came of it.

    The things that the sentence speaks of are put somewhere plausible first: where it says, where `place` says, and
    else after the evidence that the task generator uses.

    Args:
        text: what a person says.
        scene: name of a scene, or path of a scene file.
        seed: of the places that are drawn.
        place: where things are, such as `mug on desk@private_office`.
        agent: a planning method: `gavel-full`, `llm-only`, ….
        planner: spec of its planner: `classical`, `openai:MODEL@URL`, ….
        understanding: an `Understanding` or its name, `rules`, `adapter:FOLDER`, `llm`.
        prior: location prior, `choice`, `rsn` or `uniform`.
        answers: to questions that are known to come, by their keys.
        ask: answers the others; without it an open question raises.

    Raises:
        Abstention: says what is not understood; its `question` is what one would have to know.
        NotInHouse: the house lacks something that the sentence needs.
        BadPlacement: a place in `place` cannot be read, or nothing can be put there.
        BadOption: the agent is not one of the planning methods.
        GavelError: unknown scene, agent, planner, understanding or prior.
    """
    if agent not in gavel_agents.agent_names() and agent != "gavel":
        gavel_agents.make(agent)  # raises, with the nearest names
    name = "gavel-full" if agent == "gavel" else agent
    if name not in METHODS:
        raise BadOption(f"agent {agent!r} is not one of the planning methods: {', '.join(METHODS)}")
    model = load_model(planner)
    found, known = understand(text, scene, understanding=understanding, answers=answers, ask=ask, model=model)
    staged = stage(text, scene, found.tasks, seed=seed, places=place)
    made = gavel_agents.make(
        name, understanding=Understood(staged.tasks), planner=model, prior=prior, on_surprise="next", seed=seed
    )
    assert isinstance(made, PlanningAgent)
    driven = drive(staged.instruction, made, model, planner=planner, prior=prior, seed=seed)
    return SentenceRun(text, staged.instruction.scene, seed, found, known, staged, driven)
