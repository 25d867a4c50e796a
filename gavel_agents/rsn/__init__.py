"""Location priors b_o^0(r): the paper's Relational Semantic Network, and a choice model that beats it.

`load_prior("choice")` (default) and `load_prior("rsn")` (the paper's) run on numpy alone, from the weights in
`gavel_agents/weights`; `python -m gavel_agents.rsn train` makes those weights.
Measurements: docs/explanation/beliefs.md.
"""

from gavel_agents.rsn.data import BENCHMARK_HOUSES, RoomInfo
from gavel_agents.rsn.predict import PRIORS, LocationPrior, Prior, UnknownPrior, load_prior

__all__ = ["BENCHMARK_HOUSES", "PRIORS", "LocationPrior", "Prior", "RoomInfo", "UnknownPrior", "load_prior"]
