"""Actions of one's own in PDDL: lifted, for the household domain, and grounded, for the export of one state."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from gavel_env.errors import NotExpressible
from gavel_env.world_model.actions import Action, primitive_of
from gavel_env.world_model.dynamics import known
from gavel_env.world_model.graph import OWN_FLAGS, Flag, SceneGraph
from gavel_env.world_model.own_actions import Need, OwnAction, own_actions, violation_of

__all__ = ["GroundedOwn", "grounded_own_actions", "with_own_actions"]

_FORMS: Mapping[str, str] = {
    "near": "(near {0})",
    "accessible": "(forall (?d - thing ?c - thing) (or (not (aboard {0} ?d)) (not (inside ?d ?c)) (not (shut ?c))))",
    "graspable": "(loose {0})",
    "surface": "(surface {0})",
    "interior": "(interior {0})",
    "door": "(door {0})",
    "switch": "(switch {0})",
    "opened": "(not (shut {0}))",
    "hand_free": "(hand-empty)",
    "holding": "(holding {0})",
    "on_top": "(on-top {0} {1})",
    "inside": "(inside {0} {1})",
}
_STATIC = ("graspable", "surface", "interior", "door", "switch", "on_top", "inside")


def with_own_actions(domain: str) -> str:
    """Return the household domain with the registered actions and states of one's own.

    Raises:
        NotExpressible: a need is a function, or an effect is.
    """
    if not own_actions() and not OWN_FLAGS:
        return domain
    states = " ".join(f"({_state(flag)} ?x - thing)" for flag in OWN_FLAGS)
    body = domain.rstrip().removesuffix(")")
    if states:
        body = body.replace("(dirty ?x - thing))", f"(dirty ?x - thing) {states})", 1)
    return body + "\n".join(map(_lifted, own_actions())) + "\n)\n"


def _state(flag: Flag) -> str:
    return "opened" if flag is Flag.OPEN else flag.name.lower().replace("_", "-")


def _lifted(own: OwnAction) -> str:
    parameters = " ".join(f"?{p} - thing" for p in own.parameters)
    needs = [_condition(own, need) for need in own.preconditions]
    effects = [effect for made in _makes(own) for effect in _effects(made)]
    return (
        f"\n(:action {own.name.lower().replace('_', '-')}\n  :parameters ({parameters})\n"
        f"  :precondition (and {' '.join(needs)})\n  :effect (and {' '.join(effects)}))"
    )


def _makes(own: OwnAction) -> tuple[Need, ...]:
    if own.effect is not None:
        raise NotExpressible(f"action {own.name}: its effect is a function, which PDDL cannot say")
    return own.makes


def _condition(own: OwnAction, need: Need) -> str:
    if need.function is not None:
        raise NotExpressible(f"action {own.name}: {need.text!r} is a function, which PDDL cannot say")
    variables = [f"?{p}" for p in need.parameters]
    form = _FORMS.get(need.name)
    if form is not None:
        return form.format(*variables)
    fact = f"({_state(Flag[need.name.upper()])} {variables[0]})"
    return f"(not {fact})" if need.negated else fact


def _effects(made: Need) -> Iterator[str]:
    x = f"?{made.parameters[0]}"
    flag = Flag[made.name.upper()]
    fact = f"({_state(flag)} {x})"
    yield f"(not {fact})" if made.negated else fact
    if flag is Flag.OPEN:
        yield f"(when (door {x}) (shut {x}))" if made.negated else f"(not (shut {x}))"


class GroundedOwn(NamedTuple):
    """A step of one's own that can be asked in one state, as facts.

    Attributes:
        action: the step.
        accessible: what must not be shut away.
        needs: further facts.
        adds, deletes: facts.
    """

    action: Action
    accessible: tuple[str, ...]
    needs: tuple[str, ...]
    adds: tuple[str, ...]
    deletes: tuple[str, ...]


def grounded_own_actions(graph: SceneGraph, objects: Sequence[str]) -> Iterator[GroundedOwn]:
    """Yield every step of one's own whose static needs hold, in STRIPS.

    Raises:
        NotExpressible: a need or an effect is a function, or a need is that a state does not hold: STRIPS knows no
            negation (of doors it knows `shut`).
    """
    for own in own_actions():
        primitive = primitive_of(own.name)
        makes = _makes(own)
        for need in own.preconditions:
            _condition(own, need)
            if need.negated and need.name != "open":
                raise NotExpressible(f"action {own.name}: {need.text!r} is a negation, which STRIPS cannot say")
        assert primitive is not None
        for arguments in itertools.product(objects, repeat=len(own.parameters)):
            values = dict(zip(own.parameters, arguments, strict=True))
            needs = [need.of(values) for need in own.preconditions]
            static = [need for need in needs if need.name in _STATIC]
            if any(known(graph, x) for x in arguments) or any(violation_of(graph, n) for n in static):
                continue
            adds, deletes = _grounded_effects(graph, [made.of(values) for made in makes])
            yield GroundedOwn(
                Action(primitive, arguments[0] if arguments else None, arguments[1:]),
                tuple(n.parameters[0] for n in needs if n.name == "accessible"),
                tuple(fact for n in needs for fact in _grounded(graph, n)),
                adds,
                deletes,
            )


def _grounded(graph: SceneGraph, need: Need) -> Iterator[str]:
    x = need.parameters[0] if need.parameters else ""
    if need.name in _STATIC or need.name == "accessible":
        return
    if need.name == "opened" or (need.name == "open" and need.negated):
        if graph.category(x).openable:
            yield f"({'shut' if need.negated else 'open'} {x})"
    elif need.name == "hand_free":
        yield "(hand-empty)"
    else:
        yield f"({need.name} {x})"


def _grounded_effects(graph: SceneGraph, makes: Sequence[Need]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    adds: list[str] = []
    deletes: list[str] = []
    for made in makes:
        x = made.parameters[0]
        (deletes if made.negated else adds).append(f"({made.name} {x})")
        if made.name == "open" and graph.category(x).openable:
            (adds if made.negated else deletes).append(f"(shut {x})")
    return tuple(adds), tuple(deletes)
