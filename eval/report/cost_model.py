"""Tables of how well the cost of an order predicts the metres driven."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from eval.report.grid import UNDEFINED, Grid

if TYPE_CHECKING:
    from eval.studies.cost_limits import Limits
    from eval.studies.cost_model import Fit

__all__ = ["fits_table", "limits_table"]

_LEGEND = (
    "R²: squared correlation over instructions. slope: metres driven per metre expected. bias: metres expected per "
    "metre driven, less 1."
)
_PUBLISHED = (
    "The paper, in its own executor: R² = 0.93 at N = 4, 0.89 at N = 5, which justifies pairwise costs in place of "
    "rolling out every order; 17 ms of ordering. Here nothing that does not know where things are comes near that, but "
    "J and its own rollouts through whole orders do."
)


def fits_table(found: Sequence[Fit], *, cost: str, agent: str, facts: Sequence[str]) -> Grid:
    """Return the table of the fits by number of tasks."""
    return Grid(
        title=f"Cost of the chosen order ({cost}) against metres driven ({agent}, reference plans)",
        facts=tuple(facts),
        header=(
            "tasks N",
            "instructions",
            "R²",
            "slope",
            "bias",
            "mean metres" if cost == "simulated" else "mean J (m)",
            "mean driven (m)",
            "order (ms)",
        ),
        labels=1,
        rows=tuple(
            (
                "all" if fit.tasks is None else str(fit.tasks),
                str(fit.instructions),
                f"{fit.r_squared:.2f}",
                f"{fit.slope:.2f}",
                f"{100 * fit.bias:+.0f} %",
                f"{fit.expected_m:.1f}",
                f"{fit.driven_m:.1f}",
                f"{fit.ordering_ms:.1f}",
            )
            for fit in found
        ),
        notes=(_LEGEND, _PUBLISHED),
    )


def limits_table(found: Limits) -> Grid:
    """Return the table of what can be asked of a cost model."""
    return Grid(
        title=f"What can be asked of it: {found.instructions} instructions, drawn by the hash of their ids",
        facts=(),
        header=("measured", ""),
        labels=1,
        rows=(
            ("R² of the cost and the metres driven, on this sample", _number(found.model_r_squared)),
            (
                f"R² of the executor itself, mean over {found.worlds} worlds drawn from B₀",
                _number(found.ceiling_r_squared),
            ),
            ("its bias", UNDEFINED if found.ceiling_bias is None else f"{100 * found.ceiling_bias:+.0f} %"),
            (
                f"rank correlation of cost and metres over {found.orders} random orders of an instruction",
                _number(found.rank_correlation, found.rank_error),
            ),
            ("R² of pairwise J and J rolled out through the whole order", _number(found.sequential_r_squared)),
        ),
    )


def _number(value: float | None, error: float | None = None) -> str:
    return UNDEFINED if value is None else f"{value:.2f}" + ("" if error is None else f" ± {error:.2f}")
