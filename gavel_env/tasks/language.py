"""Errands in words: how an errand becomes a clause, and clauses an instruction.

Templates are data. Every template, wrapper and joining phrase belongs to one split, so that the sentences of
`benchmark`, `validation` and `train` differ in form and not in their nouns alone. Errands of one instruction are joined
without any word of order: they may be done in any.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gavel_env.instructions.vocabulary import Vocabulary, default_vocabulary
from gavel_env.tasks.drafts import Split
from gavel_env.tasks.errands import Errand
from gavel_env.tasks.phrases import Speaker
from gavel_env.tasks.placements import pick
from gavel_env.tasks.templates import CHOICE, SLOT, Templates, default_templates

__all__ = ["Worded", "capitalise", "compose", "templates_for", "word"]


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


# --- templates ------------------------------------------------------------------------------------------------------


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
    chosen = CHOICE.sub(lambda m: pick(rng, m.group(1).split("|")), template)
    speaker = Speaker(errand, rng, vocabulary)
    clause = SLOT.sub(lambda m: speaker.slot(m.group(1)), chosen.removeprefix("=").strip())
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
