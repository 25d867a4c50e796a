"""Noun phrases of an errand: `the kitchen countertop`, `the mug that's in the sink`, `out of the fridge`, `them`."""

from __future__ import annotations

import re

import numpy as np

from gavel_env.errors import DataError
from gavel_env.instructions.vocabulary import Vocabulary
from gavel_env.tasks.drafts import Reference, Thing
from gavel_env.tasks.errands import Errand, Target
from gavel_env.tasks.placements import pick

__all__ = ["Speaker", "indefinite"]


def indefinite(noun: str) -> str:
    """Return the noun with `a` or `an` as it is pronounced."""
    sounded = re.match(r"(hour|[aeiouAEIO])", noun) and not re.match(r"(one|u[nst]i|eu)", noun)
    return f"{'an' if sounded else 'a'} {noun}"


_VERBS = {
    "is": ("is", "are"),
    "has": ("has", "have"),
    "belong": ("belongs", "belong"),
    "need": ("needs", "need"),
    "go": ("goes", "go"),
    "end": ("ends", "end"),
    "get": ("gets", "get"),
    "it": ("it", "them"),
    "it_s": ("it", "they"),
}
_ON = {
    "dst": ("on", "on", "on", "onto", "on top of"),
    "at": ("on", "on", "on", "on top of"),
    "loc": ("on", "on", "on", "on", "on top of"),
}
_IN = {
    "dst": ("in", "in", "into", "inside"),
    "at": ("in", "in", "in", "inside"),
    "loc": ("in", "in", "in", "inside"),
}


class Speaker:
    """Words one errand: chooses nouns and phrases once, and says a room only at the first mention."""

    def __init__(self, errand: Errand, rng: np.random.Generator, vocabulary: Vocabulary) -> None:
        self.errand = errand
        self.rng = rng
        self.vocabulary = vocabulary
        self.nouns: dict[str, str] = {}
        self.mentioned: set[str] = set()

    def noun(self, category: str) -> str:
        """Return the noun of a category, the same one throughout the errand."""
        if category not in self.nouns:
            nouns = self.vocabulary.nouns(category)
            self.nouns[category] = nouns[0] if self.rng.random() < 0.65 else pick(self.rng, nouns)
        return self.nouns[category]

    def room(self, room_type: str) -> str:
        """Return a noun of a room type."""
        nouns = self.vocabulary.room_nouns(room_type)
        return nouns[0] if self.rng.random() < 0.75 else pick(self.rng, nouns)

    def piece(self, reference: Reference) -> str:
        """Return `the countertop`, `the kitchen countertop` or `the countertop in the kitchen`."""
        category = reference.piece.category
        noun = self.noun(category)
        if reference.room is None or category in self.mentioned:
            return f"the {noun}"
        self.mentioned.add(category)
        room = self.room(reference.room)
        if "'" in room or self.rng.random() < 0.45:
            return f"the {noun} in the {room}"
        return f"the {room} {noun}"

    def thing(self, thing: Thing, *, full: bool) -> str:
        """Return `the mug`, or in full `the mug from the coffee table`, `the mug that's in the kitchen`."""
        bare = f"the {self.noun(thing.category)}"
        if not full or thing.stated == "no" or thing.category in self.mentioned:
            return bare
        self.mentioned.add(thing.category)
        if self.rng.random() < 0.5:
            return f"{bare} from {self.piece_or_room(thing)}"
        are = "that are" if self.plural(thing) else "that's"
        return f"{bare} {are} {self.location(thing)}"

    def room_phrase(self, thing: Thing) -> str:
        """Return `the kitchen`: the room where a thing starts."""
        return f"the {self.room(thing.start.room_type)}"

    def piece_or_room(self, thing: Thing) -> str:
        """Return what the text says a thing starts on or in: a piece, or the room alone."""
        return self.room_phrase(thing) if thing.source is None else self.piece(thing.source)

    def plural(self, thing: Thing) -> bool:
        """Return whether the noun of a thing is a plural."""
        return self.vocabulary.is_plural(thing.category)

    def source(self, thing: Thing) -> str:
        """Return `from the coffee table`, `out of the fridge` or `from the kitchen`."""
        if thing.source is None:
            return f"from {self.room_phrase(thing)}"
        words = ("from", "from", "out of") if thing.start.relation == "in" else ("from", "from", "off")
        return f"{pick(self.rng, words)} {self.piece(thing.source)}"

    def location(self, thing: Thing) -> str:
        """Return `on the coffee table`, `in the fridge` or `in the kitchen`."""
        if thing.source is None:
            return f"in {self.room_phrase(thing)}"
        words = _IN if thing.start.relation == "in" else _ON
        return f"{pick(self.rng, words['loc'])} {self.piece(thing.source)}"

    def target(self, target: Target, slot: str) -> str:
        """Return `on the sofa`, `into the sink` or `to the bed`, as the slot wants it."""
        if slot == "to":
            return f"to {self.piece(target.reference)}"
        words = _IN if target.relation == "in" else _ON
        return f"{pick(self.rng, words[slot])} {self.piece(target.reference)}"

    def appliance_phrase(self, reference: Reference) -> str:
        """Return `in the oven` or `on the stove`."""
        goes_in = any(f"PLACE_INSIDE({reference.piece.id})" == step for step in self.errand.plan)
        return f"{'in' if goes_in else 'on'} {self.piece(reference)}"

    def slot(self, name: str) -> str:
        """Return the words for a slot of a template.

        Raises:
            DataError: the template names no such slot.
        """
        errand, base, which = self.errand, name.rstrip("2"), 1 if name.endswith("2") else 0
        if base in _VERBS:
            return _VERBS[base][self.plural(errand.things[which])]
        if base in ("dst", "at", "to"):
            return self.target(errand.targets[which], base)
        if name == "from":
            return f"from {self.piece_or_room(errand.things[0])}"
        if base in ("loc", "src"):
            return self.location(errand.things[which]) if base == "loc" else self.source(errand.things[which])
        if name in ("x", "y", "z", "x0", "y0", "z0"):
            return self.thing(errand.things["xyz".index(name[0])], full=len(name) == 1)
        if name in ("a_x0", "a_y0"):
            thing = errand.things["xy".index(name[2])]
            noun = self.noun(thing.category)
            return f"some {noun}" if self.plural(thing) else indefinite(noun)
        if name in ("m", "m2"):
            return self.piece(errand.appliances[which])
        if name == "app":
            return self.appliance_phrase(errand.appliances[0])
        if name == "l" and errand.switch is not None:
            return self.piece(errand.switch)
        if name == "f_src" and errand.things[0].source is not None:
            return self.piece(errand.things[0].source)
        raise DataError(f"template slot {{{name}}} has nothing to stand for in an errand of shape {errand.shape!r}")
