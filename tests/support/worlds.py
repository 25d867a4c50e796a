"""Small worlds for tests: written by hand, or drawn at random from a house."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import msgspec
import numpy as np

from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import scene_graph
from gavel_env.world_model.graph import Flag, Node, Relation, Room, SceneGraph, Support, World
from gavel_env.world_model.ontology import category_of, default_ontology

RELATIONS = {"on": Relation.ON_TOP, "in": Relation.INSIDE, "floor": Relation.FLOOR, "held": Relation.HELD}

KITCHEN = {
    "fridge_0": "floor kitchen_0",
    "oven_0": "floor kitchen_0",
    "microwave_0": "floor kitchen_0",
    "dishwasher_0": "floor kitchen_0",
    "stove_0": "floor kitchen_0",
    "countertop_0": "floor kitchen_0",
    "breakfast_table_0": "floor kitchen_0",
    "bookcase_0": "floor living_room_0",
    "washer_0": "floor living_room_0",
    "clothes_dryer_0": "floor living_room_0",
    "floor_lamp_0": "floor living_room_0",
    "apple_0": "on countertop_0",
    "steak_0": "in fridge_0",
    "bowl_0": "on breakfast_table_0",
    "backpack_0": "on breakfast_table_0",
    "textbook_0": "in backpack_0",
}


def build(
    places: Mapping[str, str],
    *,
    near: Iterable[str] = (),
    robot_room: str | None = None,
    flags: Mapping[str, Iterable[str]] | None = None,
    next_to: Iterable[tuple[str, str]] = (),
) -> SceneGraph:
    """Build a graph from `id -> "on|in|floor|held HOLDER"`; what cannot be lifted is fixed."""
    ontology = default_ontology()
    supports = {}
    contents: dict[str, list[str]] = {}
    rooms = {}
    for obj, place in places.items():
        relation, _, holder = place.partition(" ")
        supports[obj] = Support(RELATIONS[relation], holder or "robot")
        if relation == "floor":
            rooms[holder] = Room(holder, category_of(holder))
        elif relation in ("on", "in"):
            contents.setdefault(holder, []).append(obj)
    nodes = {o: Node(o, ontology[category_of(o)], not ontology[category_of(o)].graspable) for o in places}
    states = {name: frozenset(objects) for name, objects in (flags or {}).items()}
    return SceneGraph(
        world=World.of(rooms, frozenset(), nodes),
        supports=supports,
        contents={holder: tuple(sorted(items)) for holder, items in contents.items()},
        flags=tuple(states.pop(flag.name.lower(), frozenset()) for flag in Flag),
        near=frozenset(near),
        holding=next((o for o, s in supports.items() if s.relation is Relation.HELD), None),
        robot_room=robot_room,
        next_to=frozenset(next_to),
    )


def kitchen(moved: Mapping[str, str] | None = None, **state: object) -> SceneGraph:
    """Return the hand-written kitchen, with some objects moved; everything is near unless `near` says otherwise."""
    places = KITCHEN | dict(moved or {})
    state.setdefault("near", tuple(places))
    state.setdefault("robot_room", "kitchen_0")
    return build(places, **state)  # type: ignore[arg-type]


def opened(*objects: str, moved: dict[str, str] | None = None) -> SceneGraph:
    """Return the kitchen with these open."""
    return kitchen(moved, flags={"open": objects})


def restrict(graph: SceneGraph, keep: Iterable[str]) -> SceneGraph:
    """Return the part of a graph about some objects and what holds them up."""
    kept: set[str] = set()
    for obj in keep:
        kept.add(obj)
        kept.update(holder for _, holder in graph.holders(obj))
    nodes = {o: n for o, n in graph.world.nodes.items() if o in kept}
    contents = {h: tuple(o for o in items if o in kept) for h, items in graph.contents.items() if h in kept}
    return msgspec.structs.replace(
        graph,
        world=World.of(graph.world.rooms, graph.world.connections, nodes),
        supports={o: s for o, s in graph.supports.items() if o in kept},
        contents={h: items for h, items in contents.items() if items},
        flags=tuple(objects & kept for objects in graph.flags),
        near=graph.near & kept,
    )


def random_house_graph(house: str, rng: np.random.Generator, *, pieces: int = 9, movables: int = 9) -> SceneGraph:
    """Return a random part of a house with movables put at random: things with doors and switches are preferred."""
    ontology = default_ontology()
    graph = scene_graph(load_scene(house))
    names = sorted(graph.world.nodes)
    weights = np.array([_interest(graph, o) for o in names])
    chosen = rng.choice(names, size=min(pieces, len(names)), replace=False, p=weights / weights.sum())
    graph = restrict(graph, sorted(str(o) for o in chosen))
    pools = _pools()
    for index in range(movables):
        pool = pools[int(rng.integers(len(pools)))]
        category = ontology[pool[int(rng.integers(len(pool)))]]
        obj = f"{category.name}_{90 + index}"
        graph = graph.with_nodes({obj: Node(obj, category, False)}).place(obj, _random_support(graph, rng))
    flags = list(graph.flags)
    for flag, able in ((Flag.OPEN, "openable"), (Flag.TOGGLED, "toggleable")):
        able_objects = [o for o, n in graph.world.nodes.items() if getattr(n.category, able)]
        flags[flag] = frozenset(o for o in able_objects if rng.random() < 0.4)
    flags[Flag.DIRTY] = frozenset(o for o in graph.world.nodes if rng.random() < 0.3)
    room = sorted(graph.world.rooms)[int(rng.integers(len(graph.world.rooms)))]
    return msgspec.structs.replace(graph, flags=tuple(flags), robot_room=room)


def _interest(graph: SceneGraph, obj: str) -> float:
    category = graph.category(obj)
    confers = category.heat or category.washes or category.dries or category.rinses or category.cold
    return 0.05 + 2.0 * category.openable + category.toggleable + 4.0 * bool(confers) + 0.5 * category.surface


def _pools() -> tuple[list[str], ...]:
    """Return the kinds of movables worth drawing: food, lidded ones, hollow ones, flat ones, rags, anything."""
    graspable = [c for c in default_ontology().values() if c.graspable]
    return (
        [c.name for c in graspable if c.cookable],
        [c.name for c in graspable if c.openable],
        [c.name for c in graspable if c.interior],
        [c.name for c in graspable if c.surface],
        [c.name for c in graspable if c.wipes],
        [c.name for c in graspable],
    )


def _random_support(graph: SceneGraph, rng: np.random.Generator) -> Support:
    options = [Support(Relation.ON_TOP, o) for o in sorted(graph.world.nodes) if graph.category(o).surface]
    options += [Support(Relation.INSIDE, o) for o in sorted(graph.world.nodes) if graph.category(o).interior]
    options += [Support(Relation.FLOOR, sorted(graph.world.rooms)[0])]
    return options[int(rng.integers(len(options)))]
