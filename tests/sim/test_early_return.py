"""A search comes back when it is told to, has done what it says, and without being told never does."""

from __future__ import annotations

import numpy as np
import pytest
from support.floor_scenes import flat
from support.houses import start, steps

from gavel_env.errors import GavelError, UnknownObject
from gavel_env.exchange import EnvAction, ReturnWhen
from gavel_env.instructions.initial_graph import scene_graph
from gavel_env.sim.executor import EarlyReturn, Executor
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import ViolationKind

GO = Primitive.NAVIGATE_TO
LIVING_ROOM_LAST = {"study_0": 3.0, "kitchen_0": 2.0, "living_room_0": 1.0}


def _flat() -> Executor:
    return Executor(flat(), scene_graph(flat()), rng=np.random.default_rng(1))


def test_a_search_comes_back_after_every_room_and_then_goes_on_as_if_it_had_not() -> None:
    whole, stepwise = _flat(), _flat()
    whole.step(Action(GO, "plate"), LIVING_ROOM_LAST)
    never = EarlyReturn(lambda obj: False, after_room=True)
    returns = 0
    while (outcome := stepwise.step(Action(GO, "plate"), LIVING_ROOM_LAST, early=never)).returned:
        returns += 1
        assert outcome.ok
        assert outcome.action == Action(GO, "plate")
        assert not stepwise.graph.near
        assert len(outcome.searched) == 1 or returns == 1
    assert returns >= 1
    assert outcome.action == Action(GO, "plate_0")
    assert stepwise.observed.searched == whole.observed.searched
    assert stepwise.observed.metres == pytest.approx(whole.observed.metres)
    assert (stepwise.observed.seen == whole.observed.seen).all()


def test_the_last_room_searched_in_vain_is_not_found_and_no_return() -> None:
    executor = _flat()
    early = EarlyReturn(lambda obj: False, after_room=True)
    for _ in range(10):
        outcome = executor.step(Action(GO, "apple"), accepts=lambda obj: False, early=early)
        if not outcome.returned:
            break
    assert outcome.violation is not None
    assert outcome.violation.kind is ViolationKind.NOT_FOUND


def test_a_search_ends_where_something_else_comes_into_sight() -> None:
    plain, watching = _flat(), _flat()
    first = {"living_room_0": 2.0, "study_0": 1.0}
    whole = plain.step(Action(GO, "apple"), first)
    early = EarlyReturn(lambda obj: obj == whole.observed[0], after_room=False)
    outcome = watching.step(Action(GO, "apple"), first, early=early)
    assert outcome.returned
    assert whole.observed[0] in outcome.observed
    assert 0.0 < outcome.metres < whole.metres
    again = watching.step(Action(GO, "apple"), first, early=early)  # what is known no longer ends a search
    assert again.action == whole.action


def test_what_the_search_is_for_goes_before() -> None:
    executor = _flat()
    early = EarlyReturn(lambda obj: True, after_room=True)
    while (outcome := executor.step(Action(GO, "plate"), early=early)).returned:
        assert "plate_0" not in executor.graph.world.nodes
    assert outcome.action == Action(GO, "plate_0")
    assert "plate_0" in executor.graph.near


def test_drives_to_what_is_known_do_not_come_back() -> None:
    executor = _flat()
    executor.step(Action(GO, "bookcase"))
    early = EarlyReturn(lambda obj: True, after_room=True)
    outcome = executor.step(Action(GO, "bookcase"), early=early)
    assert not outcome.returned
    assert "bookcase_0" in executor.graph.near


def test_the_agent_sees_that_nothing_was_reached() -> None:
    env = start("rs_apple_to_table")
    wanted = {"living_room_0": 2.0, "bedroom_0": 1.5}
    _, _, terminated, _, info = env.step(EnvAction(GO, "apple", wanted, return_when=ReturnWhen(room_done=True)))
    observed = info["observed"]
    assert info["outcome"] == "ok"
    assert not terminated
    assert observed.reached is None
    assert info["step_metres"] == pytest.approx(observed.metres)
    assert observed.seen.sum() > 0
    with pytest.raises(ValueError, match="read-only"):
        observed.seen[0, 0] = True
    assert steps(env, "NAVIGATE_TO(apple)")[-1]["observed"].reached is not None


@pytest.mark.parametrize(("seen", "error"), [("frige", UnknownObject), ("@kitchen", GavelError)])
def test_conditions_that_mean_nothing_are_errors(seen: str, error: type[Exception]) -> None:
    with pytest.raises(error):
        start("rs_apple_to_table").step(EnvAction(GO, "apple", return_when=ReturnWhen((seen,))))
