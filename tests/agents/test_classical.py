"""The classical planner: plans for what was understood, over what is believed, and says so where there is none."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec

import gymnasium as gym
import pytest
from support.worlds import kitchen, opened

import gavel_agents
from gavel_agents.beliefs.believed_graph import believed_graph
from gavel_agents.classical.engine import going_to_each
from gavel_agents.classical.planner import ENGINES, ClassicalPlanner, chosen_engine
from gavel_agents.classical.search import search
from gavel_agents.llm import BadPlannerSpec, PlanningProblem, Prompt, load_model
from gavel_agents.methods import METHODS
from gavel_agents.pipeline import PlanningAgent
from gavel_agents.understanding import (
    Decomposition,
    ReferenceUnderstanding,
    TaskUnderstanding,
    UnknownUnderstanding,
    load_understanding,
)
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import scene_graph
from gavel_env.instructions.lookup import About
from gavel_env.instructions.record import Instruction, read_instructions, shipped
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.condition_text import parse_formula
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import Goal, parse_goal
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.ontology import default_ontology
from gavel_env.world_model.verdict import validate

INSTALLED = [
    pytest.param(
        engine,
        marks=pytest.mark.skipif(
            engine != "search" and find_spec("up_fast_downward") is None, reason="needs the extra 'planning'"
        ),
    )
    for engine in ENGINES
]


def believed(instruction: Instruction) -> tuple[SceneGraph, tuple[TaskUnderstanding, ...]]:
    tasks = ReferenceUnderstanding([instruction]).understand(instruction.text).tasks
    world = scene_graph(load_scene(instruction.scene)).world
    return believed_graph(world.rooms, world.connections, tasks, default_ontology(), None), tasks


def one_of_each_shape() -> list[tuple[Instruction, int]]:
    found: dict[str, tuple[Instruction, int]] = {}
    for name in ("single", "multi"):
        for instruction in read_instructions(shipped(name)).values():
            for index, shape in enumerate(instruction.meta["shapes"]):
                found.setdefault(f"{name}/{shape}", (instruction, index))
    return list(found.values())


def goal(*literals: str, conditions: Sequence[str] = ()) -> Goal:
    return Goal(parse_goal(literals).literals, tuple(map(parse_formula, conditions)))


@pytest.mark.parametrize("profile", Profile)
@pytest.mark.parametrize("case", one_of_each_shape(), ids=lambda c: f"{c[0].id}[{c[1]}]")
def test_every_shape_of_task_is_planned(case: tuple[Instruction, int], profile: Profile) -> None:
    instruction, index = case
    graph, tasks = believed(instruction)
    found = search(graph, tasks[index].goal, profile)
    assert found.plan is not None, found.reason
    assert validate(graph, found.plan, tasks[index].goal, profile=profile).valid
    assert found.states < 200


def test_every_single_task_is_planned_within_a_few_states_and_steps() -> None:
    instructions = read_instructions(shipped("single")).values()
    states, longer = [], []
    for instruction in instructions:
        graph, [task] = believed(instruction)
        found = search(graph, task.goal)
        assert found.plan is not None
        assert validate(graph, found.plan, task.goal).valid
        states.append(found.states)
        longer.append(len(found.plan) - len(instruction.reference_plan()))
    assert max(states) <= 50
    assert sum(longer) <= 0  # no longer on the whole than the certified plans


CASES = {
    "negated place": goal("not on_top(apple_0, countertop_0)"),
    "negated door": goal("not open(oven_0)"),
    "left open": goal("open(fridge_0)", "on_top(steak_0, countertop_0)"),
    "switched on": goal("toggled(floor_lamp_0)"),
    "next to": goal("next_to(apple_0, floor_lamp_0)"),
    "under": goal("under(bowl_0, breakfast_table_0)"),
    "in a room": goal("in_room(apple_0, living_room)"),
    "washed and dried": goal("washed(bowl_0)", "dried(bowl_0)", "inside(bowl_0, bookcase_0)"),
    "cooked where it was": goal("cooked(steak_0)", "inside(steak_0, fridge_0)"),
    "out of a bag": goal("inside(textbook_0, bookcase_0)"),
    "into what must be moved too": goal("inside(apple_0, bowl_0)", "inside(bowl_0, fridge_0)"),
    "a choice": goal(conditions=["(or (cooked textbook_0) (on_top textbook_0 countertop_0))"]),
    "each somewhere": goal(conditions=["(forall (?x apple_0 steak_0) (exists (?y bowl_0 bookcase_0) (inside ?x ?y)))"]),
    "exactly two": goal(conditions=["(forn (2) (?x apple_0 steak_0 bowl_0) (inside ?x fridge_0))"]),
    "exactly none": goal(conditions=["(forn (0) (?x apple_0 steak_0 bowl_0) (inside ?x fridge_0))"]),
    "pairs": goal(conditions=["(forpairs (?x apple_0 steak_0) (?y countertop_0 bookcase_0) (within ?x ?y))"]),
    "if then": goal(conditions=["(imply (on_top apple_0 countertop_0) (open oven_0))"]),
}


@pytest.mark.parametrize("engine", INSTALLED)
@pytest.mark.parametrize("name", CASES)
def test_goals_of_every_kind_are_planned(engine: str, name: str) -> None:
    graph = opened("oven_0") if name == "negated door" else kitchen(near=())
    if name == "pairs":  # a countertop has no inside: of the two, one pair cannot be
        found = ENGINES[engine](graph, CASES[name], Profile.PAPER)
        assert found.plan is None
        return
    found = ENGINES[engine](graph, CASES[name], Profile.PAPER)
    assert found.plan, found.reason
    assert validate(graph, found.plan, CASES[name]).valid


IMPOSSIBLE = {
    "no way to make it so": goal("dirty(apple_0)"),
    "not cookable": goal("cooked(textbook_0)"),
    "no inside": goal("inside(apple_0, countertop_0)"),
    "too heavy": goal("on_top(fridge_0, countertop_0)"),
    "no switch": goal("toggled(bookcase_0)"),
    "each in the other": goal("inside(bowl_0, backpack_0)", "inside(backpack_0, bowl_0)"),
}


@pytest.mark.parametrize("engine", INSTALLED)
@pytest.mark.parametrize("name", IMPOSSIBLE)
def test_what_cannot_be_brought_about_ends_with_a_reason(engine: str, name: str) -> None:
    found = ENGINES[engine](kitchen(near=()), IMPOSSIBLE[name], Profile.PAPER)
    assert found.plan is None
    assert found.reason


def test_the_search_gives_up_where_it_is_told_to() -> None:
    found = search(kitchen(near=()), CASES["washed and dried"], most_states=3)
    assert found == (None, 3, "gave up after 3 states")


def test_something_unknown_is_no_plan() -> None:
    assert search(kitchen(), goal("on_top(sofa_7, countertop_0)")).plan is None


def test_things_on_one_piece_are_gone_to_one_by_one() -> None:
    """A countertop is longer than an arm: going to it reaches what was meant there, not all that lies on it."""
    graph = kitchen({"bowl_0": "on countertop_0"}, near=())
    found = search(graph, goal("inside(apple_0, bowl_0)"))
    assert found.plan is not None
    going = [a.target for a in found.plan if a.primitive is Primitive.NAVIGATE_TO]
    assert going == ["apple_0", "bowl_0"]
    near_all = [
        Action(Primitive.NAVIGATE_TO, "countertop_0"),
        Action(Primitive.GRASP, "apple_0"),
        Action(Primitive.PLACE_INSIDE, "bowl_0"),
    ]
    assert validate(graph, near_all, goal("inside(apple_0, bowl_0)")).valid
    mended = going_to_each(graph, near_all)
    assert [a.target for a in mended if a.primitive is Primitive.NAVIGATE_TO] == ["countertop_0", "apple_0", "bowl_0"]
    assert validate(graph, mended, goal("inside(apple_0, bowl_0)")).valid


@pytest.mark.skipif(find_spec("up_fast_downward") is None, reason="needs the extra 'planning'")
@pytest.mark.parametrize("case", one_of_each_shape()[::3], ids=lambda c: f"{c[0].id}[{c[1]}]")
def test_fast_downward_plans_what_the_search_plans(case: tuple[Instruction, int]) -> None:
    graph, tasks = believed(case[0])
    task = tasks[case[1]]
    found = ENGINES["fast-downward"](graph, task.goal, Profile.PAPER)
    assert found.plan is not None, found.reason
    assert validate(graph, found.plan, task.goal).valid


# --- in a model's place --------------------------------------------------------------------------------------------


def test_plans_are_for_what_was_understood_whatever_the_instruction_is() -> None:
    graph = kitchen(near=())
    planner = load_model("classical:search")
    for wish in (goal("inside(apple_0, fridge_0)"), goal("toggled(floor_lamp_0)")):
        [answer] = planner.complete(
            [Prompt((), About("single-Rs_int-00"), problem=PlanningProblem(graph, (wish, wish)))]
        )
        plans = answer.text.split("Task 2:\n")
        assert plans[0].removeprefix("Task 1:\n").strip() == plans[1].strip()
        assert answer.seconds > 0
    assert "TOGGLE_ON floor_lamp_0" in plans[1]


def test_a_task_without_a_plan_says_why_and_the_others_are_planned() -> None:
    problem = PlanningProblem(kitchen(near=()), (goal("cooked(textbook_0)"), goal("toggled(floor_lamp_0)")))
    planner = ClassicalPlanner("search")
    [first] = planner.complete([Prompt((), problem=problem)])
    assert "Task 1: # no plan: no sequence of actions" in first.text
    assert first.text.endswith("TOGGLE_ON floor_lamp_0")
    [again] = planner.complete([Prompt((), attempt=1, problem=problem)])
    assert again.text == first.text


def test_specs_name_an_engine() -> None:
    assert load_model("classical").name == f"classical planner, {chosen_engine()} (no model)"
    with pytest.raises(BadPlannerSpec, match="known: search"):
        load_model("classical:serch")
    with pytest.raises(BadPlannerSpec, match="reads no text"):
        load_model("classical:search").complete([Prompt(())])
    with pytest.raises(UnknownUnderstanding, match="reads no text"):
        load_understanding("llm", model=load_model("classical:search"))


class Misled:
    """An understanding that puts everything on the floor lamp's switch."""

    name = "misled"

    def understand(self, text: str, *_: object, **__: object) -> Decomposition:
        wish = parse_goal(["toggled(floor_lamp)"])
        return Decomposition((TaskUnderstanding(text, (wish.literals[0].subject,), (), wish),))


