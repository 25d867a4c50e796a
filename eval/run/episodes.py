"""One episode of a run: what is to be run, and how what happened becomes a record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from eval.records.provenance import now
from eval.records.schema import Contestant, EpisodeKey, EpisodeRecord, Step
from gavel_env.exchange import EnvAction, Observed
from gavel_env.instructions.record import Instruction
from gavel_env.world_model.actions import Action

if TYPE_CHECKING:
    from gavel_env.sim.episode import Judgement

__all__ = ["EnvironmentSettings", "Episode", "classify", "simplified", "step_record"]

_NOT_UNDERSTOOD = "not understood"


class EnvironmentSettings(msgspec.Struct, frozen=True):
    """Settings that every contestant of a run shares.

    Attributes:
        profile: rules profile.
        max_steps: actions after which an episode is truncated.
        options: further keyword arguments of the environments.
    """

    profile: str = "paper"
    max_steps: int = 300
    options: dict[str, Any] = {}


class Episode(msgspec.Struct, frozen=True):
    """One episode to run: an instruction, or what stands for a line that could not be read.

    Attributes:
        instruction: None for a rejected line.
        rejected: why the line was rejected.
    """

    key: EpisodeKey
    kind: str
    contestant: Contestant
    code: str
    instruction: Instruction | None = None
    rejected: str = ""

    def record(self, outcome: str, failure: str = "", *, privileged: bool = False, **fields: Any) -> EpisodeRecord:
        """Return the episode's record; `privileged`: the agent turned out to see the hidden state."""
        who = self.contestant
        return EpisodeRecord(
            seed=self.key.seed,
            instruction=self.key.instruction,
            kind=self.kind,
            scene=self.instruction.scene if self.instruction else "",
            text=self.instruction.text if self.instruction else "",
            data=self.key.data,
            code=self.code,
            contestant=msgspec.structs.replace(who, privileged=True) if privileged else who,
            outcome=outcome,
            failure="" if outcome == "success" else failure or outcome,
            finished=now(),
            **fields,
        )


def classify(stopped_by: str, judgement: Judgement, stopped: str) -> tuple[str, str]:
    """Return (outcome, failure class) of an episode that was played to its end."""
    if stopped_by == "violation" and judgement.violation is not None:
        return "violation", f"violation:{judgement.violation.kind.value}"
    if stopped_by:
        return stopped_by, stopped_by
    if stopped.startswith(_NOT_UNDERSTOOD):
        reason = stopped.removeprefix(_NOT_UNDERSTOOD).strip(": ").partition(":")[0]
        return "refused", f"refused:{reason}" if reason else "refused"
    if judgement.unmet:
        return "unmet", "unmet:" + judgement.unmet[0].partition("(")[0]
    if judgement.unsafe:
        return "unsafe", "unsafe:" + judgement.unsafe[0].partition("(")[0]
    return "success", ""


def step_record(action: EnvAction, info: Mapping[str, Any]) -> Step:
    """Return the record of one executed action from what the environment said of it."""
    observed: Observed = info["observed"]
    violation = info["violation"]
    return Step(
        action=str(Action(action.primitive, action.target)),
        outcome=info["outcome"],
        metres=round(float(info["step_metres"]), 3),
        reached=observed.reached,
        route=simplified(observed.layout.points(np.asarray(info["route"], np.int32))) if info["route"] else (),
        detail="" if violation is None else str(violation),
        search_prior=dict(action.search_prior or {}),
        other_than=tuple(action.other_than),
        return_when=action.return_when,
    )


def simplified(points: NDArray[np.float64]) -> tuple[tuple[float, float], ...]:
    """Return the ends and turning points of a polyline, to 1 cm.

    Args:
        points: (n, 2) x, y in metres.
    """
    if len(points) > 2:
        before, after = np.diff(points[:-1], axis=0), np.diff(points[1:], axis=0)
        straight = np.isclose(before, after).all(axis=1)
        points = points[np.concatenate([[True], ~straight, [True]])]
    return tuple((round(x, 2), round(y, 2)) for x, y in points.tolist())
