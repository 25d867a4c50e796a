"""Instruction files: JSON Lines, one certified (or yet uncertified) instruction per line (docs/howto/instructions.md).

An instruction says the scene, the sentence, where the movables are placed, and its tasks: each with its own sentence,
goal literals and reference plan as text actions.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any, Literal, NamedTuple

import msgspec

from gavel_env.data import convert, decode, read_bytes, shipped_data
from gavel_env.errors import GavelError, InstructionError, UnknownInstruction
from gavel_env.world_model.actions import Action, parse_action
from gavel_env.world_model.conditions import Formula
from gavel_env.world_model.goals import Goal, parse_goal

__all__ = [
    "Instruction",
    "InstructionSet",
    "Placement",
    "Rejected",
    "TaskSpec",
    "read_instructions",
    "scene_beside",
    "scene_from",
    "shipped",
    "shipped_instructions",
]


_LONGEST_NAME = 250
_LONGEST_TEXT = 20_000


class Placement(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """One movable and where it starts.

    Attributes:
        category: name in the ontology.
        relation: on / in a piece, or on the floor of a room (`target` is then a room id or type).
        target: instance id, or designator; of several that fit, the first in the scene's order.
        id: instance id to use; default `<category>_<next free index>`.
        states: flags that hold at the start, such as `frozen`.
    """

    category: str
    relation: Literal["on", "in", "floor"]
    target: str
    id: str | None = None
    states: tuple[str, ...] = ()


class TaskSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A task I_i: sentence, goal literals g_i and reference plan, each in text form.

    `conditions` are what literals cannot say (docs/reference/behavior.md), in JSON form; both must hold.
    """

    text: str
    goal: tuple[str, ...]
    reference_plan: tuple[str, ...]
    conditions: tuple[Formula, ...] = ()

    def parsed_goal(self) -> Goal:
        """Return g_i."""
        return _goal(self.goal, self.conditions)

    def parsed_plan(self) -> tuple[Action, ...]:
        """Return the reference plan."""
        return _plan(self.reference_plan)


@lru_cache(maxsize=4096)
def _goal(literals: tuple[str, ...], conditions: tuple[Formula, ...]) -> Goal:
    return Goal(parse_goal(literals).literals, conditions)


@lru_cache(maxsize=4096)
def _plan(steps: tuple[str, ...]) -> tuple[Action, ...]:
    return tuple(map(parse_action, steps))


