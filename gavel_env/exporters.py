"""Plans in other projects' forms: OmniGibson's semantic primitives, PDDL plans, behaviour trees for ROS 2.

An export writes down steps; it checks nothing. What was checked of a plan before (`gavel_agents.verify`) is told to the
exporter in a line, which goes into what it writes.
"""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping, Sequence

from gavel_env.errors import NotExpressible
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.own_actions import own_action
from gavel_env.world_model.planning_task import pddl_names

__all__ = ["EXPORTERS", "UNCHECKED", "to_behavior_tree", "to_omnigibson", "to_pddl_plan"]

UNCHECKED = "nothing: the steps were read, not validated"

_STARTER = "StarterSemanticActionPrimitiveSet"
_SYMBOLIC = "SymbolicSemanticActionPrimitiveSet"
_SYMBOLIC_ONLY = ("SOAK_UNDER", "SOAK_INSIDE", "WIPE", "CUT", "PLACE_NEAR_HEATING_ELEMENT")


def to_omnigibson(plan: Sequence[Action], graph: SceneGraph | None = None, checked: str = UNCHECKED) -> str:
    """Return a plan as calls of OmniGibson's semantic action primitives, in JSON.

    Each call has the name of a member of the enumeration and the names of scene objects: run it with
    `controller.apply_ref(Set[call["primitive"]], *(scene.object_registry("name", a) for a in call["arguments"]))`.

    Args:
        plan: pi; the nine primitives have the same names there. Actions of one's own must be named as one of those that
            the symbolic set has beside (`WIPE`, `CUT`, …).
        graph: not needed.
        checked: what was checked of the plan, in words.

    Raises:
        NotExpressible: an action of one's own that OmniGibson does not have.
    """
    names = [action.primitive.name for action in plan]
    for action in plan:
        if own_action(action.primitive) is not None and action.primitive.name not in _SYMBOLIC_ONLY:
            raise NotExpressible(f"{action}: OmniGibson has no primitive {action.primitive.name}")
    calls = [{"primitive": a.primitive.name, "arguments": list(a.arguments)} for a in plan]
    enumeration = _SYMBOLIC if set(names) & set(_SYMBOLIC_ONLY) else _STARTER
    return json.dumps({"enum": enumeration, "checked": checked, "calls": calls}, indent=2) + "\n"


def to_pddl_plan(plan: Sequence[Action], graph: SceneGraph | None = None, checked: str = UNCHECKED) -> str:
    """Return a plan of the household domain (`planning_task`), as validators such as VAL read it.

    What is put down or dropped there is named: it is what the plan has grasped, or what the graph's robot holds.

    Args:
        plan: pi.
        graph: gives what is held at the start, and the names that its `planning_task` writes.
        checked: what was checked of the plan, in words.

    Raises:
        NotExpressible: something is put down or dropped and nothing was grasped.
    """
    mentioned = dict.fromkeys(name for action in plan for name in action.arguments)
    ids = [*graph.world.nodes, *graph.world.rooms] if graph is not None else []
    written = {name: pddl for pddl, name in pddl_names([*ids, *(n for n in mentioned if n not in ids)]).items()}
    held = None if graph is None else graph.holding
    lines = [f"; checked: {checked}"]
    for step, action in enumerate(plan, start=1):
        arguments = list(action.arguments)
        if action.primitive in (Primitive.RELEASE, Primitive.PLACE_ON_TOP, Primitive.PLACE_INSIDE):
            if held is None:
                raise NotExpressible(f"step {step}, {action}: nothing is held, and PDDL names what is put down")
            arguments.insert(0, held)
            written.setdefault(held, held)
            held = None
        elif action.primitive is Primitive.GRASP:
            held = action.target
        name = action.primitive.name.lower().replace("_", "-")
        lines.append(f"({' '.join([name, *(written[a] for a in arguments)])})")
    return "\n".join([*lines, f"; cost = {len(plan)} (unit cost)"]) + "\n"


def to_behavior_tree(plan: Sequence[Action], graph: SceneGraph | None = None, checked: str = UNCHECKED) -> str:
    """Return a plan as a behaviour tree for BehaviorTree.CPP 4 (ROS 2, Nav2): a sequence of actions, in XML.

    Every primitive is an action node in camel case with the input port `target` (actions of one's own: their
    parameters). The nodes themselves are the robot's; a node that fails ends the sequence.

    Args:
        plan: pi.
        graph: not needed.
        checked: what was checked of the plan, in words.
    """
    root = ET.Element("root", BTCPP_format="4", main_tree_to_execute="Plan")
    root.append(ET.Comment(f" checked: {re.sub('-+', '-', checked)} "))
    sequence = ET.SubElement(ET.SubElement(root, "BehaviorTree", ID="Plan"), "Sequence", name="plan")
    models: dict[str, tuple[str, ...]] = {}
    for step, action in enumerate(plan, start=1):
        name = "".join(part.capitalize() for part in action.primitive.name.split("_"))
        own = own_action(action.primitive)
        ports = own.parameters if own is not None else ("target",) if action.primitive.takes_target else ()
        models[name] = ports
        values = dict(zip(ports, action.arguments, strict=True))
        ET.SubElement(sequence, name, {"name": f"{step}_{action.primitive.name.lower()}", **values})
    nodes = ET.SubElement(root, "TreeNodesModel")
    for name, ports in sorted(models.items()):
        node = ET.SubElement(nodes, "Action", ID=name)
        for port in ports:
            ET.SubElement(node, "input_port", name=port)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


Exporter = Callable[[Sequence[Action], "SceneGraph | None", str], str]

EXPORTERS: Mapping[str, Exporter] = {"omnigibson": to_omnigibson, "pddl": to_pddl_plan, "ros": to_behavior_tree}
"""Name of a form -> its exporter."""
