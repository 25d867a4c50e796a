"""How well the priors know where the movables of a benchmark start: those whose place the instruction leaves unsaid.

The other evaluation (`eval.studies.beliefs`) asks for the rooms of bddl's scenes, which are mostly furniture. Movables
are placed by the benchmark, after what BEHAVIOR's activities do (`gavel_env.tasks.placements`). A query is such a
movable of an instruction; the belief is B_0 before anything is seen, over the rooms that the robot can enter.
`generator` is the distribution that the starts are drawn from, as far as an errand asks for nothing else: what a prior
could know.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eval.studies.beliefs import Answer, Score, score
from gavel_agents.beliefs.belief import load_prior
from gavel_agents.beliefs.believed_graph import believed_graph, uncertain
from gavel_agents.beliefs.narrowing import narrow
from gavel_agents.rsn import LocationPrior
from gavel_agents.rsn.data import RoomInfo
from gavel_agents.understanding import ReferenceUnderstanding
from gavel_env.house.floor_map import known_layout
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.record import Instruction
from gavel_env.tasks.generator import Knobs
from gavel_env.tasks.placements import load_house
from gavel_env.world_model.ontology import default_ontology

__all__ = ["PRIORS", "Unsaid", "evaluate_movables", "unsaid_movables"]

PRIORS = ("uniform", "rsn", "choice")


class Unsaid(NamedTuple):
    """A movable whose place an instruction leaves unsaid.

    Attributes:
        category: of the movable.
        scene: where the instruction plays.
        rooms: those that the robot can enter.
        room: position of its room among them.
    """

    category: str
    scene: str
    rooms: tuple[RoomInfo, ...]
    room: int


def unsaid_movables(instructions: Iterable[Instruction]) -> Iterator[Unsaid]:
    """Yield every movable that is asked for, whose room follows from nothing that is said, and that is one of its kind.

    One that starts in a room that cannot be entered is left out.
    """
    ontology = default_ontology()
    for instruction in instructions:
        scene = load_scene(instruction.scene)
        layout = known_layout(scene)
        rooms = tuple(
            RoomInfo(room.id, room.type, room.area_m2)
            for room in layout.scene.rooms
            if layout.room_points[room.id] is not None
        )
        hidden = instruction_graph(scene, instruction)
        world = hidden.world
        understood = ReferenceUnderstanding([instruction]).understand(instruction.text, rooms=world.rooms)
        tasks, kinds = narrow(understood.tasks, world.rooms, ontology)
        believed = believed_graph(world.rooms, world.connections, tasks, ontology, None, kinds)
        index = {room.id: i for i, room in enumerate(rooms)}
        for node in uncertain(believed):
            entry = believed.world.nodes[node]
            instances = world.by_category.get(entry.category.name, ())
            if entry.fixed or entry.stated_room is not None or len(instances) != 1:
                continue
            room = hidden.room_of(instances[0])
            if room in index:
                yield Unsaid(entry.category.name, instruction.scene, rooms, index[room])


def evaluate_movables(instructions: Iterable[Instruction], folder: Path | None = None) -> list[Score]:
    """Score the priors, and the distribution that the starts are drawn from.

    Args:
        instructions: whose movables are asked for.
        folder: weights of the priors; default the shipped ones.

    Raises:
        ValueError: no instruction leaves the place of a movable unsaid.
    """
    models: Mapping[str, LocationPrior] = {name: load_prior(name, folder) for name in PRIORS}
    answers: dict[str, list[Answer]] = {name: [] for name in (*PRIORS, "generator")}
    for query in unsaid_movables(instructions):
        for name, prior in models.items():
            belief = np.asarray(prior(query.category, query.rooms), np.float64)
            answers[name].append(Answer(belief / belief.sum(), query.room))
        answers["generator"].append(Answer(_generator(query), query.room))
    return [score(name, given) for name, given in answers.items()]


def _generator(query: Unsaid) -> NDArray[np.float64]:
    """Return (rooms,) the chance that the movable starts in each room; in the open, since nothing is said of it."""
    house = load_house(query.scene)
    places, weights = house.places(query.category)
    index = {room.id: i for i, room in enumerate(query.rooms)}
    likely, anywhere = np.zeros(len(index)), np.zeros(len(index))
    for place, weight in zip(places, weights, strict=True):
        if place.room in index and weight > 0.0 and not house.shuts(place):
            likely[index[place.room]] += weight
            anywhere[index[place.room]] += place.relation == "on"
    surprise = Knobs().surprise if anywhere.any() else 0.0
    chance: NDArray[np.float64] = (1.0 - surprise) * likely / likely.sum()
    return chance + surprise * anywhere / max(1.0, float(anywhere.sum()))
