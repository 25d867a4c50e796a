# ruff: noqa: E501  (a prompt is written as the model reads it, line by line)
"""What the planner is told: pure functions from the believed graph to chat turns (Sec. "LLM Action Planning").

Everything that does not change between instructions (rules, actions, worked examples) leads, so that a backend can keep
it as a shared prefix. Object names are the believed graph's designators.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gavel_agents.llm import Message
from gavel_agents.understanding import TaskUnderstanding
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.graph import OWN_FLAGS, Flag, Relation, SceneGraph
from gavel_env.world_model.own_actions import own_actions

__all__ = ["EXAMPLES", "SYSTEM", "examples", "plan_prompt", "retry_prompt", "situation", "system_prompt"]

SYSTEM = """You plan for a household robot with one hand. Answer with the plan only: for every task a line "Task N:", then one action per line.
Actions:
NAVIGATE_TO x: go to an object (never to a room). Needed before anything is done with x. Impossible while x is inside something closed.
GRASP x: take x. Needs: near x, empty hand, x not inside something closed.
PLACE_ON_TOP y: put what you hold on y. Needs: near y, y has a surface.
PLACE_INSIDE y: put what you hold into y. Needs: near y, y has an inside, and is open if it has a door.
RELEASE: drop what you hold on the floor.
OPEN y, CLOSE y: needs: near y, y has a door.
TOGGLE_ON y, TOGGLE_OFF y: needs: near y, y has a switch. Microwave, dishwasher, washer and dryer must be closed first.
Rules: hold one thing at a time. To reach what is inside something with a door, navigate to the container and OPEN it. CLOSE everything you opened. Running an oven, stove or microwave with food inside cooks it, a dishwasher or washer washes, a clothes dryer dries; TOGGLE_OFF them afterwards. Use only the names given."""

EXAMPLES: tuple[tuple[str, str], ...] = (
    (
        """Instruction: Put the mug and the plate away in the kitchen cabinet.
Objects:
- mug: can be carried; on top of coffee_table
- plate: can be carried; probably in dining_room_0 or kitchen_0
- coffee_table: surface; in living_room_0
- top_cabinet@kitchen: inside, door (closed); in kitchen_0
Task 1 goal: inside(mug, top_cabinet@kitchen), inside(plate, top_cabinet@kitchen)""",
        """Task 1:
NAVIGATE_TO mug
GRASP mug
NAVIGATE_TO top_cabinet@kitchen
OPEN top_cabinet@kitchen
PLACE_INSIDE top_cabinet@kitchen
NAVIGATE_TO plate
GRASP plate
NAVIGATE_TO top_cabinet@kitchen
PLACE_INSIDE top_cabinet@kitchen
CLOSE top_cabinet@kitchen""",
    ),
    (
        """Instruction: Take the pie from the fridge, warm it in the microwave and leave it on the breakfast table.
Objects:
- pie: can be carried; inside fridge
- fridge: inside, door (closed); in kitchen_0
- microwave: inside, door (closed), switch (off); probably in kitchen_0
- breakfast_table: surface; probably in dining_room_0 or kitchen_0
Task 1 goal: cooked(pie), on_top(pie, breakfast_table)""",
        """Task 1:
NAVIGATE_TO fridge
OPEN fridge
GRASP pie
CLOSE fridge
NAVIGATE_TO microwave
OPEN microwave
PLACE_INSIDE microwave
CLOSE microwave
TOGGLE_ON microwave
TOGGLE_OFF microwave
OPEN microwave
GRASP pie
CLOSE microwave
NAVIGATE_TO breakfast_table
PLACE_ON_TOP breakfast_table""",
    ),
    (
        """Instruction: Carry the teddy to the bed, and switch on the floor lamp in the bedroom.
Objects:
- teddy: can be carried; probably in childs_room_0 or bedroom_0
- bed: surface; probably in bedroom_0
- floor_lamp@bedroom: switch (off); in bedroom_0
Task 1 goal: on_top(teddy, bed)
Task 2 goal: toggled(floor_lamp@bedroom)""",
        """Task 1:
