"""Members that users add to an enumeration: known by name and by value, never among those that iteration yields.

The primitives, states, predicates and violations of the paper are closed sets: tables, spaces and prompts are made of
them. What a user adds must be of the same type, and leave those as they are.
"""

from __future__ import annotations

import enum
from typing import Any, TypeVar

__all__ = ["add_member", "remove_member"]

E = TypeVar("E", bound=enum.Enum)


def add_member(cls: type[E], name: str, value: Any) -> E:
    """Return a new member of an enumeration, found by `cls[name]` and `cls(value)`, but not iterated over."""
    member: E = int.__new__(cls, value) if issubclass(cls, int) else object.__new__(cls)
    member._name_ = name
    member._value_ = value
    cls._value2member_map_[value] = member
    cls._member_map_[name] = member
    return member


def remove_member(cls: type[E], member: E) -> None:
    """Forget a member that was added."""
    cls._value2member_map_.pop(member.value, None)
    cls._member_map_.pop(member.name, None)
