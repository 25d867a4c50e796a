"""Actions and states of one's own: rows that users add to the table of primitives.

An `OwnAction` is a name with parameters, what it needs (by the names of the checks that the nine use, as states, or as
functions), what it makes true, and hints for repair. Once it is registered, validation, repair, the parser, prompts and
PDDL export know it. The nine primitives, and what iterates over them, stay as they are.

    own_state("filled")
    POUR = register_action(OwnAction("POUR", ("x", "y"), needs=("holding(x)", "filled(x)", "near(y)", "interior(y)"),
                                     effects=("filled(y)", "not filled(x)")))
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from gavel_env.errors import BadOwnAction, nearest_names
from gavel_env.world_model import actions, goals
from gavel_env.world_model import dynamics as d
from gavel_env.world_model.actions import Primitive
from gavel_env.world_model.dynamics import Check, OwnRule, Violation, ViolationKind
from gavel_env.world_model.goals import Predicate
from gavel_env.world_model.graph import OWN_FLAGS, Flag, Relation, SceneGraph, all_flags
from gavel_env.world_model.open_enums import add_member, remove_member

__all__ = [
    "CHECKS",
    "Need",
    "OwnAction",
    "own_action",
    "own_actions",
    "own_state",
    "register_action",
    "registered",
    "unregister_action",
]

Function = Callable[..., "str | None"]
"""A precondition of one's own: (graph, *arguments) -> what is missing, in a few words, or None."""

CHECKS: Mapping[str, Check | None] = {
    "near": d.near,
    "accessible": d.accessible,
    "graspable": d.graspable,
    "surface": d.surface,
    "interior": d.interior,
    "door": d.door,
    "switch": d.switch,
    "opened": d.opened,
    "hand_free": d.hand_free,
    "holding": None,
    "on_top": None,
    "inside": None,
}
"""What a precondition may say beside states, each of one parameter, but for `on_top(x, y)` and `inside(x, y)`. `opened`
holds of what has no door; `hand_free` is of any parameter."""


class Need(NamedTuple):
    """A precondition or an effect, `not filled(x)`; or a function.

    Attributes:
        name: of the check or state; empty for a function.
        parameters: what it is said of.
        negated: for states.
        function: or None.
    """

    name: str
    parameters: tuple[str, ...]
    negated: bool = False
    function: Function | None = None

    @property
    def text(self) -> str:
        """Return it as it is written; of a function, its name."""
        if self.function is not None:
            return getattr(self.function, "__name__", "function").replace("_", " ")
        return f"{'not ' * self.negated}{self.name}({', '.join(self.parameters)})"

    def of(self, values: Mapping[str, str]) -> Need:
        """Return it with parameters replaced by things."""
        return self._replace(parameters=tuple(values.get(p, p) for p in self.parameters))


