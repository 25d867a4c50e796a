"""The prompt of `gavel run` without a sentence: one sentence after the other, each in the house as it stands."""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from rich.console import Console
from rich.text import Text

from eval.sentence.run import SentenceRun
from eval.sentence.telling import tell, tell_plan, tell_why
from gavel_agents.verification import Verified
from gavel_env.errors import BadOption, GavelError
from gavel_env.house.scenes import load_scene, scene_names

__all__ = ["HELP", "Shell", "history_file"]

HELP = """Write what to do, in words. Commands:
  :plan               the plan of the last sentence, with its repairs
  :why                what was believed, repaired, searched and found
  :verify [FILE]      check the last plan, or the plan in a file, against the last sentence
  :map                picture of the house with the last drive
  :html FILE          replay of the last drive; :png and :gif likewise
  :scene [NAME]       go to another house, or list them
  :seed N             put things elsewhere
  :place THING on PLACE    say where something is; :place alone forgets what was said
  :help, :quit"""

_PROMPT = "gavel> "


def history_file() -> Path:
    """Return where what is typed is kept between sessions."""
    base = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(base) / "gavel" / "history"


class Shell:
    """Reads sentences and commands until the end."""

    def __init__(
        self,
        carry_out: Callable[[str, str, int, tuple[str, ...]], SentenceRun],
        console: Console,
        scene: str,
        seed: int,
        places: tuple[str, ...] = (),
    ) -> None:
        """Begin in a house.

        Args:
            carry_out: what is done with a sentence, a scene, a seed and places.
            console: where things are told.
            scene: name of the house.
            seed: of what is drawn.
            places: where things are said to be.
        """
        self._carry_out = carry_out
        self._console = console
        self._scene, self._seed, self._places = scene, seed, places
        self._last: SentenceRun | None = None
        self._commands: dict[str, Callable[[str], None]] = {
            "plan": lambda _: tell_plan(self._run(), console),
            "why": lambda _: tell_why(self._run(), console),
            "verify": self._verify,
            "map": self._map,
            "html": lambda file: self._save("html", file),
            "png": lambda file: self._save("png", file),
            "gif": lambda file: self._save("gif", file),
            "scene": self._go_to,
            "seed": self._reseed,
            "place": self._put,
            "help": lambda _: console.print(HELP, highlight=False),
        }

    def loop(self) -> None:
        """Read until the end of the input, or `:quit`."""
        self._console.print(f"[bold]{self._scene}[/bold]: what should be done? [dim]:help for commands[/dim]")
        with _history():
            while (line := self._read()) is not None and line not in (":quit", ":q", ":exit"):
                if line:
                    self.take(line)

    def _read(self) -> str | None:
        try:
            return input(_PROMPT if sys.stdin.isatty() else "").strip()
        except EOFError:
            return None

    def take(self, line: str) -> None:
        """Do what one line says; what is wrong with it is said, and nothing is lost."""
        try:
            if line.startswith(":"):
                name, _, argument = line[1:].partition(" ")
                if name not in self._commands:
                    raise BadOption(f"no command {name!r}; :help lists them")
                self._commands[name](argument.strip())
            else:
                self._last = self._carry_out(line, self._scene, self._seed, self._places)
                tell(self._last, self._console)
        except GavelError as error:
            self._console.print(Text(str(error), style="red"))

    def _run(self) -> SentenceRun:
        if self._last is None:
            raise BadOption("nothing has been done yet")
        return self._last

    def _verify(self, file: str) -> None:
        run = self._run()
        if file:
            try:
                found = run.verify(Path(file).read_text("utf-8"))
            except (OSError, UnicodeDecodeError) as error:
                raise BadOption(f"plan {file} cannot be read: {error}") from error
            self._tell_verified(found)
            return
        for task in run.record.trace.tasks:
            self._console.print(Text(f"{task.text}: {task.verdict}"))

    def _tell_verified(self, found: Verified) -> None:
        self._console.print(Text("valid" if found.valid else found.complaint or "not valid; repaired so:"))
        for edit in found.edits:
            self._console.print(Text(f"  {edit}"))

    def _map(self, _: str) -> None:
        path = Path(tempfile.gettempdir()) / f"gavel-{self._scene_name()}.png"
        if self._last is not None:
            self._last.save(png=path)
        else:
            from gavel_env.render import draw_scene, save_png

            save_png(draw_scene(load_scene(self._scene)), path)
        self._console.print(f"[link={path.as_uri()}]{path.as_uri()}[/link]", highlight=False)

    def _scene_name(self) -> str:
        return Path(self._scene).stem

    def _save(self, kind: str, file: str) -> None:
        if not file:
            raise BadOption(f"write :{kind} FILE")
        run = self._run()
        run.save(**{kind: file})
        self._console.print(Text(file))

    def _go_to(self, scene: str) -> None:
        if not scene:
            self._console.print(", ".join(scene_names()), highlight=False)
            return
        load_scene(scene)
        self._scene, self._last = scene, None

    def _reseed(self, number: str) -> None:
        if not number.isdecimal():
            raise BadOption(f"a seed is a whole number, not {number!r}")
        self._seed = int(number)

    def _put(self, place: str) -> None:
        self._places = (*self._places, place) if place else ()


@contextlib.contextmanager
def _history() -> Iterator[None]:
    """Keep what is typed on a terminal, where the system can."""
    try:
        import readline
    except ImportError:
        yield
        return
    path = history_file()
    keep = sys.stdin.isatty()
    if keep:
        with contextlib.suppress(OSError):
            readline.read_history_file(path)
    try:
        yield
    finally:
        if keep:
            with contextlib.suppress(OSError):
                path.parent.mkdir(parents=True, exist_ok=True)
                readline.set_history_length(1000)
                readline.write_history_file(path)
