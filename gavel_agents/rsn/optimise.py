"""L-BFGS for smooth convex functions, in numpy (Nocedal & Wright, Numerical Optimization, algorithm 7.5)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["minimise"]

Floats = NDArray[np.float64]

MEMORY = 10
SUFFICIENT_DECREASE = 1e-4


def minimise(function: Callable[[Floats], tuple[float, Floats]], start: Floats, steps: int, tolerance: float) -> Floats:
    """Return a minimiser.

    Args:
        function: x -> (value, gradient).
        start: first x.
        steps: most iterations.
        tolerance: stops when the value falls by less than this fraction of itself.
    """
    x = start
    value, gradient = function(x)
    memory: deque[tuple[Floats, Floats, float]] = deque(maxlen=MEMORY)
    for _ in range(steps):
        direction = _direction(gradient, memory)
        slope = float(gradient @ direction)
        if slope >= 0.0:
            break
        length = 1.0 if memory else min(1.0, 1.0 / float(np.linalg.norm(gradient)))
        while True:
            candidate = x + length * direction
            new_value, new_gradient = function(candidate)
            if new_value <= value + SUFFICIENT_DECREASE * length * slope:
                break
            length *= 0.5
            if length < 1e-12:
                return x
        moved, turned = candidate - x, new_gradient - gradient
        curvature = float(moved @ turned)
        if curvature > 1e-12:
            memory.append((moved, turned, 1.0 / curvature))
        gain = value - new_value
        x, value, gradient = candidate, new_value, new_gradient
        if gain <= tolerance * max(1.0, abs(value)):
            break
    return x


def _direction(gradient: Floats, memory: deque[tuple[Floats, Floats, float]]) -> Floats:
    """Return the quasi-Newton descent direction by the two-loop recursion."""
    q = -gradient
    weights: list[float] = []
    for moved, turned, inverse in reversed(memory):
        weight = inverse * float(moved @ q)
        weights.append(weight)
        q = q - weight * turned
    if memory:
        moved, turned, inverse = memory[-1]
        q = q / (inverse * float(turned @ turned))
    for (moved, turned, inverse), weight in zip(memory, reversed(weights), strict=True):
        q = q + (weight - inverse * float(turned @ q)) * moved
    return q
