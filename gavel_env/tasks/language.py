"""Errands in words: clause templates, noun phrases, and how clauses become an instruction.

Templates are data (`envs_data/templates.json`, slots explained in docs/instructions.md). Every template, wrapper and
joining phrase belongs to one split, so that the sentences of `benchmark`, `validation` and `train` differ in form and
not in their nouns alone. Errands of one instruction are joined without any word of order: they may be done in any.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib import resources
from typing import NamedTuple

import msgspec
import numpy as np

from gavel_env.errors import DataError
from gavel_env.tasks.drafts import Reference, Split, Thing
from gavel_env.tasks.errands import Errand, Target
from gavel_env.tasks.placements import pick
from gavel_env.tasks.vocabulary import Vocabulary, default_vocabulary

__all__ = ["Templates", "Worded", "compose", "default_templates", "expand", "indefinite", "templates_for", "word"]

FORMAT = "gavel-templates/1"


class Joining(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the clauses of a split are joined: opening words, sentences that go on, separators of lists."""

    openers: tuple[str, ...]
    next: tuple[str, ...]
    separators: tuple[tuple[str, str], ...]


class Templates(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The template file: clauses by group and split, wrappers and joining phrases by split."""

    format: str
    clauses: Mapping[str, Mapping[Split, tuple[str, ...]]]
    wrappers: Mapping[str, tuple[str, ...]]
    joins: Mapping[Split, Joining]


@cache
def default_templates() -> Templates:
    """Return the shipped templates.

    Raises:
        DataError: missing file, invalid content or another format version.
    """
    source = resources.files("envs_data") / "templates.json"
    try:
        table = msgspec.json.decode(source.read_bytes(), type=Templates)
    except OSError as error:
        raise DataError(f"template file {source} cannot be read: {error.strerror}") from error
    except msgspec.DecodeError as error:
        raise DataError(f"template file {source} is malformed: {error}") from error
    if table.format != FORMAT:
        raise DataError(f"template file {source} has format {table.format!r}; this version reads {FORMAT!r}")
    return table


class Worded(NamedTuple):
    """An errand in words.

    Attributes:
        clause: the clause, first letter as inside a sentence, no full stop.
        imperative: False for statements and questions.
        template: the template it was made from.
    """

    clause: str
    imperative: bool
    template: str

    def sentence(self) -> str:
        """Return the clause as a sentence of its own: the text of the task."""
        return capitalise(self.clause) + ("" if self.clause.endswith("?") else ".")


def capitalise(text: str) -> str:
    """Return the text with its first letter in upper case."""
    return text[:1].upper() + text[1:]


def indefinite(noun: str) -> str:
    """Return the noun with `a` or `an` as it is pronounced."""
    sounded = re.match(r"(hour|[aeiouAEIO])", noun) and not re.match(r"(one|u[nst]i|eu)", noun)
    return f"{'an' if sounded else 'a'} {noun}"


# --- noun phrases ---------------------------------------------------------------------------------------------------

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


class _Speaker:
    """Words one errand: chooses nouns and phrases once, and says a room only at the first mention."""

    def __init__(self, errand: Errand, rng: np.random.Generator, vocabulary: Vocabulary) -> None:
        self.errand = errand
        self.rng = rng
        self.vocabulary = vocabulary
        self.nouns: dict[str, str] = {}
        self.mentioned: set[str] = set()

    def noun(self, category: str) -> str:
        if category not in self.nouns:
            nouns = self.vocabulary.nouns(category)
            self.nouns[category] = nouns[0] if self.rng.random() < 0.65 else pick(self.rng, nouns)
        return self.nouns[category]

    def room(self, room_type: str) -> str:
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
        return f"the {self.room(thing.start.room_type)}"

    def piece_or_room(self, thing: Thing) -> str:
        return self.room_phrase(thing) if thing.source is None else self.piece(thing.source)

    def plural(self, thing: Thing) -> bool:
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


# --- templates ------------------------------------------------------------------------------------------------------

_CHOICE = re.compile(r"\[([^\[\]]*)\]")
_SLOT = re.compile(r"\{(\w+)\}")


def expand(template: str) -> Iterator[str]:
    """Yield every template that the choices `[a|b]` of one stand for."""
    match = _CHOICE.search(template)
    if match is None:
        yield template
        return
    for option in match.group(1).split("|"):
        yield from expand(template[: match.start()] + option + template[match.end() :])


def _groups(errand: Errand) -> tuple[str, ...]:
    """Return the template groups that can word an errand."""
    one_target = len(errand.targets) == 1
    named = bool(errand.things) and errand.things[0].source is not None
    stated = bool(errand.things) and errand.things[0].stated != "no"
    table: dict[str, tuple[str, ...]] = {
        "away": ("carry", "away", "carry_from") if stated else ("carry", "away"),
        "switch_on": ("switch_on",),
        "wash_dish": ("wash",),
        "wash_clothes": ("wash",),
        "dry_clothes": ("dry",),
        "counter_heat": ("heat", "heat_from") if named else ("heat",),
        "fridge_heat": ("heat", "heat_from", "heat_from"),
        "put_two_away": ("away_same",) if one_target else ("away_each",),
        "take_two_out": ("take_same",) if one_target else ("take_each",),
        "bring_three": ("three_same",),
        "carry_two": ("two_same",) if one_target else ("two_each",),
        "carry_two_and_switch": ("two_same",) if one_target else ("two_each",),
        "swap": ("swap",),
        "tray": ("tray",),
        "load_dishwasher": ("load",),
        "wash_then_dry": ("laundry",),
    }
    return table.get(errand.shape, ("carry", "carry_from") if stated else ("carry",))


def templates_for(errand: Errand, split: Split, templates: Templates, vocabulary: Vocabulary) -> list[str]:
    """Return the templates of a split that say what the errand means.

    `to the bookcase` means inside, `to the bed` on top: templates with `to` are left out where that is not meant.
    """
    found = [t for group in _groups(errand) for t in templates.clauses[group][split]]
    if errand.things and errand.things[0].stated != "no":
        found = [t for t in found if "{x} {app}" not in t]  # "the steak from the fridge in the oven" misleads
    reads_well = [
        t.relation == ("in" if "in" in vocabulary.furniture[t.reference.piece.category].uses else "on")
        for t in errand.targets
    ]
    for slot, index in (("{to}", 0), ("{to2}", 1)):
        if len(reads_well) > index and not reads_well[index]:
            found = [t for t in found if slot not in t]
    return found


def word(
    errand: Errand,
    rng: np.random.Generator,
    split: Split,
    *,
    imperative_only: bool = False,
    templates: Templates | None = None,
    vocabulary: Vocabulary | None = None,
) -> Worded:
    """Put an errand into words.

    Args:
        errand: the errand.
        rng: source of randomness.
        split: whose templates to use.
        imperative_only: leave out statements, questions and clauses with inner stops (for lists).
        templates: default the shipped ones.
        vocabulary: default the shipped one.
    """
    templates, vocabulary = templates or default_templates(), vocabulary or default_vocabulary()
    options = templates_for(errand, split, templates, vocabulary)
    if imperative_only:
        options = [t for t in options if not t.startswith("=") and not re.search(r"[;:,]", t)] or options
    template = pick(rng, options)
    chosen = _CHOICE.sub(lambda m: pick(rng, m.group(1).split("|")), template)
    speaker = _Speaker(errand, rng, vocabulary)
    clause = _SLOT.sub(lambda m: speaker.slot(m.group(1)), chosen.removeprefix("=").strip())
    if errand.shape == "carry_two_and_switch" and errand.switch is not None:
        verb = pick(rng, ("switch on", "turn on"))
        link = pick(rng, (", then ", "; also ", ", and ")) if not template.startswith("=") else "; also "
        clause += f"{link}{verb} {speaker.piece(errand.switch)}"
    return Worded(clause, not template.startswith("="), template)


# --- instructions ---------------------------------------------------------------------------------------------------


def _wrap(worded: Worded, rng: np.random.Generator, templates: Templates, split: Split) -> str:
    """Return a sentence, an imperative now and then in a politer form."""
    if not worded.imperative:
        return worded.sentence()
    simple = not re.search(r"[;:]", worded.clause)
    wrappers = templates.wrappers["shared"]
    if simple and rng.random() < 0.45:
        wrappers = templates.wrappers[split]
    text = pick(rng, wrappers).replace("{c}", worded.clause)
    return capitalise(text) + ("" if text.endswith("?") else ".")


def compose(
    errands: Sequence[Errand],
    rng: np.random.Generator,
    split: Split,
    *,
    templates: Templates | None = None,
    vocabulary: Vocabulary | None = None,
) -> tuple[str, tuple[Worded, ...]]:
    """Return the text of an instruction and its errands in words.

    Several errands are said as a list in one sentence, as sentences of their own with and without a linking phrase,
    or as an opening and a list.
    """
    templates, vocabulary = templates or default_templates(), vocabulary or default_vocabulary()
    joins = templates.joins[split]
    as_list = len(errands) > 1 and rng.random() < (0.5 if len(errands) <= 3 else 0.25)
    worded = tuple(
        word(e, rng, split, imperative_only=as_list, templates=templates, vocabulary=vocabulary) for e in errands
    )
    opener = pick(rng, joins.openers) if len(errands) > 1 else ""
    if as_list and all(w.imperative and not re.search(r"[;:?]", w.clause) for w in worded):
        separator, last = pick(rng, joins.separators)
        clauses = [w.clause for w in worded]
        text = separator.join(clauses[:-1]) + last + clauses[-1]
        if opener and not opener.endswith(": "):
            text = capitalise(text)
        if not opener and rng.random() < 0.3:
            text = pick(rng, templates.wrappers["shared"]).replace("{c}", text)
        return capitalise(opener + text) + ".", worded
    sentences, links = [_wrap(worded[0], rng, templates, split)], list[str]()
    for item in worded[1:]:
        linkable = not re.search(r"[;:?]", item.clause) and rng.random() < 0.5
        if not linkable:
            sentences.append(_wrap(item, rng, templates, split))
            continue
        fresh = [phrase for phrase in joins.next if phrase not in links] or list(joins.next)
        links.append(link := pick(rng, fresh))
        sentences.append(link.replace("{c}", item.clause).replace("{C}", capitalise(item.clause)))
    if opener.endswith(": "):
        opener = opener[:-2] + ". "
    return opener + " ".join(sentences), worded
