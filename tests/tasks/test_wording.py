"""Words: templates of the splits apart, nouns that name one category, sentences that name what they need."""

from __future__ import annotations

import re
from collections import Counter

import msgspec
import numpy as np
import pytest

from gavel_env.errors import DataError, InstructionError
from gavel_env.house.scenes import scene_names
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.tasks.assembly import target_of
from gavel_env.tasks.drafts import Draft, Split, pair_split
from gavel_env.tasks.errands import Errand
from gavel_env.tasks.language import capitalise, compose, templates_for, word
from gavel_env.tasks.pairs import Pair, generate_pairs
from gavel_env.tasks.phrases import indefinite
from gavel_env.tasks.placements import load_house
from gavel_env.tasks.shapes import SHAPES, draw_errand
from gavel_env.tasks.templates import Templates, default_templates, expand
from gavel_env.tasks.wording_checks import article_errors, mentions, rooms_named, sentence_faults, unknown_words
from gavel_env.world_model.goals import Designator, parse_goal, parse_literal
from gavel_env.world_model.ontology import default_ontology

SPLITS: tuple[Split, ...] = ("benchmark", "validation", "train")


def errand_of(shape: str, seed: int, split: Split | None = None, house: str = "Pomaria_1_int") -> Errand:
    errand = draw_errand(Draft(load_house(house), np.random.default_rng(seed), split=split), shape, attempts=400)
    assert errand is not None
    return errand


# --- vocabulary and templates ---------------------------------------------------------------------------------------


def test_every_noun_names_one_category() -> None:
    vocabulary, ontology = default_vocabulary(), default_ontology()
    named = Counter(
        noun.lower()
        for table in (vocabulary.movables, vocabulary.furniture)
        for words in table.values()
        for noun in words.nouns
    )
    assert [noun for noun, count in named.items() if count > 1] == []
    spelled = {category.replace("_", " "): category for category in ontology}
    for table in (vocabulary.movables, vocabulary.furniture):
        for category, words in table.items():
            assert category in ontology
            for noun in words.nouns:
                assert spelled.get(noun.lower(), category) == category, noun


def test_movables_can_be_lifted_and_furniture_serves_its_uses() -> None:
    vocabulary, ontology = default_vocabulary(), default_ontology()
    assert len(vocabulary.movables) > 350
    assert [c for c in vocabulary.movables if not ontology[c].graspable] == []
    for category, words in vocabulary.furniture.items():
        can = ontology[category]
        serves = {"on": can.surface, "in": can.interior, "run": can.toggleable, "switch": can.toggleable}
        assert all(serves[use] for use in words.uses), category


def test_no_template_belongs_to_two_splits() -> None:
    templates = default_templates()
    for group, by_split in templates.clauses.items():
        owner: dict[str, str] = {}
        for split, lines in by_split.items():
            for plain in (text.removeprefix("=").strip() for line in lines for text in expand(line)):
                assert owner.setdefault(plain, split) == split, f"{group}: {plain!r}"
    for values in (templates.wrappers, {s: j.next for s, j in templates.joins.items()}):
        phrases = [phrase for split in SPLITS for phrase in values[split]]
        assert len(set(phrases)) == len(phrases)


@pytest.mark.parametrize("split", SPLITS)
@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_can_be_said_in_every_split(shape: str, split: Split) -> None:
    errand = errand_of(shape, 5)
    options = templates_for(errand, split, default_templates(), default_vocabulary())
    assert options
    for template in options:
        one = msgspec.structs.replace(default_templates(), clauses=_only(template, split))
        worded = word(errand, np.random.default_rng(0), split, templates=one)
        assert "{" not in worded.clause
        target = target_of(errand, worded)
        assert not list(sentence_faults(worded.sentence(), [(target["objects"], target["relations"])]))
        assert unknown_words(worded.sentence()) == []
        assert article_errors(worded.sentence()) == []


def _only(template: str, split: Split) -> dict[str, dict[Split, tuple[str, ...]]]:
    """Return the clause table with one template: its group keeps it, the other groups are empty in the split."""
    clauses = default_templates().clauses
    return {g: {**by, split: (template,) if template in by[split] else ()} for g, by in clauses.items()}


def test_to_says_inside_for_containers_and_on_top_for_the_rest() -> None:
    vocabulary = default_vocabulary()
    for seed in range(40):
        errand = errand_of("to_support", seed)
        category = errand.targets[0].reference.piece.category
        with_to = [t for t in templates_for(errand, "benchmark", default_templates(), vocabulary) if "{to}" in t]
        assert bool(with_to) == ("in" not in vocabulary.furniture[category].uses)
    inside = errand_of("to_container", 1)
    assert any("{to}" in t for t in templates_for(inside, "benchmark", default_templates(), vocabulary))


def test_a_slot_that_means_nothing_is_an_error() -> None:
    errand = errand_of("switch_on", 0)
    odd = msgspec.structs.replace(default_templates(), clauses={"switch_on": {"train": ("go to {nowhere}",)}})
    with pytest.raises(DataError, match="nowhere"):
        word(errand, np.random.default_rng(0), "train", templates=odd)


def test_expand_gives_every_choice() -> None:
    assert list(expand("[put|set] {x} [on|in] it")) == [
        "put {x} on it",
        "put {x} in it",
        "set {x} on it",
        "set {x} in it",
    ]


