"""What came of a sentence, told on a terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from rich.console import Console
from rich.text import Text

from eval.records.schema import OUTCOMES, Step
from eval.sentence.drive import Moment
from eval.sentence.run import SentenceRun
from eval.sentence.staging import Put
from gavel_agents.agent import TaskTrace, says_valid
from gavel_agents.understanding import Decomposition, Question
from gavel_env.world_model.actions import Primitive, parse_action
from gavel_env.world_model.concepts import in_words
from gavel_env.world_model.goals import Goal, Literal, Predicate, parse_literal

__all__ = ["chosen", "tell", "tell_plan", "tell_question", "tell_why", "wish"]

_LIKELY = 3
_INDENT = "  "
_BETWEEN = {
    Predicate.ON_TOP: "on",
    Predicate.INSIDE: "in",
    Predicate.UNDER: "under",
    Predicate.NEXT_TO: "next to",
    Predicate.IN_ROOM: "in",
}
_STATES = {Predicate.TOGGLED: "on"}


def wish(literal: Literal) -> str:
    """Return a goal literal in words: `mug in dishwasher`, `floor lamp not on`."""
    no = "not " if literal.negated else ""
    if literal.object is None:
        return f"{_said(str(literal.subject))} {no}{_STATES.get(literal.predicate, literal.predicate.value)}"
    return f"{_said(str(literal.subject))} {no}{_BETWEEN[literal.predicate]} {_said(str(literal.object))}"


def _said(name: str) -> str:
    """Return a designator in words: `any_office` -> `office`, `desk@private_office` -> `desk in the private office`."""
    thing, at, room = name.partition("@")
    words = in_words(thing)
    return f"{words} in the {in_words(room)}" if at else words


def _wishes(goal: Goal) -> str:
    return ", ".join((*map(wish, goal.literals), *(condition.text() for condition in goal.conditions)))


def tell(run: SentenceRun, console: Console) -> None:
    """Tell everything: what was understood and believed, the plan, the drive and the outcome."""
    console.print(Text(run.text, style="bold"))
    console.print(Text(f"{run.scene}, seed {run.seed}", style="dim"))
    _heading(console, "Understood")
    _tell_understood(run, console)
    _heading(console, "In the house")
    for put in run.put:
        _line(console, _where_put(put), (f" ({put.why})", "dim"))
    for state in run.staged.instruction.initial:
        _line(console, f"{wish(parse_literal(state))}", (" (or nothing would have to be done)", "dim"))
    if not run.put and not run.staged.instruction.initial:
        _line(console, "everything is there already")
    _heading(console, "Believed at the start")
    _tell_beliefs(run, console)
    _heading(console, "Plan")
    tell_plan(run, console)
    _heading(console, "Driven")
    for step, before, after in _steps(run):
        _tell_step(step, before, after, console)
    console.print()
    _tell_outcome(run, console)


def _heading(console: Console, text: str) -> None:
    console.print(Text(f"\n{text}", style="bold cyan"))


def _tell_understood(run: SentenceRun, console: Console) -> None:
    for task, staged in zip(run.understood.tasks, run.staged.tasks, strict=True):
        said = [wish(literal) for literal in task.relations]
        _line(console, _wishes(staged.goal), (f" (said to be: {', '.join(said)})" if said else "", "dim"))
    for note in (*run.understood.notes, *run.staged.notes):
        _line(console, (note, "yellow"))
    for key, answer in run.answers.items():
        _line(console, (f"you answered {answer!r} ({key})", "dim"))
    _tell_passed_over(run.understood, console)


def _tell_passed_over(found: Decomposition, console: Console) -> None:
    if found.passed_over:
        _line(console, (f"passed over: {' · '.join(found.passed_over)}", "dim"))


def _where_put(put: Put) -> str:
    relation = {"on": "on", "in": "in", "floor": "on the floor of"}[put.placement.relation]
    room = "" if put.placement.relation == "floor" else f" in {put.room}"
    return f"{put.placement.id} {relation} {put.placement.target}{room}"


def _tell_beliefs(run: SentenceRun, console: Console) -> None:
    for node, belief in run.driven.beliefs.items():
        likely = sorted(belief.items(), key=lambda item: (-item[1], item[0]))[:_LIKELY]
        _line(console, f"{_said(node)}: ", ", ".join(f"{room} {share:.0%}" for room, share in likely))


def _line(console: Console, *parts: str | tuple[str, str]) -> None:
    """Print a line of texts and (text, style) that stands in, however often it is broken."""
    for line in Text.assemble(*parts).wrap(console, console.width - len(_INDENT)):
        line.rstrip()
        console.print(Text.assemble(_INDENT, line))


def tell_plan(run: SentenceRun, console: Console) -> None:
    """Tell the plans that were carried out, in their order, with what repair changed and why."""
    trace = run.record.trace
    if not trace.tasks:
        _line(console, f"none: {trace.stopped}")
        return
    for answer in trace.completions[-1:]:
        for line in answer.splitlines():
            if "# no plan: " in line:
                _line(console, (line.replace("# ", ""), "red"))
    order = trace.order or range(len(trace.tasks))
    left = [i for i in range(len(trace.tasks)) if i not in order]
    for index in (*order, *left):
        _tell_task(trace.tasks[index], len(trace.tasks) > 1, console)
    who = [run.record.contestant.agent, *([f"{run.record.model}, asked {trace.attempts} ×"] if trace.attempts else [])]
    _line(console, (f"{'; '.join(who)}; {run.record.planning_s:.3f} s", "dim"))


def _tell_task(task: TaskTrace, named: bool, console: Console) -> None:
    if named:
        _line(console, (task.text, "bold"))
    steps = " → ".join(_step(text, _said) for text in task.plan)
    _line(console, steps or "(nothing to do)")
    for edit in task.edits:
        _line(console, (f"repaired: {edit}", "yellow"))
    _line(console, (task.verdict, "green" if says_valid(task.verdict) else "red"))


_VERBS = {
    Primitive.NAVIGATE_TO: "go to {}",
    Primitive.GRASP: "take {}",
    Primitive.RELEASE: "let go",
    Primitive.PLACE_ON_TOP: "put on {}",
    Primitive.PLACE_INSIDE: "put into {}",
    Primitive.OPEN: "open {}",
    Primitive.CLOSE: "close {}",
    Primitive.TOGGLE_ON: "switch on {}",
    Primitive.TOGGLE_OFF: "switch off {}",
}


def _step(text: str, named: Callable[[str], str] = str) -> str:
    action = parse_action(text)
    if action.primitive not in _VERBS:
        return f"{action.primitive.name.lower()} {', '.join(map(named, action.arguments))}".rstrip()
    return _VERBS[action.primitive].format(named(action.target or ""))


def tell_why(run: SentenceRun, console: Console) -> None:
    """Tell why it went as it did: beliefs, repairs, searches, and what failed."""
    _tell_beliefs(run, console)
    for task in run.record.trace.tasks:
        for edit in task.edits:
            _line(console, f"repaired: {edit}")
    for step, before, after in _steps(run):
        if after.new or step.outcome != "ok":
            _tell_step(step, before, after, console)
    _tell_outcome(run, console)


def _steps(run: SentenceRun) -> Iterator[tuple[Step, Moment, Moment]]:
    moments = run.driven.moments
    yield from zip(run.record.steps, moments, moments[1:], strict=False)


def _tell_step(step: Step, before: Moment, after: Moment, console: Console) -> None:
    action = parse_action(step.action)
    line = _step(step.action)
    details = []
    if step.metres:
        details.append(f"{step.metres:.1f} m")
    searched = step.reached is not None and step.reached not in before.observed.graph.world.nodes
    if searched and step.reached is not None:
        details.append(f"looked in {', '.join(after.searched)}; found {step.reached} {_found(after, step.reached)}")
    elif step.return_when is not None and step.reached is None and step.outcome == "ok":
        looked = f"looked in {', '.join(after.searched)}" if after.searched else f"saw {', '.join(after.new)}"
        details.append(f"{looked}; came back to decide again")
    elif action.primitive is Primitive.OPEN and after.new:
        details.append(f"inside: {', '.join(after.new)}")
    if step.outcome != "ok":
        looked = f"; looked in {', '.join(after.searched)}" if step.outcome == "not_found" else ""
        _line(console, (f"{line}: {step.detail or step.outcome}{looked}", "red"))
        return
    _line(console, line, (f"  {'; '.join(details)}" if details else "", "dim"))


def _found(moment: Moment, obj: str) -> str:
    graph = moment.observed.graph
    support = graph.supports.get(obj)
    room = graph.room_of(obj) or "?"
    if support is None or graph.world.nodes[obj].fixed or support.holder == room:
        return f"in {room}"
    return f"{'on' if support.relation == 0 else 'in'} {support.holder} in {room}"


def _tell_outcome(run: SentenceRun, console: Console) -> None:
    record = run.record
    steps = f"{len(record.steps)} step{'s' * (len(record.steps) != 1)} and {record.metres:.1f} m"
    if record.success:
        console.print(Text.assemble(("Done", "bold green"), f" in {steps}."))
        return
    console.print(Text.assemble(("Not done", "bold red"), f" after {steps}: {OUTCOMES[record.outcome]}"))
    for what, found in (("unmet", record.unmet), ("left", record.unsafe)):
        if found:
            _line(console, f"{what}: {', '.join(found)}")
    if record.trace.stopped:
        _line(console, record.trace.stopped)


def tell_question(question: Question, console: Console) -> None:
    """Tell a question with its choices, numbered."""
    console.print(Text(question.asks, style="bold yellow"))
    for number, choice in enumerate(question.choices, start=1):
        _line(console, f"{number}. {_said(choice)}")


def chosen(question: Question, typed: str) -> str:
    """Return the answer that was typed: the number of a choice, or words."""
    typed = typed.strip()
    if typed.isdecimal() and 1 <= int(typed) <= len(question.choices):
        return question.choices[int(typed) - 1]
    return typed
