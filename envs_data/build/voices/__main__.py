"""Draw scenarios, make the packets of blind writers and readers, merge what they wrote.

python -m envs_data.build.voices draw SCENARIOS                      # scenarios.jsonl, certified, without texts
python -m envs_data.build.voices write SCENARIOS FOLDER              # FOLDER/WRITER.md, write-K.jsonl
python -m envs_data.build.voices packets SCENARIOS FOLDER            # FOLDER/READER.md, read-A-K.jsonl, read-B-K.jsonl
python -m envs_data.build.voices merge SCENARIOS FOLDER --out FILE   # voices.jsonl, FOLDER/rewrite.jsonl
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import msgspec

from envs_data.build.voices.packets import read_written, reader_packets, writer_packets
from envs_data.build.voices.scenarios import SEED, draw
from gavel_env.data import read_lines
from gavel_env.instructions.record import Instruction

__all__ = ["main"]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m envs_data.build.voices", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    drawing = commands.add_parser("draw", help="draw certified scenarios without texts")
    drawing.add_argument("scenarios", type=Path)
    drawing.add_argument("--single", type=int, default=430)
    drawing.add_argument("--multi", type=int, default=215)
    drawing.add_argument("--seed", type=int, default=SEED)
    for name, help_text in (("write", "packets for blind writers"), ("packets", "packets for blind readers")):
        making = commands.add_parser(name, help=help_text)
        making.add_argument("scenarios", type=Path)
        making.add_argument("folder", type=Path)
        making.add_argument("--parts", type=int, default=6, help="number of writers or readers")
        making.add_argument("--first", type=int, default=1, help="number of the first packet")
        making.add_argument("--ids", type=Path, help="file of records or ids: only these (rewrite.jsonl)")
        making.add_argument("--written", type=Path, nargs="*", help="texts to read; default FOLDER/written-*.jsonl")
    merging = commands.add_parser("merge", help="compare readings with scenarios, certify, split")
    merging.add_argument("scenarios", type=Path)
    merging.add_argument("folder", type=Path)
    merging.add_argument("--out", type=Path, required=True)
    return parser


def _numbered(folder: Path, pattern: str) -> list[Path]:
    return sorted(folder.glob(pattern), key=lambda path: int(path.stem.rsplit("-", 1)[1]))


def _only(path: Path | None) -> set[str] | None:
    if path is None:
        return None
    return {str(msgspec.json.decode(line)["id"]) for line in path.read_bytes().splitlines() if line.strip()}


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; return the exit status."""
    arguments = _parser().parse_args(argv)
    if arguments.command == "draw":
        records = [*draw("single", arguments.single, arguments.seed), *draw("multi", arguments.multi, arguments.seed)]
        arguments.scenarios.write_bytes(b"".join(msgspec.json.encode(r) + b"\n" for r in records))
        print(f"{arguments.scenarios}: {len(records)} scenarios")
        return 0
    # Scenarios have no texts yet, so they are no instructions that `read_instructions` would take.
    drawn = read_lines(arguments.scenarios, Instruction, "scenarios")
    scenarios = {record.id: record for record in drawn}
    folder: Path = arguments.folder
    if arguments.command == "merge":
        from envs_data.build.voices.merge import merge_files

        return merge_files(scenarios, folder, arguments.out)
    only = _only(arguments.ids)
    if arguments.command == "write":
        chosen = [r for r in scenarios.values() if only is None or r.id in only]
        writer_packets(chosen, folder, arguments.parts, arguments.first)
        print(f"{folder}: {len(chosen)} scenarios for {arguments.parts} writers")
        return 0
    texts = read_written(arguments.written or _numbered(folder, "written-*.jsonl"))
    texts = {key: text for key, text in texts.items() if only is None or key in only}
    reader_packets(scenarios, texts, folder, arguments.parts, arguments.first)
    print(f"{folder}: {len(texts)} texts for twice {arguments.parts} readers")
    return 0


if __name__ == "__main__":
    sys.exit(main())
