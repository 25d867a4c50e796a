"""Concepts: the table of words, what they name, and how a house narrows it."""

from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gavel_env.errors import DataError, UnknownConcept
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.world_model.concepts import (
    Concept,
    Concepts,
    Meaning,
    default_concepts,
    is_concept,
    load_concepts,
    normal_phrase,
    singulars,
)
from gavel_env.world_model.goals import Designator, fitting
from gavel_env.world_model.graph import Node, Relation, Room, SceneGraph, Support, World
from gavel_env.world_model.ontology import Category, Ontology, default_ontology

CONCEPTS = default_concepts()


@pytest.mark.parametrize(
    ("phrase", "forms"),
    [
        ("as", ["as"]),  # two letters are no plural
        ("mugs", ["mugs", "mug"]),
        ("dress", ["dress"]),
        ("boxes", ["boxes", "box", "boxe"]),
        ("tins of beans", ["tins of beans", "tin of beans", "tins of bean"]),
        ("old mice", ["old mice", "old mouse"]),
    ],
)
def test_singulars_are_likeliest_first(phrase: str, forms: list[str]) -> None:
    assert list(singulars(phrase, {"mice": "mouse"})) == forms


def test_what_is_not_in_the_table_has_no_words() -> None:
    assert CONCEPTS.words("nothing_of_the_kind") == ()


def test_categories_join_concepts_and_nothing_else() -> None:
    assert "mug" in CONCEPTS.extended(members={"any_bottle": ("mug",)}).categories("any_bottle")
    with pytest.raises(UnknownConcept, match=r"'bottle'.*concepts begin with 'any_'"):
        CONCEPTS.extended(members={"bottle": ("mug",)})


def test_every_category_is_reached_by_its_own_name() -> None:
    for category in default_ontology():
        named = CONCEPTS.meaning(category.replace("_", " ")).thing
        assert named is not None, category
        assert category in CONCEPTS.categories(named), category


def test_every_room_type_is_reached_by_its_own_name() -> None:
    for kind in default_vocabulary().rooms:
        named = CONCEPTS.meaning(kind.replace("_", " ")).place
        assert named is not None, kind
        assert kind in CONCEPTS.room_types(named), kind


def test_every_noun_of_the_benchmarks_includes_what_it_means_there() -> None:
    vocabulary = default_vocabulary()
    for category in (*vocabulary.movables, *vocabulary.furniture):
        for noun in vocabulary.nouns(category):
            named = CONCEPTS.meaning(noun).thing
            assert named is not None, noun
            assert category in CONCEPTS.categories(named), (noun, category, named)
    for kind, nouns in vocabulary.rooms.items():
        for noun in nouns:
            named = CONCEPTS.meaning(noun).place
            assert named is not None, noun
            assert kind in CONCEPTS.room_types(named), (noun, kind, named)


def test_every_listed_word_names_what_is_there() -> None:
    ontology, rooms = default_ontology(), default_vocabulary().rooms
    for words, members, known in (
        (CONCEPTS.thing_words, CONCEPTS.categories, ontology),
        (CONCEPTS.place_words, CONCEPTS.room_types, rooms),
    ):
        for word, name in words.items():
            assert all(member in known for member in members(name)), (word, name)
            assert word in CONCEPTS.words(name)
    for table, known in ((CONCEPTS.things, ontology), (CONCEPTS.places, rooms)):
        for name, concept in table.items():
            assert all(member in known for member in (*concept.members, *concept.also)), name
            assert not set(concept.members) & set(concept.also), name


THINGS, ROOMS = (
    part.split("\n")[part.startswith("#") :]
    for part in (Path(__file__).parents[1] / "data" / "household_nouns.txt").read_text().strip().split("\n\n")
)


def test_common_nouns_of_a_household_are_covered() -> None:
    assert [noun for noun in THINGS if CONCEPTS.meaning(noun).thing is None] == ["water"]  # in what?


def test_common_names_of_rooms_are_covered() -> None:
    assert [room for room in ROOMS if CONCEPTS.meaning(room).place is None] == []


