"""When a run stops before its end: a budget is spent, or the endpoint has gone."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence

import msgspec

from eval.records.prices import Prices
from eval.run.planners import SERVED
from eval.run.rig import Finished
from gavel_agents.llm import load_model
from gavel_agents.llm.service import Checked
from gavel_env.errors import EndpointError, RunStopped

__all__ = ["Limits", "check_endpoints", "within"]

_ENDPOINT_FAILED = f"error:{EndpointError.__name__}"


class Limits(msgspec.Struct, frozen=True, kw_only=True):
    """What one command may spend, and how much trouble it bears.

    Episodes under way when a limit is reached are finished and recorded, so that it may be passed by as much.

    Attributes:
        max_calls: calls of language models.
        max_tokens: prompt and new tokens together.
        max_cost: in the currency of the prices.
        fail_on_errors: endpoint failures one after the other; None = never stop for them.
        prices: per model.
    """

    max_calls: int | None = None
    max_tokens: int | None = None
    max_cost: float | None = None
    fail_on_errors: int | None = 5
    prices: Prices = Prices()


def check_endpoints(planners: Sequence[str], limits: Limits) -> None:
    """Ask every server for one short completion, and see that its model has a price if cost is limited.

    Args:
        planners: specs; those of other kinds are passed over.
        limits: of the run.

    Raises:
        EndpointError: one does not answer; nothing has been run.
        DataError: a model has no price.
    """
    for planner in planners:
        if planner.partition(":")[0] in SERVED:
            model = load_model(planner)
            if limits.max_cost is not None:
                limits.prices.of(model.name, 0, 0)
            if isinstance(model, Checked):
                model.check()


def within(ran: Iterator[Finished], limits: Limits, stop: threading.Event) -> Iterator[Finished]:
    """Pass on what has been run until a limit is reached.

    Endpoint failures are held back to the end of the run: if it stops early they leave no record, so that resuming runs
    them again.

    Args:
        ran: what has been run.
        limits: see there.
        stop: set when no further episode is to be begun.

    Raises:
        RunStopped: a limit is reached.
    """
    failed: list[Finished] = []
    reached = ""
    streak = calls = tokens = 0
    cost = 0.0
    for finished in ran:
        record = finished.record
        if record.failure == _ENDPOINT_FAILED:
            failed.append(finished)
            streak += 1
            if limits.fail_on_errors is not None and streak >= limits.fail_on_errors:
                last = record.error.strip().splitlines()[-1:] or [""]
                raise RunStopped(f"{streak} episodes in a row failed to reach the model; the last: {last[0]}")
            continue
        if record.usage.calls:
            streak = 0
        yield finished
        calls += record.usage.calls
        tokens += record.usage.prompt_tokens + record.usage.completion_tokens
        if limits.prices.find(record.model) is not None:
            cost += limits.prices.of(record.model, record.usage.prompt_tokens, record.usage.completion_tokens)
        for name, spent, most in (
            ("calls", calls, limits.max_calls),
            ("tokens", tokens, limits.max_tokens),
            ("cost", cost, limits.max_cost),
        ):
            if most is not None and spent >= most:
                reached = f"--max-{name} {most:g} is reached: {spent:g}"
                stop.set()
    if reached:
        raise RunStopped(reached)
    yield from failed
