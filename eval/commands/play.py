"""`gavel play`: carry out an instruction by hand, in words."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

__all__ = ["register"]


def register(subparsers: Any) -> None:
    """Add `gavel play`."""
    play = subparsers.add_parser("play", help="carry out an instruction by hand, in words")
    what = play.add_mutually_exclusive_group()
    what.add_argument("--scene", help="pick an instruction in this scene")
    what.add_argument("--instruction", metavar="ID", help="of the shipped files, or of --file")
    play.add_argument("--file", type=Path, metavar="FILE", help="instruction file (default: the shipped single tasks)")
    play.add_argument("--seed", type=int, default=0, help="which instruction is picked (default: 0)")
    play.add_argument("--map", type=Path, metavar="FILE", help="where `map` draws the house (default: a new file)")
    play.set_defaults(run=_play)


def _play(arguments: argparse.Namespace) -> int:
    game = _game(arguments)
    chosen = {"instruction": arguments.instruction} if arguments.instruction else None
    text, info = game.reset(seed=arguments.seed, options=chosen)
    _complete(game)
    picture = arguments.map or Path(tempfile.mkdtemp(prefix="gavel-")) / "map.png"
    print(f"{info['instruction_id']}\n{text}")
    print("(help: what you can say; commands: what is possible now; map: a picture of the house; quit)")
    while True:
        try:
            said = input("> ").strip()
        except EOFError:
            print()
            break
        if said in ("quit", "exit"):
            break
        if said == "map":
            _draw(game, picture)
        elif said == "commands":
            print("\n".join(f"  {command}" for command in info["admissible_commands"]))
        elif said:
            text, _, terminated, truncated, info = game.step(said)
            print(text)
            if terminated or truncated:
                break
    count = info["commands"]
    print(f"score {info['score']:.0%}, {count} command{'s' if count != 1 else ''}, {info['metres']:.1f} m")
    return 0 if info["won"] else 1


def _game(arguments: argparse.Namespace) -> Any:
    from gavel_env.envs.env import GavelEnv
    from gavel_env.envs.text_game import TextGame
    from gavel_env.instructions.record import read_instructions, shipped

    source: Any = arguments.file or "single"
    if arguments.file is None and arguments.instruction:
        for name in ("single", "multi", "rl", "behavior"):
            if arguments.instruction in read_instructions(shipped(name)):
                source = name
                break
    env = GavelEnv(
        source,
        scenes=arguments.scene,
        on_violation="noop",
        observation="symbolic",
        max_nodes=20_000,
        render_mode="rgb_array",
    )
    return TextGame(env, max_commands=1000)


def _complete(game: Any) -> None:
    """Complete commands with the tab key, where the terminal can."""
    if not sys.stdin.isatty():
        return
    try:
        import readline
    except ImportError:
        return

    def complete(_: str, state: int) -> str | None:
        line = readline.get_line_buffer().lstrip()
        known = [*game.admissible_commands, "look", "inventory", "task", "help", "commands", "map", "quit"]
        fitting = [command for command in known if command.startswith(line)]
        return fitting[state] if state < len(fitting) else None

    readline.set_completer_delims("")
    readline.set_completer(complete)
    readline.parse_and_bind("bind ^I rl_complete" if "libedit" in (readline.__doc__ or "") else "tab: complete")


def _draw(game: Any, path: Path) -> None:
    from gavel_env.render import save_png

    save_png(game.render(), path)
    print(path.resolve().as_uri())