@pytest.mark.parametrize(
    ("said", "thing", "place"),
    [
        ("Couches", "sofa", None),
        ("the", None, None),
        ("Kids' Room", None, "childs_room"),
        ("knives", "any_knife", None),
        ("tshirt", "t_shirt", None),
        ("T-shirts", "t_shirt", None),
        ("tshirts", "t_shirt", None),
        ("livingroom", None, "living_room"),
        ("trash_can", "any_trash_can", None),
        ("office", None, "any_office"),
        ("Hall", None, "any_hall"),
        ("dryer", "clothes_dryer", None),
        ("loo", "toilet", "bathroom"),
        ("bars of soap", "bar_soap", None),
        ("Tins of Beans", "can_of_beans", None),
        ("cupboards under the counter", "bottom_cabinet_no_top", None),
    ],
)
def test_words_are_read_in_any_form(said: str, thing: str | None, place: str | None) -> None:
    assert CONCEPTS.meaning(said) == Meaning(thing, place)


@settings(deadline=None)
@given(st.sampled_from(sorted(CONCEPTS.thing_words)), st.sampled_from([" ", "_", "-"]), st.booleans())
def test_a_word_is_read_however_it_is_joined(word: str, gap: str, shout: bool) -> None:
    written = word.replace(" ", gap)
    assert CONCEPTS.meaning(written.upper() if shout else written).thing == CONCEPTS.thing_words[word]


def test_a_house_narrows_rooms_to_those_that_it_has() -> None:
    assert CONCEPTS.narrow_room("any_office", ["kitchen", "private_office"]) == "private_office"
    assert CONCEPTS.narrow_room("any_office", ["private_office", "shared_office"]) == "any_office"
    assert CONCEPTS.narrow_room("any_office", ["kitchen"]) == "any_office"
    assert CONCEPTS.narrow_room("bedroom", ["childs_room"]) == "childs_room"
    assert CONCEPTS.narrow_room("bedroom", ["childs_room", "bedroom"]) == "bedroom"
    with pytest.raises(UnknownConcept, match="any_office"):
        CONCEPTS.narrow_room("any_ofice", ["kitchen"])


def test_what_a_thing_must_be_able_to_do_narrows_it() -> None:
    ontology = default_ontology()
    lamps = CONCEPTS.narrow_thing("any_lamp", lambda name: ontology[name].surface)
    assert lamps == "any_lamp"  # none is: nothing is known better
    assert CONCEPTS.narrow_thing("any_tv", lambda name: name == "standing_tv") == "standing_tv"
    drawer = CONCEPTS.narrow_thing("nightstand", lambda name: ontology[name].interior)
    assert drawer in CONCEPTS.things["nightstand"].also


def test_a_concept_fits_every_instance_of_its_categories_in_its_rooms() -> None:
    ontology = default_ontology()
    rooms = {f"{kind}_0": Room(f"{kind}_0", kind) for kind in ("private_office", "shared_office", "kitchen")}
    nodes = {}
    for name, category, room in (
        ("desk_0", "desk", "private_office_0"),
        ("coffee_table_0", "coffee_table", "shared_office_0"),
        ("breakfast_table_0", "breakfast_table", "kitchen_0"),
    ):
        nodes[name] = (Node(name, ontology[category], True), room)
    graph = SceneGraph(World.of(rooms, frozenset(), {n: node for n, (node, _) in nodes.items()}), {}, {})
    for name, (_, room) in nodes.items():
        graph = graph.place(name, Support(Relation.FLOOR, room))
    assert fitting(graph, Designator.parse("any_table")) == ("coffee_table_0", "breakfast_table_0")
    assert fitting(graph, Designator.parse("any_table@any_office")) == ("coffee_table_0",)
    assert fitting(graph, Designator.parse("desk@any_office")) == ("desk_0",)
    assert fitting(graph, Designator.parse("any_tv")) == ()


