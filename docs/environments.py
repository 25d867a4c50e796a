"""Writes docs/reference/environments.md from the environment's docstring, its spaces and the text below.

python docs/environments.py
"""

from __future__ import annotations

import inspect
from pathlib import Path

from gavel_env.envs.env import GavelEnv
from gavel_env.envs.rl import SlotEnv
from gavel_env.envs.spaces import NODE_COLUMNS, EdgeType
from gavel_env.envs.text_game import TextGame
from gavel_env.envs.wrappers import FlatActions, PaddedGraph, TextActions
from gavel_env.world_model.dynamics import ViolationKind

PAGE = Path(__file__).parent / "reference" / "environments.md"

BEGINNING = """\
# Environments

Importing `gavel_env` registers these environments with Gymnasium: `Gavel-SingleTask-v0` (one task per instruction, at
most 200 steps), `Gavel-MultiTask-v0` (two to five independent tasks, at most 500 steps) and `Gavel-Behavior-v0`
([BEHAVIOR's activities](behavior.md), at most 500 steps). All are `gavel_env.GavelEnv` with another instruction file.
`Gavel-RL-v0` is the same for [reinforcement learning](../howto/learners.md), which also tells of the game in words.

```python
import gymnasium as gym
import gavel_env
from gavel_env import EnvAction, Primitive

env = gym.make("Gavel-SingleTask-v0", render_mode="ansi", on_violation="noop")  # an invalid action changes nothing
observation, info = env.reset(seed=7)
print(observation["instruction"])

observed = observation.observed  # the same view with names: an observed scene graph and the map of the rooms
print(sorted(observed.graph.world.nodes)[:5], observed.graph.robot_room)

# Go and find a fridge, the kitchen first; whatever is seen on the way is observed too.
kitchens = {room.id: 1.0 for room in observed.graph.world.rooms.values() if room.type == "kitchen"}
action = EnvAction(Primitive.NAVIGATE_TO, "fridge", search_prior=kitchens)
observation, reward, terminated, truncated, info = env.step(action)
print(info["outcome"], observation.observed.reached, f"{info['metres']:.1f} m")
```

With text, and in the form of the action space:

```python
from gavel_env import TextActions

text_env = TextActions(gym.make("Gavel-SingleTask-v0", on_violation="noop"))
text_env.reset(seed=7)
text_env.step("navigate to the fridge")

env.reset(seed=7)
numbers = env.unwrapped.encode(action)
assert numbers in env.action_space
env.step(numbers)
```

Instructions of your own are records ([format](../howto/instructions.md)) or a file of them:

```python
record = {
    "id": "apple",
    "scene": "Rs_int",
    "text": "Bring the apple to the coffee table.",
    "placements": [{"category": "apple", "relation": "on", "target": "countertop@kitchen"}],
    "tasks": [{"text": "Bring the apple.", "goal": ["on_top(apple, coffee_table)"], "reference_plan": []}],
}
env.reset(options={"instruction": record})
for step in ("NAVIGATE_TO(apple)", "GRASP(apple)", "NAVIGATE_TO(coffee_table)", "PLACE_ON_TOP(coffee_table)"):
    *_, info = env.step(EnvAction.of(gavel_env.parse_action(step)))
assert info["success"]
```

"""

END = """
## What is hidden stays hidden

Before something is observed it has no id, no node and no position: no observation, no `info` and no public attribute
leads to it (`tests/test_leaks.py` walks them). An id that exists but was not observed is answered exactly like one
that does not exist. Pictures (`render_mode="rgb_array"`) are for people: they show the whole house, unseen floor
dimmed. Three methods of `env.unwrapped` show the hidden state. Only the oracle among the agents may call them:

| method | for |
|---|---|
| `judge()` | runners: success, unmet goal literals, what was left open or on, metres |
| `privileged_state()` | records: the hidden graph, the instruction's record, the house with its furniture |
| `reveal()` | the oracle: the same, and every object becomes observed |

## Vector environments

`Graph` spaces have no fixed shape, so processes cannot share memory for them. Either switch that off, or pad:

```python
def main():
    envs = gym.make_vec(
        "Gavel-SingleTask-v0", num_envs=2, vectorization_mode="async", vector_kwargs={"shared_memory": False}
    )
    envs.reset(seed=0)
    envs.close()

    envs = gym.make_vec("Gavel-SingleTask-v0", num_envs=2, vectorization_mode="async", wrappers=[gavel_env.PaddedGraph])
    observation, _ = envs.reset(seed=0)
    assert observation["nodes"].shape[:2] == (2, 512)
    envs.close()


if __name__ == "__main__":
    main()
```

## Checked against another planner

`gavel_env.export_pddl(graph)` writes a state, and all that can be done next, as plain STRIPS. The tests step both the
world model and pyperplan at random through ten houses and compare which actions are allowed, and every successor:
21,000 steps (`pytest -m slow tests/test_pddl.py`), without disagreement.
"""


def page() -> str:
    """Return the page."""
    body = markdown(GavelEnv).split("\n", 2)[2]
    parts = [BEGINNING, body, "\n\n## Columns of a node\n\n", columns(), "\n\n## Relations of an edge\n\n"]
    parts += [", ".join(f"{int(e)} `{e.name.lower()}`" for e in EdgeType), ".\n\n## Outcomes\n\n"]
    parts += ["`ok`, or why an action was invalid: ", ", ".join(f"`{kind.value}`" for kind in ViolationKind), ".\n"]
    parts += ["\n## Wrappers\n"]
    for wrapper in (TextActions, FlatActions, PaddedGraph, SlotEnv, TextGame):
        parts += [f"\n### {wrapper.__name__}\n\n", markdown(wrapper).replace("\n## ", "\n#### "), "\n"]
    return "".join([*parts, END])


def markdown(thing: type) -> str:
    """Return a class docstring as Markdown: its arguments as a list."""
    lines = inspect.cleandoc(thing.__doc__ or "").split("\n")
    if "Args:" not in lines:
        return "\n".join(lines)
    first = lines.index("Args:")
    last = next((i for i in range(first + 1, len(lines)) if not lines[i].startswith("    ")), len(lines))
    listed = []
    for line in lines[first + 1 : last]:
        name, colon, text = line.strip().partition(": ")
        is_argument = colon and not line.startswith("     ") and name.isidentifier()
        listed.append(f"- `{name}`: {text}" if is_argument else f"  {line.strip()}")
    return "\n".join([*lines[:first], *listed, *lines[last:]])


def columns() -> str:
    """Return the columns of a node as a table, several to a row."""
    cells = [f"{index} `{name}`" for index, name in enumerate(NODE_COLUMNS)]
    cells += [""] * (-len(cells) % 4)
    rows = ["| | | | |", "|---|---|---|---|"]
    rows += [f"| {' | '.join(cells[i : i + 4])} |" for i in range(0, len(cells), 4)]
    return "\n".join(rows)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
