"""What a step is worth."""

from __future__ import annotations

import msgspec

__all__ = ["RewardWeights"]


class RewardWeights(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Weights of the reward: `success * [succeeded] - metre * metres driven - violation * [invalid]`.

    Attributes:
        success: paid once, in the step that ends the episode successfully.
        metre: taken per metre driven.
        violation: taken for an invalid action.
    """

    success: float = 1.0
    metre: float = 0.01
    violation: float = 0.1

    def of(self, *, success: bool, metres: float, violation: bool) -> float:
        """Return the reward of one step."""
        return self.success * success - self.metre * metres - self.violation * violation