def test_a_wrong_understanding_fails_with_the_classical_planner_and_not_with_certified_plans() -> None:
    """Certified plans answer by the instruction's id: what was understood does not matter to them."""
    instructions = read_instructions(shipped("single"))
    name = "single-Beechwood_0_int-00"
    env = gym.make("Gavel-SingleTask-v0", terminate_on_success=False, observation="symbolic")
    outcomes = {}
    for spec in ("classical:search", "reference:single"):
        agent = gavel_agents.make("llm-only", understanding=Misled(), model=load_model(spec))
        assert isinstance(agent, PlanningAgent)
        observation, info = env.reset(seed=0, options={"instruction": instructions[name]})
        agent.reset(observation, info)
        outcomes[spec] = agent.trace.tasks[0].plan
    assert any("TOGGLE_ON" in step for step in outcomes["classical:search"])
    assert not any("floor_lamp" in step for step in outcomes["reference:single"])


@pytest.mark.parametrize("kind", ["single", "multi"])
def test_llm_p_carries_out_the_benchmarks(kind: str) -> None:
    """Every ninth instruction of both; all of them: docs/explanation/results.md."""
    instructions = {i.id: i for i in list(read_instructions(shipped(kind)).values())[::9]}
    env = gym.make(
        "Gavel-MultiTask-v0", instructions=instructions.values(), terminate_on_success=False, observation="symbolic"
    )
    assert METHODS["llm+p"].order == "written"
    assert not METHODS["llm+p"].repair
    for name, instruction in instructions.items():
        understanding = ReferenceUnderstanding([instruction])
        agent = gavel_agents.make("llm+p", understanding=understanding, model=load_model("classical:search"))
        observation, info = env.reset(seed=0, options={"instruction": name})
        agent.reset(observation, info)
        while (action := agent.act(observation, info)) is not None:
            observation, _, _, _, info = env.step(action)
        assert env.unwrapped.judge().success, (name, env.unwrapped.judge())  # type: ignore[attr-defined]
