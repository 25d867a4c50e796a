"""What planning an instruction costs: calls, tokens and seconds by stage, from records alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from eval.records.prices import Prices
from eval.records.schema import EpisodeRecord
from eval.report.statistics import Estimate, over_episodes

__all__ = ["STAGES", "Costs", "costs", "in_order"]

STAGES = ("understand", "plan", "repair", "validate", "order")
"""Stages of the shared pipeline, in its order; agents of others may report further ones."""


class Costs(NamedTuple):
    """Means over the recorded episodes in which a contestant planned, ± their sample standard deviation.

    Attributes:
        calls: of the language model; None without one.
        prompt_tokens, completion_tokens: over all calls of an episode, as the model's backend counts them; None where
            it never counted any (stored and reference plans, servers that do not say).
        money: what the tokens cost by the list, as if the contestant had been alone; None without a price.
        seconds: by stage, those that any of the episodes reports; one that an episode does not report took it 0 s.
        planning_s: the sum over the stages; None where none were reported.
        episodes: averaged over.
    """

    calls: Estimate | None
    prompt_tokens: Estimate | None
    completion_tokens: Estimate | None
    money: Estimate | None
    seconds: Mapping[str, Estimate]
    planning_s: Estimate | None
    episodes: int


def costs(records: Sequence[EpisodeRecord], *, asks_model: bool, prices: Prices | None = None) -> Costs:
    """Return what planning cost in the episodes that reported any planning.

    Args:
        records: of one contestant, which does not see the hidden state.
        asks_model: whether it was given a language model.
        prices: of models; default none.
    """
    planned = [record for record in records if record.trace.seconds]
    traces = [record.trace for record in planned]
    prices = prices or Prices()
    priced = bool(planned) and all(prices.find(record.model) is not None for record in planned)
    by_stage = {
        name: over_episodes([trace.seconds.get(name, 0.0) for trace in traces])
        for name in in_order(name for trace in traces for name in trace.seconds)
    }
    return Costs(
        calls=over_episodes([float(trace.attempts) for trace in traces]) if asks_model else None,
        prompt_tokens=_counted([trace.prompt_tokens for trace in traces]),
        completion_tokens=_counted([trace.completion_tokens for trace in traces]),
        money=over_episodes(
            [prices.of(r.model, r.trace.prompt_tokens, r.trace.completion_tokens) for r in planned] if priced else []
        ),
        seconds={name: spent for name, spent in by_stage.items() if spent is not None},
        planning_s=over_episodes([sum(trace.seconds.values()) for trace in traces]),
        episodes=len(traces),
    )


def in_order(stages: Iterable[str]) -> tuple[str, ...]:
    """Return names of stages once each: those of the shared pipeline in its order, then others by name."""
    found = set(stages)
    return (*(name for name in STAGES if name in found), *sorted(found.difference(STAGES)))


def _counted(tokens: Sequence[int]) -> Estimate | None:
    return over_episodes([float(count) for count in tokens]) if any(tokens) else None
