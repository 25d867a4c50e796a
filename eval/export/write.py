"""A data set in a folder: its rows as JSON Lines or Parquet, and the card that says what they are."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from eval.records.journal import RecordFile
from eval.records.scrub import scrubbed
from gavel_env.errors import DataError, NotInstalled

__all__ = ["COLUMNS", "write_dataset"]

COLUMNS: Mapping[str, Mapping[str, str]] = {
    "sft": {
        "prompt": "chat turns that the planner was asked with, rules and worked examples first",
        "completion": "one assistant turn: the plan that succeeded, as the prompt asks it to be written",
    },
    "dpo": {
        "prompt": "chat turns that the planner was asked with",
        "chosen": "one assistant turn: what repair made of the plan, or the plan that was accepted in the end",
        "rejected": "one assistant turn: the plan that the graph model found invalid",
        "chosen_by": "repair or later attempt",
        "refused_because": "per wrong task its verdict",
        "edits": "what repair did, one line per edit",
        "attempt": "0 for the first proposal",
    },
    "trajectories": {
        "instruction": "what was said",
        "steps": "observation (in words, before the action), action, verdict (ok or the violation), detail, metres",
        "outcome": "how the episode ended",
        "failure": "its class; empty on success",
        "unmet": "goal conditions that do not hold at the end",
        "unsafe": "what was left open or on",
        "metres": "driven in all",
    },
}
"""What the columns of each kind of data set hold."""

_SHARED = {
    "instruction_id": "id of the instruction",
    "kind": "single, multi or behavior",
    "scene": "the house",
    "agent": "the method that was run",
    "model": "the planner's model, as it names itself",
    "seed": "of the episode",
    "success": "whether the instruction was carried out in the hidden world",
}
_TITLES = {
    "sft": "Plans for household instructions: fine-tuning pairs",
    "dpo": "Plans for household instructions: preference pairs from verification and repair",
    "trajectories": "Household episodes: observation, action, verdict",
}


def write_dataset(kind: str, rows: Iterable[dict[str, Any]], files: RecordFile, out: str | Path, form: str) -> int:
    """Write a data set and its card into a folder; return its number of rows.

    Args:
        kind: `sft`, `dpo` or `trajectories`.
        rows: what it consists of; written one by one.
        files: records that they are of, for the card.
        out: the folder; created, and refused if it holds something.
        form: `jsonl` or `parquet`.

    Raises:
        DataError: the folder is not empty, cannot be written, or there is nothing to write.
        NotInstalled: Parquet without pyarrow.
    """
    folder = Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise DataError(f"{folder} is not empty; choose another --out")
        data = folder / f"train.{form}"
        scenes: Counter[str] = Counter()
        count = 0
        with data.open("wb") as file:
            for row in rows:
                file.write(msgspec.json.encode(scrubbed(row)) + b"\n")
                scenes[row["scene"]] += 1
                count += 1
        if not count:
            data.unlink()
            raise DataError(f"these runs hold nothing for a data set of kind {kind}")
        if form == "parquet":
            _to_parquet(data)
        (folder / "README.md").write_text(_card(kind, count, sorted(scenes), files, data.name), encoding="utf-8")
    except OSError as error:
        raise DataError(f"{folder} cannot be written: {error.strerror}") from error
    return count


def _to_parquet(path: Path) -> None:
    """Turn JSON Lines into Parquet, in place."""
    try:
        import pyarrow.json
        import pyarrow.parquet
    except ImportError as error:
        path.unlink()
        raise NotInstalled("--format parquet needs pyarrow: pip install 'gavel-env[export]'") from error
    block = max(1 << 20, 2 * max(map(len, path.read_bytes().splitlines())))
    table = pyarrow.json.read_json(path, read_options=pyarrow.json.ReadOptions(block_size=block))
    pyarrow.parquet.write_table(table, path)


def _card(kind: str, count: int, scenes: Sequence[str], files: RecordFile, data: str) -> str:
    records = list(files.records.values())
    models = sorted({record.model for record in records} - {""})
    columns = "\n".join(f"| `{name}` | {what} |" for name, what in {**COLUMNS[kind], **_SHARED}.items())
    stamps = sorted({record.data for record in records})
    codes = sorted({record.code for record in records})
    sources = sorted({f"{b.source} ({b.kind}, stamp {b.stamp})" for h in files.headers for b in h.benchmarks})
    return f"""---
pretty_name: "{_TITLES[kind]}"
license: other
license_name: depends-on-the-models
language: [en]
tags: [planning, robotics, {kind}]
size_categories: ["{_size(count)}"]
configs: [{{config_name: default, data_files: [{{split: train, path: {data}}}]}}]
---

# {_TITLES[kind]}

{count} rows, written by `gavel export {kind}` from {len(records)} recorded episodes.

| column | content |
|---|---|
{columns}

- Instructions: {"; ".join(sources) or "unknown"}. Data stamps: {", ".join(stamps)}.
- Houses: {", ".join(scenes)}.
- Models that answered: {", ".join(models) or "none"}.
- Code: {", ".join(codes)}.

Instructions, houses and verdicts are part of GAVEL (MIT; see its NOTICE for the data that they are made from). What a
model wrote is under that model's terms. Instructions that models are tested on must not be trained on: hold out the
benchmark files, or the houses, that you report.

```python
from datasets import load_dataset

rows = load_dataset("FOLDER", split="train")
```
"""


def _size(count: int) -> str:
    if count < 1_000:
        return "n<1K"
    return "1K<n<10K" if count < 10_000 else "10K<n<100K" if count < 100_000 else "100K<n<1M"
