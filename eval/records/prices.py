"""What tokens cost: prices per million, from a small file that users write."""

from __future__ import annotations

from pathlib import Path

import msgspec

from gavel_env.data import read_json
from gavel_env.errors import DataError, nearest_names

__all__ = ["Price", "Prices", "read_prices"]


class Price(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Price of a million tokens.

    Attributes:
        prompt, completion: of tokens that are sent, and of new ones.
    """

    prompt: float
    completion: float

    def __post_init__(self) -> None:
        if not (0 <= self.prompt < float("inf") and 0 <= self.completion < float("inf")):
            raise ValueError(f"prices are numbers of 0 or more, not {self.prompt:g} and {self.completion:g}")


class Prices(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Prices by model.

    Attributes:
        as_of: when they were read.
        currency: of all of them.
        models: name -> price; a name also stands for its dated versions (`NAME-2025-…`).
    """

    as_of: str = ""
    currency: str = "USD"
    models: dict[str, Price] = {}

    def find(self, model: str) -> Price | None:
        """Return the price of a model, or None."""
        names = [n for n in self.models if model == n or (model.startswith(f"{n}-") and model[len(n) + 1].isdigit())]
        return self.models[max(names, key=len)] if names else None

    def of(self, model: str, prompt_tokens: float, completion_tokens: float) -> float:
        """Return what tokens of a model cost.

        Raises:
            DataError: the model has no price; says how to give one.
        """
        price = self.find(model)
        if price is None:
            near = nearest_names(model, self.models)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise DataError(
                f"no price of model {model!r}{hint}: --prices FILE.json with "
                f'{{"models": {{"{model}": {{"prompt": 1.0, "completion": 2.0}}}}}} (per million tokens)'
            )
        return (prompt_tokens * price.prompt + completion_tokens * price.completion) / 1e6


def read_prices(path: str | Path | None = None) -> Prices:
    """Read a price file; without a path there are no prices: providers change them, so none are shipped.

    Raises:
        DataError: it cannot be read; says where.
    """
    return Prices() if path is None else read_json(path, Prices, "prices")
