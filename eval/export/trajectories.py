"""Episodes as observation, action and verdict, step by step: recorded actions are sent again to see what was seen."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import msgspec

from eval.records.conversations import Exchange
from eval.records.journal import RecordFile
from eval.records.schema import Contestant, EpisodeRecord
from eval.run.episodes import EnvironmentSettings, Episode
from eval.run.playback import Playback, playback
from eval.run.rig import Rig
from eval.run.verification import instructions_of, with_headers
from gavel_agents.agent import Agent
from gavel_env.errors import DataError
from gavel_env.instructions.record import Instruction

__all__ = ["trajectories"]


class _Player(Rig):
    """A rig whose agent plays a record."""

    record: EpisodeRecord
    played: Playback

    def agent(
        self, contestant: Contestant, instruction: Instruction, seed: int, exchanges: list[Exchange] | None = None
    ) -> Agent:
        self.played = playback(self.record)
        return self.played

    def load(self, planner: str) -> None:
        """Return nothing: no model is asked."""


def trajectories(files: RecordFile, paths: Iterable[str | Path] = ()) -> Iterator[dict[str, Any]]:
    """Yield one row per episode that took a step: what was seen, done and said of it, and how it ended.

    Args:
        files: records of runs.
        paths: instruction files beside the shipped ones that the runs were about.

    Raises:
        DataError: an instruction is not here, or an episode no longer plays as it was recorded (`gavel verify-run`).
    """
    known = instructions_of(files, paths)
    rigs: dict[bytes, _Player] = {}
    for header, record in with_headers(files):
        instruction = known.get((record.data, record.instruction))
        if instruction is None or not record.steps:
            continue
        settings = msgspec.convert(header.environment, EnvironmentSettings)
        rig = rigs.setdefault(msgspec.json.encode(settings), _Player(settings))
        rig.record = record
        again = rig.run(Episode(record.key, record.kind, record.contestant, record.code, instruction)).record
        if again.steps != record.steps:
            raise DataError(f"{record.instruction} by {record.contestant.agent} does not replay as it was recorded")
        yield _row(record, rig.played.seen)


def _row(record: EpisodeRecord, seen: list[str]) -> dict[str, Any]:
    return {
        "instruction_id": record.instruction,
        "instruction": record.text,
        "kind": record.kind,
        "scene": record.scene,
        "agent": record.contestant.agent,
        "model": record.model,
        "seed": record.seed,
        "steps": [
            {
                "observation": before,
                "action": step.action,
                "verdict": step.outcome,
                "detail": step.detail,
                "metres": step.metres,
            }
            for before, step in zip(seen, record.steps, strict=False)
        ],
        "outcome": record.outcome,
        "failure": record.failure,
        "success": record.success,
        "unmet": list(record.unmet),
        "unsafe": list(record.unsafe),
        "metres": record.metres,
    }