class Instruction(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """An instruction I.

    Attributes:
        id: unique in its file.
        scene: name of a shipped scene, or path of a scene file; in an instruction file, within that file's folder.
        text: the sentence(s) the agent reads.
        placements: movables added to the scene.
        tasks: the independent tasks that make it up (one for single-task instructions).
        kind: "single", "multi" or "behavior".
        initial: states of the scene's own pieces at the start, as literals (`open(fridge_0)`), and what lies beside or
            under what (`next_to(ball_0, sofa_0)`).
        meta: free notes of the generator (template, seed, difficulty knobs); never shown to agents.
    """

    id: str
    scene: str
    text: str
    placements: tuple[Placement, ...]
    tasks: tuple[TaskSpec, ...]
    kind: Literal["single", "multi", "behavior"] = "single"
    initial: tuple[str, ...] = ()
    meta: Mapping[str, Any] = {}

    def goal(self) -> Goal:
        """Return g, the union of the tasks' goals."""
        union = Goal()
        for task in self.tasks:
            union = union | task.parsed_goal()
        return union

    def reference_plan(self) -> tuple[Action, ...]:
        """Return the tasks' reference plans in the order written."""
        return tuple(action for task in self.tasks for action in task.parsed_plan())


class Rejected(NamedTuple):
    """A line that could not be read, and why."""

    line: int
    reason: str


class InstructionSet(Mapping[str, Instruction]):
    """The instructions of a file by id, the lines that were rejected, and the content stamp."""

    def __init__(self, records: Iterable[Instruction], rejected: Iterable[Rejected], stamp: str, source: str) -> None:
        self._records = {r.id: r for r in records}
        self.rejected = tuple(rejected)
        self.stamp = stamp
        self.source = source

    def __getitem__(self, instruction_id: str) -> Instruction:
        """Return the instruction.

        Raises:
            UnknownInstruction: with the nearest ids.
        """
        try:
            return self._records[instruction_id]
        except KeyError:
            raise UnknownInstruction(instruction_id, self._records, self.source) from None

    def __contains__(self, instruction_id: object) -> bool:
        return instruction_id in self._records

    def __iter__(self) -> Iterator[str]:
        return iter(self._records)

    def __len__(self) -> int:
        return len(self._records)


def parse_instruction(line: str | bytes | Mapping[str, Any] | Instruction, place: str) -> Instruction:
    """Read one record and check that its goals and plans parse.

    Raises:
        InstructionError: names the place, the field and the value.
    """
    try:
        if isinstance(line, Instruction):
            record = line
        elif isinstance(line, str | bytes):
            record = decode(line, Instruction)
        else:
            record = convert(line, Instruction)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InstructionError(f"{place}: malformed instruction: {error}") from error
    _check_texts(record, place)
    if not record.tasks:
        raise InstructionError(f"{place}: instruction {record.id!r} has no tasks")
    if record.kind == "single" and len(record.tasks) > 1:
        raise InstructionError(
            f"{place}: instruction {record.id!r} has {len(record.tasks)} tasks and the kind 'single'; expected 'multi'"
        )
    for index, task in enumerate(record.tasks):
        try:
            task.parsed_goal()
            task.parsed_plan()
        except GavelError as error:
            raise InstructionError(f"{place}: instruction {record.id!r}, tasks[{index}]: {error}") from error
        if not task.goal and not task.conditions:
            raise InstructionError(f"{place}: instruction {record.id!r}, tasks[{index}]: goal has no literals")
    return record


def _check_texts(record: Instruction, place: str) -> None:
    """Check that id, scene and sentences can be shown, written and looked up."""
    for field, value in (("id", record.id), ("scene", record.scene)):
        if not value.strip() or len(value) > _LONGEST_NAME or not value.isprintable():
            wanted = f"expected 1 to {_LONGEST_NAME} characters that print"
            raise InstructionError(f"{place}: the {field} {value[:80]!r} cannot be used; {wanted}")
    for field, value in (("text", record.text), *((f"tasks[{i}].text", t.text) for i, t in enumerate(record.tasks))):
        if not value.strip() or len(value) > _LONGEST_TEXT:
            raise InstructionError(
                f"{place}: instruction {record.id!r}: {field} has {len(value)} characters; expected words, "
                f"at most {_LONGEST_TEXT} characters"
            )


def scene_beside(record: Instruction, folder: Path, place: str) -> Instruction:
    """Return a record of a file, its scene's path from where the process is.

    A file that somebody else wrote must not make anybody read what lies elsewhere, nor say whether it is there.

    Args:
        record: as read; a scene that is not a `.json` file has a name and stays as it is.
        folder: in which the instruction file lies.
        place: of the line, for errors.

    Raises:
        InstructionError: the path leaves the folder, by `..`, from the root, or through a link.
    """
    if not record.scene.endswith(".json"):
        return record
    path = PurePosixPath(record.scene)
    written = PureWindowsPath(record.scene)
    if written.anchor or path.is_absolute() or ".." in (*path.parts, *written.parts):
        inside = False
    else:
        inside = (folder / path).resolve().is_relative_to(folder.resolve())
    if not inside:
        raise InstructionError(
            f"{place}: instruction {record.id!r}: the scene {record.scene[:80]!r} lies outside the folder of the "
            "instruction file; expected a path within it, such as 'my_house.json', or the name of a shipped scene"
        )
    return msgspec.structs.replace(record, scene=str(folder / path))


def scene_from(record: Instruction, folder: Path) -> Instruction:
    """Return a record as a file in a folder must have it: with its scene's path from there (see `scene_beside`).

    Raises:
        InstructionError: the scene file lies outside the folder.
    """
    if not record.scene.endswith(".json"):
        return record
    path = Path(record.scene).resolve()
    if not path.is_relative_to(folder.resolve()):
        raise InstructionError(
            f"the scene file {record.scene} lies outside {folder}, the folder of the instruction file, and would not be"
            " read from there; copy it into that folder, or write the instructions beside it"
        )
    return msgspec.structs.replace(record, scene=path.relative_to(folder.resolve()).as_posix())


def read_instructions(path: str | Path) -> InstructionSet:
    """Read an instruction file; bad lines and repeated ids are rejected with their reason, the others kept.

    Paths of scene files are those from the file's folder, and stay within it.

    Raises:
        InstructionError: the file cannot be read, or holds no good line.
    """
    content = read_bytes(path, "instruction file", InstructionError)
    records: dict[str, Instruction] = {}
    rejected: list[Rejected] = []
    for number, line in enumerate(content.splitlines(), start=1):
        if not line.strip():
            continue
        try:
            record = parse_instruction(line, f"{path}:{number}")
            record = scene_beside(record, Path(path).parent, f"{path}:{number}")
        except InstructionError as error:
            rejected.append(Rejected(number, str(error)))
            continue
        if record.id in records:
            rejected.append(Rejected(number, f"{path}:{number}: the id {record.id!r} stands twice"))
            continue
        records[record.id] = record
    if not records:
        first = f"; line {rejected[0].line}: {rejected[0].reason}" if rejected else ""
        raise InstructionError(f"instruction file {path} holds no instruction{first}")
    return InstructionSet(records.values(), rejected, hashlib.sha256(content).hexdigest()[:16], str(path))


def shipped_instructions() -> Iterator[Instruction]:
    """Yield the instructions of every benchmark: `single`, `multi` and `behavior`."""
    for name in ("single", "multi", "behavior"):
        yield from read_instructions(shipped(name)).values()


def shipped(name: str) -> Path:
    """Return the path of a shipped instruction file by name (`single`, `multi`, ...).

    Raises:
        UnknownInstruction: no such file; the message lists those that exist.
    """
    known = {path.stem: path for path in shipped_data("instructions").glob("*.jsonl")}
    if name not in known:
        raise UnknownInstruction(name, known, "the shipped instruction files")
    return known[name]
