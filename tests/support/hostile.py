"""The hostile tests: a short share in the default suite, all of it with `make test-hostile`."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from hypothesis import HealthCheck, settings

from gavel_env.errors import GavelError

FULL = os.environ.get("GAVEL_HOSTILE") == "full"


def times(short: int, full: int) -> int:
    """Return how often something is tried."""
    return full if FULL else short


def fuzzed(short: int, full: int) -> settings:
    """Return Hypothesis settings for so many inputs."""
    return settings(
        max_examples=times(short, full),
        deadline=None,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture, HealthCheck.data_too_large],
    )


def harmless(call: Callable[..., Any], *given: Any, **named: Any) -> Any:
    """Return what a call returns, or the typed error that it raises; any other error is the test's failure."""
    try:
        return call(*given, **named)
    except GavelError as error:
        return error


def changed_within(value: Any, way: list[int], to: Any) -> Any:
    """Return JSON-like data with one thing in it replaced, found by going `way` down."""
    if not way or not isinstance(value, dict | list) or not value:
        return to
    if isinstance(value, dict):
        key = sorted(value)[way[0] % len(value)]
        return {**value, key: changed_within(value[key], way[1:], to)}
    at = way[0] % len(value)
    return [*value[:at], changed_within(value[at], way[1:], to), *value[at + 1 :]]
