"""The rules that turn BEHAVIOR's annotations into affordances; docs/reference/data.md explains them.

Openable, toggleable, heat and cold sources, cookable, heatable and freezable are annotated in bddl and read as they
are. What bddl does not annotate is decided by the tables below, over synsets and measured sizes, never by the code
that uses the ontology.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

from envs_data.build.activity_definitions import problems
from envs_data.build.common import Size, activities, ancestors, properties
from gavel_env.activities.bddl import Node, synset_of
from gavel_env.world_model.ontology import Mount

__all__ = [
    "CONFERS",
    "WATER_SOURCES",
    "carryable",
    "Holders",
    "clearance",
    "graspable",
    "heats_by_kind",
    "holders",
    "interior",
    "mount",
    "surface",
    "washable",
]

# Switching these on changes their contents. bddl has transition rules for two of them; the third is the paper's own.
CONFERS: dict[str, tuple[str, str]] = {
    "clothes_dryer.n.01": ("dries", "DryerRule of BEHAVIOR"),
    "dishwasher.n.01": ("washes", "rule of the paper; BEHAVIOR has none"),
    "washer.n.03": ("washes", "WasherRule of BEHAVIOR"),
}

# Fixtures that run water when switched on, besides those with the annotation waterSource.
WATER_SOURCES: dict[str, str] = {
    "drinking_fountain.n.02": "runs water by its kind",
    "hot_tub.n.02": "runs water by its kind",
    "showerhead.n.01": "runs water by its kind",
    "water__dispenser.n.01": "particleSource of water",
}

# Kinds that heat food when switched on though bddl annotates no heatSource; safety only, they cook nothing.
HEATS_BY_KIND = ("cooker.n.01", "deep_fryer.n.01", "heatgun.n.01", "spirit_lamp.n.01", "waffle_iron.n.01")

# Furniture and fixtures with a flat top.
SURFACE_KINDS = (
    "base.n.08", "bed.n.01", "bookcase.n.01", "bookcase_shelf.n.01", "bookcase_top.n.01", "cabinet.n.01", "case.n.20",
    "chest.n.02", "counter.n.01", "crib.n.01", "flat_bench.n.02", "grill.n.02", "grocery_shelf.n.01", "hallstand.n.01",
    "handcart.n.01", "hospital_bed.n.02", "hutch.n.01", "microwave.n.02", "oven.n.01", "pet_bed.n.01",
    "plant_pot_stand.n.01", "refrigerator.n.01", "seat.n.03", "shelf.n.01", "shoe_rack.n.01", "snack_rack.n.01",
    "stove.n.01", "table.n.02", "tabletop.n.01", "tiered_seat.n.01", "tray.n.01", "wardrobe.n.01", "white_goods.n.01",
)  # fmt: skip

# A hypernym this general says nothing about the things below it.
TOO_GENERAL = "container.n.01"

# Things fit on the floor beneath these.
CLEARANCE_KINDS = ("bedroom_furniture.n.01", "chair.n.01", "seat.n.03", "table.n.02")

# Long thin vessels are filled, but nothing that a hand carries goes in.
NARROW_VESSELS = ("bottle.n.01", "flask.n.01", "graduate.n.02", "tube.n.01")
MOUTH_M = 0.12
SMALL_MOUTH_M = 0.06
FLAT_M = 0.05

# One hand: see docs/reference/data.md.
LONGEST_SIDE_M = 0.7
LONGEST_TOOL_M, TOOL_WIDTH_M, TOOL_KG = 1.6, 0.55, 3.0
LONGEST_CLOTH_M = 2.5
HEAVIEST_KG = 8.0
HEAVIEST_FOR_TWO_ARMS_KG = 20.0
STANDS_KINDS = (
    "audio_system.n.01", "bin.n.01", "display.n.06", "faucet.n.01", "furniture.n.01", "hamper.n.02",
    "loudspeaker.n.01", "plumbing_fixture.n.01", "projector.n.02", "seat.n.03", "umbrella_rack.n.01",
    "white_goods.n.01",
)  # fmt: skip

# What people put into a machine to have it washed and dried, besides what is of cloth or soft.
WASHED_KINDS = (
    "backpack.n.01", "base.n.08", "brush.n.02", "carryall.n.01", "carving_knife.n.01", "chopping_board.n.01",
    "cleaver.n.01", "clothing.n.01", "comb.n.01", "corkscrew.n.01", "cutlery.n.02", "footwear.n.02",
    "french_press.n.01", "glass.n.02", "icetray.n.02", "lid.n.02", "linen.n.03", "lunch_box.n.01",
    "measuring_cup.n.01", "parer.n.02", "pastry_cutter.n.01", "peeler.n.03", "plaything.n.01", "shaker.n.03",
    "soap_dish.n.01", "strainer.n.01", "tableware.n.01", "tongs.n.01", "tray.n.01", "tupperware.n.01",
    "utensil.n.01", "vessel.n.03",
)  # fmt: skip

# Of these, what is used once, or comes full.
UNWASHED_KINDS = (
    "aluminum_foil.n.01", "beer_bottle.n.01", "cotton.n.01", "diaper.n.01", "dixie_cup.n.01", "paper.n.01",
    "paper_towel.n.01", "pill_bottle.n.01", "plastic_bag.n.01", "plastic_wrap.n.01", "sanitary_napkin.n.01",
    "steel_wool.n.01", "wine_bottle.n.01",
)  # fmt: skip

STRUCTURE_KINDS = (
    "backdrop.n.01", "baseboard.n.01", "ceiling.n.01", "door.n.01", "driveway.n.01", "elevator_door.n.01",
    "floor.n.01", "gate.n.01", "lawn.n.01", "paving_stone.n.01", "roof.n.01", "skeleton.n.04", "wall.n.01",
    "window.n.01",
)  # fmt: skip
CEILING_KINDS = (
    "ceiling_fan.n.01", "ceiling_rack.n.01", "chandelier.n.01", "fire_sprinkler.n.01", "paper_lantern.n.01",
    "room_light.n.01", "showerhead.n.01", "ventilator.n.01",
)  # fmt: skip
WALL_KINDS = (
    "alarm.n.02", "banner.n.01", "blackboard.n.01", "blind.n.03", "bulletin.n.01", "bulletin_board.n.01",
    "curtain.n.01", "curtain_rod.n.01", "dartboard.n.01", "decorative_sign.n.01", "display_panel.n.01",
    "fairy_light.n.01", "hand_dryer.n.01", "handle.n.01", "hanging.n.01", "hook.n.05", "mirror.n.01", "outlet.n.01",
    "painting.n.01", "paper_towel_dispenser.n.01", "periodic_table.n.01", "photoelectric_cell.n.01",
    "photograph.n.01", "portrait.n.02", "poster.n.01", "range_hood.n.01", "scoreboard.n.01", "screen.n.01",
    "security_camera.n.01", "shelf.n.01", "shutter.n.01", "signpost.n.01", "switch.n.01", "thermostat.n.01",
    "toilet_paper_dispenser.n.01", "toilet_paper_holder.n.01", "towel_rack.n.01", "wall_clock.n.01",
    "wall_nail.n.01", "wall_socket.n.01", "whiteboard.n.01",
)  # fmt: skip
CARPET_KINDS = ("mat.n.03", "rug.n.01")
LOW_M = 0.15


class Holders(NamedTuple):
    """How often the activities put something on top of, inside or under an object of a synset."""

    on_top: Counter[str]
    inside: Counter[str]
    under: Counter[str]


@cache
def holders() -> Holders:
    """Count `ontop`, `inside` and `under` facts per holder synset over init and goal of all activities."""
    counts = {"ontop": Counter[str](), "inside": Counter[str](), "under": Counter[str]()}
    for _, sections in activities():
        for facts in sections.values():
            for fact in facts:
                if fact.subject != "agent.n.01" and fact.relation in counts:
                    counts[fact.relation][fact.holder] += 1
    return Holders(counts["ontop"], counts["inside"], counts["under"])


def _is_a(synset: str, kinds: tuple[str, ...]) -> bool:
    return not ancestors(synset).isdisjoint(kinds)


def mount(name: str, synset: str, size_m: Size | None) -> Mount:
    """Return where instances of a category are fixed, from its name, kind and height."""
    if _is_a(synset, STRUCTURE_KINDS):
        return "structure"
    if "wall_mounted" in name and not _is_a(synset, ("sink.n.01",)):
        return "wall"
    if name.startswith(("ceiling_", "hanging_plant", "hanging_basket")) or name == "track_light":
        return "ceiling"
    if _is_a(synset, CARPET_KINDS):
        return "carpet"
    if name == "top_cabinet":
        return "wall"
    if name.startswith(("standing_", "makeup_")):
        return "floor"
    if _is_a(synset, WALL_KINDS):
        if synset == "shelf.n.01" and size_m is not None and size_m[2] > LOW_M:
            return "floor"
        return "wall"
    if _is_a(synset, CEILING_KINDS):
        return "ceiling"
    return "floor"


def _evidence(counts: Counter[str], synset: str) -> bool:
    """Return True if the activities use this synset, or a hypernym that says something about it."""
    return any(counts[kind] for kind in sorted(ancestors(synset)) if kind != TOO_GENERAL)


def surface(synset: str, size_m: Size | None, where: Mount) -> str | None:
    """Return why things can stand on a category, or None."""
    if where in {"structure", "ceiling"} or (where == "wall" and synset != "shelf.n.01"):
        return None
    if _evidence(holders().on_top, synset):
        return "activities put things on it"
    if _is_a(synset, SURFACE_KINDS):
        return "kind with a flat top"
    flat = size_m is not None and size_m[2] <= FLAT_M and not _is_a(synset, NARROW_VESSELS)
    if flat and "fillable" in properties(synset):
        return "flat dish"
    return None


def interior(synset: str, size_m: Size | None) -> str | None:
    """Return why things can be put into a category, or None."""
    annotations = properties(synset)
    if holders().inside[synset]:
        return "activities put things into it"
    for source in ("heatSource", "coldSource"):
        if annotations.get(source, {}).get("requires_inside"):
            return f"{source} acts inside"
    if "fillable" not in annotations or size_m is None or _is_a(synset, NARROW_VESSELS):
        return None
    mouth_m = min(size_m[:2])
    if _evidence(holders().inside, synset) and mouth_m >= SMALL_MOUTH_M:
        return "activities put things into its kind"
    return "fillable and wide enough" if mouth_m >= MOUTH_M and size_m[2] > FLAT_M else None


def clearance(synset: str, where: Mount) -> bool:
    """Return True if something can lie on the floor beneath a category."""
    return where == "floor" and (_evidence(holders().under, synset) or _is_a(synset, CLEARANCE_KINDS))


def graspable(synset: str, size_m: Size | None, mass_kg: float | None, where: Mount) -> bool:
    """Return True if one hand can lift an object of this kind, size (m) and mass (kg)."""
    annotations = properties(synset)
    if size_m is None or mass_kg is None or where != "floor" or "sceneObject" in annotations:
        return False
    plugged_in = "toggleable" in annotations and _is_a(synset, ("kitchen_appliance.n.01",))
    if mass_kg > HEAVIEST_KG or plugged_in or _is_a(synset, STANDS_KINDS):
        return False
    longest, second = sorted(size_m, reverse=True)[:2]
    if not annotations.keys().isdisjoint({"cloth", "rope"}):
        return longest <= LONGEST_CLOTH_M
    tool = longest <= LONGEST_TOOL_M and second <= TOOL_WIDTH_M and mass_kg <= TOOL_KG
    return longest <= LONGEST_SIDE_M or tool


def washable(synset: str) -> str | None:
    """Return why people have things of a kind washed and dried, or None; whether they can be carried is not asked.

    Packages of a substance, which BEHAVIOR names `shampoo__bottle`, `bottle__of__milk`, are not: they hold something.
    """
    annotations = properties(synset).keys()
    if "__" in synset or "toggleable" in annotations or _is_a(synset, UNWASHED_KINDS):
        return None
    if not annotations.isdisjoint({"cloth", "softBody"}):
        eaten = not annotations.isdisjoint({"cookable", "diceable", "meltable", "sliceable"})
        return None if eaten or _is_a(synset, ("food.n.01", "food.n.02")) else "cloth or soft"
    return "kind that is washed" if _is_a(synset, WASHED_KINDS) else None


@cache
def moved_kinds() -> frozenset[str]:
    """Return the synsets of which an activity's goal wants an instance on, in, under or next to something."""
    found: set[str] = set()

    def walk(node: Node, kinds: Mapping[str, str], positive: bool) -> None:
        kinds = {**kinds, **dict(node.variables)}
        if positive and node.head in ("ontop", "inside", "under", "nextto"):
            found.add(kinds.get(node.args[0], synset_of(node.args[0])))
        for part in node.parts:
            walk(part, kinds, positive != (node.head == "not"))

    for problem in problems():
        walk(problem.goal, {}, True)
    return frozenset(found)


def carryable(synset: str, mass_kg: float | None, where: Mount) -> bool:
    """Return True if activities want such things moved and both arms can carry one."""
    if mass_kg is None or mass_kg > HEAVIEST_FOR_TWO_ARMS_KG or where in {"structure", "ceiling"}:
        return False
    return not (ancestors(synset) - {TOO_GENERAL}).isdisjoint(moved_kinds())


def heats_by_kind(synset: str) -> bool:
    """Return True for cookers and flames that bddl does not annotate as heat sources."""
    return _is_a(synset, HEATS_BY_KIND)
