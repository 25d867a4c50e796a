"""Pictures of measurements, all in one style; needs the extra `[plots]`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gavel_env.errors import NotInstalled

__all__ = ["figure", "fitted_exponent", "plain_logarithmic"]


def figure(columns: int = 1, rows: int = 1, *, height_in: float = 3.4) -> tuple[Any, Any]:
    """Return a new figure and its axes.

    Args:
        columns: of axes.
        rows: of axes.
        height_in: of a row, inches.

    Raises:
        NotInstalled: the extra is missing.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise NotInstalled("matplotlib is not installed; pip install 'gavel-env[plots]'") from error
    drawing = Figure(figsize=(5.4 * columns, height_in * rows), dpi=110, layout="constrained")
    FigureCanvasAgg(drawing)
    axes = drawing.subplots(rows, columns, squeeze=False)
    for ax in axes.flat:
        ax.grid(visible=True, color="0.9")
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
    return drawing, axes[0, 0] if rows == columns == 1 else axes


def plain_logarithmic(ax: Any, sizes: Sequence[float]) -> None:
    """Write the numbers of two logarithmic axes plainly; a few whole sizes are each written out."""
    from matplotlib.ticker import FixedLocator, LogLocator, NullFormatter, StrMethodFormatter

    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if axis is ax.yaxis else (1.0,)))
        axis.set_major_formatter(StrMethodFormatter("{x:,g}"))
        axis.set_minor_formatter(NullFormatter())
    if len(sizes) <= 6 and all(float(size).is_integer() for size in sizes):
        ax.xaxis.set_major_locator(FixedLocator(list(sizes)))


def fitted_exponent(sizes: Sequence[float], costs: Sequence[float]) -> tuple[float, float]:
    """Return k and c of the least-squares fit cost = c * size^k in logarithms."""
    slope, offset = np.polyfit(np.log(sizes), np.log(costs), 1)
    return float(slope), float(np.exp(offset))