# --- sentences ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("noun", "article"),
    [("apple", "an"), ("mug", "a"), ("hourglass", "an"), ("onesie", "a"), ("umbrella", "an"), ("T-shirt", "a")],
)
def test_articles_follow_the_sound(noun: str, article: str) -> None:
    assert indefinite(noun) == f"{article} {noun}"


def test_mentions_take_the_longest_noun_and_leave_verbs_alone() -> None:
    text = "Wash the dish towel, iron it, and take the bar of soap from the chair in the bar area to the table lamp."
    assert [m.category for m in mentions(text)] == ["dishtowel", "bar_soap", "straight_chair", "table_lamp"]
    assert rooms_named("the living room sofa and the child's room bed") == ["living_room", "childs_room"]


def test_plurals_take_plural_pronouns_and_verbs() -> None:
    for seed in range(400):
        draft = Draft(load_house("Pomaria_1_int"), np.random.default_rng(seed))
        errand = draw_errand(draft, "wash_clothes")
        if errand is not None and default_vocabulary().is_plural(errand.things[0].category):
            break
    assert errand is not None
    said = {word(errand, np.random.default_rng(i), "benchmark").clause for i in range(60)}
    assert not any(re.search(r"\b(it|is|needs|that's)\b", clause) for clause in said)
    assert any(" are " in clause or " them" in clause or "need " in clause for clause in said)


def test_rooms_are_said_in_every_way() -> None:
    """As a prefix, after the noun, as `from the room`, and not at all."""
    texts = [pair.text for pair in generate_pairs("benchmark", 150, ("Beechwood_0_int", "Merom_1_int"))]
    everything = " ".join(texts)
    assert re.search(r"the (kitchen|living room) [a-z ]+? (countertop|table|bookcase|cabinet)", everything)
    assert re.search(r"(countertop|table|bookcase|cabinet) in the (kitchen|living room)", everything)
    assert re.search(r"from the (kitchen|living room|bathroom)\b(?! \w+ (table|top))", everything)
    assert sum(not rooms_named(text) for text in texts) > 10


def test_errands_are_joined_without_an_order() -> None:
    """They may be done in any: nothing between two errands says that one comes before the other."""
    templates = default_templates()
    linking = [
        p for join in templates.joins.values() for p in (*join.next, *(s for pair in join.separators for s in pair))
    ]
    assert not [phrase for phrase in linking if re.search(r"\b(then|after|before|first|finally|once)\b", phrase, re.I)]


def test_texts_are_sentences() -> None:
    house = load_house("Rs_int")
    for seed in range(60):
        rng = np.random.default_rng(seed)
        draft = Draft(house, rng)
        errands = [e for s in ("to_support", "switch_on", "to_container") if (e := draw_errand(draft, s)) is not None]
        text, worded = compose(errands, rng, SPLITS[seed % 3])
        assert re.match(r"^[A-Z].*[.?]$", text), text
        assert "  " not in text
        assert not re.search(r"[.!?] [a-z]", text), text
        assert not re.search(r"\b(\w+) \1\b", text), text
        assert all(w.sentence() == capitalise(w.clause) + ("" if w.clause.endswith("?") else ".") for w in worded)


def test_no_template_is_recognisable_from_ten_samples() -> None:
    """Ten samples of the commonest shape hardly repeat a template, in any of thirty draws of ten."""
    house = load_house("Merom_1_int")
    for trial in range(30):
        used: Counter[str] = Counter()
        for k in range(10):
            rng = np.random.default_rng([trial, k])
            errand = draw_errand(Draft(house, rng), "to_support")
            assert errand is not None
            used[word(errand, rng, "benchmark").template] += 1
        assert used.most_common(1)[0][1] <= 4


# --- pairs ----------------------------------------------------------------------------------------------------------


def movables_and_pieces(names: tuple[str, ...]) -> set[str]:
    return {Designator.parse(name).name for name in names}


def test_pairs_keep_to_their_split_and_their_targets_parse() -> None:
    scenes = [s for s in scene_names() if s.endswith("_int")]
    pairs = list(generate_pairs("train", 60, scenes))
    assert len({pair.text for pair in pairs}) == 60
    vocabulary = default_vocabulary()
    for pair in pairs:
        for task in pair.tasks:
            goal = parse_goal(task.goal)
            relations = [parse_literal(text) for text in task.relations]
            for literal in (*goal.literals, *relations):
                names = {d.name for d in (literal.subject, literal.object) if d is not None}
                if len(names) == 2 and names <= {*vocabulary.movables, *vocabulary.furniture}:
                    assert pair_split(*names) == "train", literal
            assert movables_and_pieces(task.objects) >= {lit.subject.name for lit in goal.literals}


def test_pairs_are_the_same_for_the_same_seed() -> None:
    def drawn(seed: int) -> list[Pair]:
        return list(generate_pairs("validation", 20, ("Rs_int", "Merom_1_int"), seed))

    assert drawn(1) == drawn(1)
    assert drawn(1) != drawn(2)


def test_too_few_texts_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gavel_env.tasks.pairs.draw_errands", lambda *_: [])
    with pytest.raises(InstructionError, match="only 0 of 3"):
        list(generate_pairs("validation", 3, ("Rs_int",)))


def test_template_file_is_typed() -> None:
    with pytest.raises(msgspec.ValidationError):
        msgspec.json.decode(b'{"format": "gavel-templates/1", "clauses": []}', type=Templates)