@dataclass(frozen=True)
class OwnAction:
    """An action of one's own.

    Attributes:
        name: in capitals, `POUR`.
        parameters: their names; the first is `Action.target`, the others `Action.others`. May be empty.
        needs: preconditions, in the order in which their violations are reported: `"near(x)"`, `"not dirty(x)"`, or a
            function. That every argument is a thing of the graph is asked first.
        effects: states that it makes true or untrue: `"filled(y)"`, `"not dirty(x)"`. Repair and PDDL go by these.
        effect: what else it does, (graph, *arguments) -> graph, after `effects`. Repair does not foresee it, and PDDL
            cannot say it.
        words: other verbs for it.
        says: what it does, for prompts; default made from needs and effects.
        hints: need as it is written -> steps that bring it about (`{"rag_in_hand": ("GRASP(rag_0)",)}`); what they
            must be near is approached. Without a hint, repair looks for the need among the effects.
    """

    name: str
    parameters: tuple[str, ...] = ("x",)
    needs: tuple[str | Function, ...] = ()
    effects: tuple[str, ...] = ()
    effect: Callable[..., SceneGraph] | None = None
    words: tuple[str, ...] = ()
    says: str = ""
    hints: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def preconditions(self) -> tuple[Need, ...]:
        """The needs, read."""
        return tuple(self._need(need) for need in self.needs)

    @property
    def makes(self) -> tuple[Need, ...]:
        """The effects, read."""
        return tuple(self._need(effect) for effect in self.effects)

    def _need(self, text: str | Function) -> Need:
        if not isinstance(text, str):
            return Need("", self.parameters, function=text)
        match = _NEED.match(text)
        if match is None:
            raise BadOwnAction(f"action {self.name}: {text!r} is not of the form name(x) or not name(x)")
        parameters = tuple(p for p in re.split(r"\s*,\s*", match[3].strip()) if p)
        return Need(match[2], parameters, match[1] is not None)

    @property
    def contract(self) -> str:
        """What it needs, in words."""
        return ", ".join(need.text for need in self.preconditions) or "nothing"

    @property
    def prompt_line(self) -> str:
        """Return the line that tells a planner of it."""
        says = self.says or f"makes {' and '.join(self.effects)}"
        return f"{' '.join((self.name, ', '.join(self.parameters))).strip()}: {says}. Needs: {self.contract}."


_NEED = re.compile(r"^\s*(not\s+)?([a-z][a-z_]*)\s*\(([^()]*)\)\s*$")
_NAME = re.compile(r"[A-Z][A-Z_]*")
_OWN: dict[Primitive, OwnAction] = {}


def own_state(name: str) -> Flag:
    """Return the state of a name, made if it is new; things may have it, and goals ask for it: `filled(beaker)`.

    Raises:
        BadOwnAction: the name is that of a relation or a check, or cannot be written.
    """
    if name in Predicate._value2member_map_ and Predicate(name).flag is not None:
        return Flag[name.upper()]
    if not re.fullmatch(r"[a-z][a-z_]*", name) or name in CHECKS or name in goals.PREDICATES:
        raise BadOwnAction(f"{name!r} cannot be a state: small letters and _, and not the name of a relation or check")
    flag = add_member(Flag, name.upper(), len(all_flags()))
    predicate = add_member(Predicate, name.upper(), name)
    OWN_FLAGS.append(flag)
    goals.add_state(predicate, flag)
    return flag


def register_action(action: OwnAction) -> Primitive:
    """Add an action to the table, for this process; the same one again is not a change.

    Raises:
        BadOwnAction: its name is taken or cannot be written, or it speaks of a check, state or parameter that is not
            known; with the nearest names.
    """
    known = next((p for p, own in _OWN.items() if own.name == action.name), None)
    if known is not None and _OWN[known] == action:
        return known
    _check(action)
    primitive = add_member(Primitive, action.name, max([*Primitive, *_OWN]) + 1)
    _OWN[primitive] = action
    actions.add_primitive(primitive, action.parameters, action.words)
    d.OWN_RULES[primitive] = _rule(action)
    return primitive


def unregister_action(name: str) -> None:
    """Take an action of one's own out of the table; no name, no change. States stay."""
    for primitive in [p for p, own in _OWN.items() if own.name == name]:
        del _OWN[primitive], d.OWN_RULES[primitive]
        actions.remove_primitive(primitive)
        remove_member(Primitive, primitive)


@contextlib.contextmanager
def registered(*own: OwnAction) -> Iterator[tuple[Primitive, ...]]:
    """Register actions for the length of a `with` block."""
    done: list[Primitive] = []
    try:
        for action in own:
            done.append(register_action(action))
        yield tuple(done)
    finally:
        for action in own[: len(done)]:
            unregister_action(action.name)


def own_actions() -> tuple[OwnAction, ...]:
    """Return the actions of one's own, in the order in which they were registered."""
    return tuple(_OWN.values())


def own_action(primitive: Primitive) -> OwnAction | None:
    """Return the action of one's own that a primitive is; None for the nine."""
    return _OWN.get(primitive)


