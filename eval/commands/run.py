"""`gavel run`: a sentence in words, carried out in a house and shown."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

    from eval.sentence.run import Ask

__all__ = ["register"]


def register(subparsers: Any) -> None:
    """Add `gavel run`."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "run",
        help="say what to do in a house, and watch it done",
        description="Understand a sentence, put the things it speaks of somewhere plausible, plan, verify, repair and "
        "drive. Without a sentence: a prompt. Exit status: 0 done, 1 not done, 2 not understood or wrong use.",
    )
    parser.add_argument("sentence", nargs="*", help="what to do, in words")
    parser.add_argument("--scene", default="Beechwood_0_int", metavar="NAME", help="house (default: Beechwood_0_int)")
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="seed of where unplaced things are (default: 0)"
    )
    parser.add_argument(
        "--place",
        action="append",
        default=[],
        metavar="'THING on PLACE'",
        help="where something is, such as 'mug on desk@private_office'; repeatable",
    )
    who = parser.add_argument_group("who does it")
    who.add_argument("--agent", default="gavel-full", metavar="NAME", help="planning method (default: gavel-full)")
    who.add_argument(
        "--planner", default="classical", metavar="SPEC", help="who proposes plans (default: classical, no model)"
    )
    who.add_argument("--understanding", default="rules", metavar="NAME", help="rules (default), adapter or llm")
    who.add_argument("--prior", default="choice", metavar="NAME", help="choice (default), rsn or uniform")
    who.add_argument(
        "--answer", action="append", default=[], metavar="WORDS", help="answer to the next question; repeatable"
    )
    shown = parser.add_argument_group("what is shown")
    shown.add_argument("--html", type=Path, metavar="FILE", help="write the replay, one page")
    shown.add_argument("--png", type=Path, metavar="FILE", help="write a picture of the house with the drive")
    shown.add_argument("--gif", type=Path, metavar="FILE", help="write the drive as an animation, .gif or .webp")
    shown.add_argument("--json", action="store_true", help="print the record instead, as gavel eval writes it")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    import msgspec
    from rich.console import Console

    from eval.sentence.run import SentenceRun, run_sentence
    from eval.sentence.telling import tell
    from gavel_agents.understanding import Abstention

    console = Console()
    ask = _asking(console, arguments.answer)

    def carry_out(text: str, scene: str, seed: int, places: tuple[str, ...]) -> SentenceRun:
        return run_sentence(
            text,
            scene,
            seed=seed,
            place=places,
            agent=arguments.agent,
            planner=arguments.planner,
            understanding=arguments.understanding,
            prior=arguments.prior,
            ask=ask,
        )

    sentence = " ".join(arguments.sentence).strip()
    if not arguments.sentence:
        from eval.sentence.shell import Shell

        Shell(carry_out, console, arguments.scene, arguments.seed, tuple(arguments.place)).loop()
        return 0
    try:
        found = carry_out(sentence, arguments.scene, arguments.seed, tuple(arguments.place))
    except Abstention as error:
        print(f"gavel run: not understood: {error}", file=sys.stderr)
        return 2
    if arguments.json:
        print(msgspec.json.encode(found.record).decode())
    else:
        tell(found, console)
    found.save(html=arguments.html, png=arguments.png, gif=arguments.gif)
    for file in (arguments.html, arguments.png, arguments.gif):
        if file is not None and not arguments.json:
            console.print(f"[dim]{file}[/dim]", highlight=False)
    return 0 if found.success else 1


def _asking(console: Console, answers: list[str]) -> Ask:
    """Return what answers questions: the answers given, then the person at the terminal if there is one."""
    from eval.sentence.telling import chosen, tell_question
    from gavel_agents.understanding import Question

    left = list(answers)

    def ask(question: Question) -> str | None:
        if left:
            return chosen(question, left.pop(0))
        tell_question(question, console)
        if not sys.stdin.isatty():
            return None
        try:
            return chosen(question, input("> "))
        except EOFError:
            return None

    return ask