def test_categories_of_ones_own_bring_their_words() -> None:
    pool = Category(
        name="birthing_pool",
        synset="",
        source="own",
        interior=True,
        words=("water birth tub",),
        concepts=frozenset({"any_tub"}),
    )
    bed = Category(name="cat_tree", synset="", source="own", surface=True, words=("cat tower", "couch"))
    ontology = Ontology((*default_ontology().values(), pool, bed))
    assert ontology.concepts.meaning("Water-birth tubs").thing == "birthing_pool"
    assert "birthing_pool" in ontology.concepts.categories("any_tub")
    assert "any_tub" in ontology["birthing_pool"].concepts
    couch = ontology.concepts.meaning("couch").thing
    assert couch is not None
    assert ontology.concepts.categories(couch) == ("sofa", "cat_tree")
    assert default_concepts().meaning("couch").thing == "sofa"
    hatch = Category(name="serving_hatch", synset="", source="own", surface=True)
    assert Ontology((hatch,)).concepts.meaning("serving hatches").thing == "serving_hatch"
    assert default_ontology().concepts is default_concepts()  # nothing of the shipped ones is missing


def test_concepts_are_kept_apart_from_categories() -> None:
    assert not [category for category in default_ontology() if is_concept(category)]
    assert not [kind for kind in default_vocabulary().rooms if is_concept(kind)]
    assert all(word == normal_phrase(word) for word in CONCEPTS.thing_words)


def test_malformed_tables_are_refused(tmp_path: Path) -> None:
    good = {"format": "gavel-concepts/1", "provenance": "", "things": {}, "places": {}, "thing_words": {},
            "place_words": {}, "plurals": {}}  # fmt: skip
    for change, said in (
        ({"format": "gavel-concepts/9"}, "gavel-concepts/9"),
        ({"things": {"any_a": {"members": ["mug"]}}}, "any_a"),
        ({"things": {"any_a": {"members": ["mug", "any_b"]}}}, "any_b"),
        ({"thing_words": {"cup": "any_cup"}}, "any_cup"),
        ({"thing_words": {"The Cup": "mug"}}, "the cup"),
        ({"plurals": 3}, "malformed"),
    ):
        path = tmp_path / "concepts.json"
        path.write_bytes(msgspec.json.encode(good | change))
        with pytest.raises(DataError, match=said):
            load_concepts(path)
    with pytest.raises(DataError, match="cannot be read"):
        load_concepts(tmp_path / "none.json")


def test_a_table_without_irregular_plurals_still_reads_regular_ones() -> None:
    table = Concepts({}, {}, {"box": "packing_box", "berry": "blackberry"}, {}, {})
    assert table.meaning("boxes").thing == "packing_box"
    assert table.meaning("berries").thing == "blackberry"
    assert table.meaning("glass").thing is None


def test_a_concept_of_one_is_no_concept() -> None:
    assert all(len(concept.members) > 1 for name, concept in CONCEPTS.things.items() if is_concept(name))
    assert Concept(("mug",)) != Concept(("mug",), ("cup",))


# --- the docs --------------------------------------------------------------------------------------------------------


def excerpt() -> list[str]:
    """Return rows of the page's table: every tenth concept, in alphabetical order."""
    rows = []
    for name in sorted(filter(is_concept, (*CONCEPTS.things, *CONCEPTS.places)))[::10]:
        table = CONCEPTS.things if name in CONCEPTS.things else CONCEPTS.places
        words = [word for word in CONCEPTS.words(name) if word != name.removeprefix("any_").replace("_", " ")]
        members = [f"`{member}`" for member in table[name].members]
        more = ", …" if len(members) > 4 else ""
        said = ", ".join([name.removeprefix("any_").replace("_", " "), *words[:3]])
        rows.append(f"| {said} | `{name}` | {', '.join(members[:4])}{more} |")
    return rows


def test_the_docs_show_the_table_as_it_is() -> None:
    [page] = (Path(__file__).parents[2] / "docs").rglob("concepts.md")
    text = page.read_text(encoding="utf-8")
    shown = text.split("<!-- excerpt -->")[1].split("<!-- end of excerpt -->")[0].strip().splitlines()[2:]
    assert shown == excerpt()
    counts = (
        len(CONCEPTS.thing_words),
        len(CONCEPTS.place_words),
        sum(map(is_concept, CONCEPTS.things)),
        sum(map(is_concept, CONCEPTS.places)),
    )
    assert all(f"{count:,} " in text for count in counts), counts