def _check(action: OwnAction) -> None:
    here = f"action {action.name}"
    if not _NAME.fullmatch(action.name):
        raise BadOwnAction(f"{here}: a name is written in capitals and _")
    for word in (action.name, *action.words):
        taken = actions.primitive_of(word)
        if taken is not None:
            raise BadOwnAction(f"{here}: {word!r} is taken by {taken.name}")
    if len(set(action.parameters)) < len(action.parameters) or not all(p.isidentifier() for p in action.parameters):
        raise BadOwnAction(f"{here}: parameters are different names, not {action.parameters}")
    states = {flag.name.lower() for flag in all_flags()}
    for need, is_effect in [(n, False) for n in action.preconditions] + [(n, True) for n in action.makes]:
        if need.function is not None:
            continue
        known = states if is_effect else {*CHECKS, *states}
        if need.name not in known:
            near = nearest_names(need.name, known)
            hint = f"a new state needs own_state({need.name!r})"
            hint = f"did you mean {' or '.join(near)}? {hint}" if near else hint
            raise BadOwnAction(f"{here}: {need.text!r} is neither check nor state; {hint}")
        if need.negated and need.name not in states:
            raise BadOwnAction(f"{here}: {need.text!r}: only states can be negated")
        count = 2 if need.name in ("on_top", "inside") else 1
        if len(need.parameters) != count or not set(need.parameters) <= set(action.parameters):
            raise BadOwnAction(f"{here}: {need.text!r} takes {count} of the parameters {', '.join(action.parameters)}")


# --- what it does ----------------------------------------------------------------------------------------------------


def _rule(action: OwnAction) -> OwnRule:
    """Return the row of the table: the first or all violations, and the effect, of an action's arguments."""
    checks = [_checked(need) for need in action.preconditions]
    makes = [(Flag[need.name.upper()], need.parameters[0], not need.negated) for need in action.makes]

    def violations(graph: SceneGraph, arguments: Sequence[str]) -> Iterator[Violation]:
        unknown = False
        for x in arguments:
            violation = d.known(graph, x)
            if violation is not None:
                unknown = True
                yield violation
        if unknown:
            return
        values = dict(zip(action.parameters, arguments, strict=True))
        for check in checks:
            violation = check(graph, values)
            if violation is not None:
                yield violation

    def effect(graph: SceneGraph, arguments: Sequence[str]) -> SceneGraph:
        values = dict(zip(action.parameters, arguments, strict=True))
        for flag, parameter, value in makes:
            graph = graph.with_flag(flag, frozenset((values[parameter],)), value=value)
        return graph if action.effect is None else action.effect(graph, *arguments)

    return OwnRule(violations, effect)


def _checked(need: Need) -> Callable[[SceneGraph, Mapping[str, str]], Violation | None]:
    def check(graph: SceneGraph, values: Mapping[str, str]) -> Violation | None:
        return violation_of(graph, need.of(values))

    return check


def violation_of(graph: SceneGraph, need: Need) -> Violation | None:
    """Return how a need of some things is violated in a graph, or None if it holds."""
    subject = need.parameters[0] if need.parameters else ""
    if need.function is not None:
        missing = need.function(graph, *need.parameters)
        return None if missing is None else Violation(d.PRECONDITION, subject, missing)
    check = CHECKS.get(need.name)
    if check is not None:
        return check(graph, subject)
    if need.name == "holding":
        if graph.holding == subject:
            return None
        if graph.holding is None:
            return Violation(ViolationKind.HAND_EMPTY, subject)
        return Violation(ViolationKind.HAND_FULL, subject, graph.holding)
    if need.name in ("on_top", "inside"):
        relation = Relation.ON_TOP if need.name == "on_top" else Relation.INSIDE
        holds = graph.supports.get(subject) == (relation, need.parameters[1])
    else:
        holds = graph.has(Flag[need.name.upper()], subject) != need.negated
    return None if holds else Violation(d.PRECONDITION, subject, need.text)
