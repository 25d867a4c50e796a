"""`gavel record`: store what a language model answers, for replays without it."""

from __future__ import annotations

import argparse
import time
from contextlib import closing
from typing import Any

from eval.commands._runs import seconds, seeds

__all__ = ["register"]

_AGENTS = "llm-only,gavel-basic,gavel-full,sayplan"


def register(subparsers: Any) -> None:
    """Add `gavel record`."""
    parser = subparsers.add_parser("record", help="record a language model's answers, to replay them without it")
    parser.add_argument("--planner", required=True, metavar="SPEC", help="the model, such as gguf:MODEL.gguf")
    parser.add_argument(
        "--out", required=True, metavar="FILE.jsonl.gz", help="the recording; an existing one is continued"
    )
    parser.add_argument("--agents", default=_AGENTS, metavar="A,B", help=f"default: {_AGENTS}")
    parser.add_argument("--instructions", default="single", metavar="NAME", help="shipped file or path")
    parser.add_argument(
        "--sample", type=_positive, metavar="N", help="only N instructions, drawn by the hash of their ids"
    )
    parser.add_argument(
        "--understanding", default="reference", metavar="NAME", help="reference (default), rules, adapter:FOLDER or llm"
    )
    parser.add_argument("--prior", default="choice", metavar="NAME", help="location prior (default: choice)")
    parser.add_argument("--profile", choices=("paper", "omnigibson"), default="paper", help="rules profile")
    parser.add_argument("--seeds", type=seeds, default=(0,), metavar="0,1", help="of the model's sampling (default: 0)")
    parser.add_argument("--threads", type=_positive, default=2, metavar="N", help="prompts asked at once (default: 2)")
    parser.add_argument(
        "--timeout",
        type=seconds,
        metavar="SECONDS",
        help="of one call of the model in all, with its retries; then recording stops, to be continued (default: none)",
    )
    parser.set_defaults(run=_run)


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number above 0")
    return int(text)


def _run(arguments: argparse.Namespace) -> int:
    from eval.records.sampling import sample
    from eval.studies.recording import record, recorder
    from gavel_agents.llm.replay import compact
    from gavel_agents.understanding import load_understanding
    from gavel_env.instructions.record import read_instructions, shipped
    from gavel_env.world_model.dynamics import Profile

    source = arguments.instructions
    instructions = read_instructions(source if source.endswith(".jsonl") else shipped(source))
    chosen = sample(instructions, arguments.sample)
    agents = arguments.agents.split(",")
    model = recorder(arguments.planner, arguments.out, arguments.threads, arguments.timeout)
    with closing(model):
        if model.set_aside is not None:
            print(f"{arguments.out} was not whole: it is now {model.set_aside}, and what could be read is kept")
        begun = time.monotonic()
        total = len(agents) * len(chosen) * len(arguments.seeds)
        for number, asked in enumerate(
            record(
                model,
                agents,
                {name: instructions[name] for name in chosen},
                understanding=load_understanding(arguments.understanding, instructions.values(), model),
                prior=arguments.prior,
                profile=Profile(arguments.profile),
                threads=arguments.threads,
                seeds=arguments.seeds,
            ),
            start=1,
        ):
            minutes = (time.monotonic() - begun) / 60.0
            verdict = "; ".join(v for v in asked.verdicts if v != "valid") or "valid"
            print(
                f"[{number}/{total}, {minutes:.1f} min] {asked.agent} {asked.instruction_id}: "
                f"{asked.attempts} attempts, {verdict}",
                flush=True,
            )
    print(f"{compact(arguments.out)} completions in {arguments.out}")
    return 0