NAVIGATE_TO teddy
GRASP teddy
NAVIGATE_TO bed
PLACE_ON_TOP bed
Task 2:
NAVIGATE_TO floor_lamp@bedroom
TOGGLE_ON floor_lamp@bedroom""",
    ),
)

_PUT_AWAY_EMPTY_HANDED = """Task 1:
NAVIGATE_TO top_cabinet@kitchen
OPEN top_cabinet@kitchen
NAVIGATE_TO mug
GRASP mug
NAVIGATE_TO top_cabinet@kitchen
PLACE_INSIDE top_cabinet@kitchen
NAVIGATE_TO plate
GRASP plate
NAVIGATE_TO top_cabinet@kitchen
PLACE_INSIDE top_cabinet@kitchen
CLOSE top_cabinet@kitchen"""

_WARMED_EMPTY_HANDED = """Task 1:
NAVIGATE_TO microwave
OPEN microwave
NAVIGATE_TO fridge
OPEN fridge
GRASP pie
NAVIGATE_TO microwave
PLACE_INSIDE microwave
CLOSE microwave
TOGGLE_ON microwave
TOGGLE_OFF microwave
OPEN microwave
GRASP pie
NAVIGATE_TO breakfast_table
PLACE_ON_TOP breakfast_table
NAVIGATE_TO microwave
CLOSE microwave
NAVIGATE_TO fridge
CLOSE fridge"""

_LIKELY_ROOMS = 2


def system_prompt(profile: Profile = Profile.PAPER) -> str:
    """Return rules and actions, as the rules profile has them."""
    system = SYSTEM.replace("\nRules:", "".join(f"\n{own.prompt_line}" for own in own_actions()) + "\nRules:")
    if profile is Profile.PAPER:
        return system
    doors, switches = "OPEN y, CLOSE y: needs: near y,", "TOGGLE_ON y, TOGGLE_OFF y: needs: near y,"
    return system.replace(doors, f"{doors} empty hand,").replace(switches, f"{switches} empty hand,")


def examples(profile: Profile = Profile.PAPER) -> tuple[tuple[str, str], ...]:
    """Return the worked examples, (question, answer) each; every answer is valid under the rules profile."""
    if profile is Profile.PAPER:
        return EXAMPLES
    (put_away, _), (warm, _), last = EXAMPLES
    return (put_away, _PUT_AWAY_EMPTY_HANDED), (warm, _WARMED_EMPTY_HANDED), last


def plan_prompt(
    text: str,
    tasks: Sequence[TaskUnderstanding],
    graph: SceneGraph,
    likely: Mapping[str, Sequence[str]],
    profile: Profile = Profile.PAPER,
) -> tuple[Message, ...]:
    """Return p = Prompt(I, G_0, B_0, {g_i}): rules, worked examples, then this instruction.

    Args:
        text: the instruction.
        tasks: what was understood of it.
        graph: the believed graph.
        likely: node -> its rooms by decreasing belief, for nodes whose room is uncertain.
        profile: rules profile that plans are judged by.
    """
    turns = [Message("system", system_prompt(profile))]
    for question, answer in examples(profile):
        turns += [Message("user", question), Message("assistant", answer)]
    return (*turns, Message("user", situation(text, tasks, graph, likely)))


def situation(
    text: str,
    tasks: Sequence[TaskUnderstanding],
    graph: SceneGraph,
    likely: Mapping[str, Sequence[str]],
) -> str:
    """Return the part of the prompt that is about this instruction."""
    lines = [f"Instruction: {text}", "Objects:"]
    lines += [f"- {node}: {_describe(graph, node, likely)}" for node in graph.world.nodes]
    for number, task in enumerate(tasks, start=1):
        lines.append(f"Task {number} goal: {', '.join(task.goal.text())}")
    return "\n".join(lines)


def retry_prompt(first: tuple[Message, ...], answer: str, complaint: str) -> tuple[Message, ...]:
    """Return the prompt of a retry: the first prompt, the last answer, and what is wrong with it."""
    return (*first, Message("assistant", answer), Message("user", complaint))


def _describe(graph: SceneGraph, node: str, likely: Mapping[str, Sequence[str]]) -> str:
    category = graph.category(node)
    features = []
    if category.liftable and not graph.world.nodes[node].fixed:
        features.append("can be carried")
    if category.surface:
        features.append("surface")
    if category.interior:
        features.append("inside")
    if category.openable:
        features.append("door (open)" if graph.has(Flag.OPEN, node) else "door (closed)")
    if category.toggleable:
        features.append("switch (on)" if graph.has(Flag.TOGGLED, node) else "switch (off)")
    features += [flag.name.lower() for flag in (Flag.HOT, Flag.FROZEN, Flag.DIRTY, *OWN_FLAGS) if graph.has(flag, node)]
    if graph.flags[Flag.DIRTY]:
        if category.wipes:
            features.append("wipes what it is put on top of")
        if category.rinses:
            features.append("rinses what is inside when switched on")
    return f"{', '.join(features) or 'fixed'}; {_where(graph, node, likely)}"


def _where(graph: SceneGraph, node: str, likely: Mapping[str, Sequence[str]]) -> str:
    support = graph.supports.get(node)
    if support is not None:
        words = {Relation.ON_TOP: "on top of ", Relation.INSIDE: "inside ", Relation.FLOOR: "in "}
        return words.get(support.relation, "held by ") + support.holder
    rooms = list(likely.get(node, ()))[:_LIKELY_ROOMS]
    return f"probably in {' or '.join(rooms)}" if rooms else "somewhere in the house"
