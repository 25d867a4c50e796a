"""What passes between the runner and an agent's process, and how: pickles, of which only data is read back."""

from __future__ import annotations

import io
import pickle
import struct
from typing import Any, BinaryIO, NamedTuple

from gavel_env.world_model.ontology import Category, default_ontology

__all__ = ["LENGTH", "Asked", "Ended", "Made", "Observations", "receive", "send"]

LENGTH = struct.Struct("<Q")
_MOST_BYTES = 1 << 30


class Asked(NamedTuple):
    """What an agent wants of its model or its understanding."""

    what: str
    arguments: tuple[Any, ...]


class Ended(NamedTuple):
    """What a call of the agent came to; `failed` is the class of what it raised, `trace` the agent's own."""

    value: Any
    failed: str = ""
    trace: Any = None


class Made(NamedTuple):
    """What came of making an agent: it is not known here, it sees hidden state, or it is ready."""

    known: bool
    privileged: bool = False


_OURS = (
    __name__,
    "gavel_agents.agent",
    "gavel_agents.llm.interface",
    "gavel_env.exchange",
    "gavel_env.frozen",
    "gavel_env.instructions.lookup",
    "gavel_env.world_model.",
)
"""Modules whose classes hold data and do nothing when they are made."""


class _Unpickler(pickle.Unpickler):
    """Reads what an agent's process sends: data of this project and of numpy, and no function but their makers'."""

    def find_class(self, module: str, name: str) -> Any:
        found = super().find_class(module, name) if _is_data(module, name) else None
        if found is None or (module.startswith(_OURS) and not isinstance(found, type) and name != "frozen"):
            raise pickle.UnpicklingError(f"an agent's process sent {module}.{name}")
        return found

    def persistent_load(self, name: Any) -> Category:
        return default_ontology()[str(name)]


def _is_data(module: str, name: str) -> bool:
    package = module.partition(".")[0]
    if package == "numpy":
        return name in ("ndarray", "dtype", "scalar", "_reconstruct", "_frombuffer")
    if package == "builtins":
        return name in ("set", "frozenset", "complex", "bytearray", "slice")
    if package == "msgspec":
        return name == "rebuild"
    return module.startswith(_OURS)


class _Pickler(pickle.Pickler):
    """Writes categories of the shipped ontology, of which every observation is full, by their names."""

    def persistent_id(self, thing: Any) -> str | None:
        if type(thing) is Category and default_ontology().get(thing.name) is thing:
            return thing.name
        return None


class Observations(pickle.Unpickler):
    """Reads what the runner sends."""

    def persistent_load(self, name: Any) -> Category:
        """Return a category of the shipped ontology."""
        return default_ontology()[name]


def send(file: BinaryIO, message: Any) -> None:
    """Write a message with its length before it."""
    packed = io.BytesIO()
    _Pickler(packed, pickle.HIGHEST_PROTOCOL).dump(message)
    content = packed.getvalue()
    file.write(LENGTH.pack(len(content)) + content)
    file.flush()


def receive(file: BinaryIO) -> Any:
    """Return the next message.

    Raises:
        EOFError: there is none any more.
        pickle.UnpicklingError: it is none.
    """
    head = file.read(LENGTH.size)
    if len(head) < LENGTH.size:
        raise EOFError
    (length,) = LENGTH.unpack(head)
    if length > _MOST_BYTES:
        raise pickle.UnpicklingError(f"a message of {length} bytes")
    content = file.read(length)
    if len(content) < length:
        raise EOFError
    return _Unpickler(io.BytesIO(content)).load()
