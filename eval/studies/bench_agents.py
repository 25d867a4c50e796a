"""Lines of the bench: reading, planning, verifying, ordering, and a model behind an endpoint."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.util import find_spec
from itertools import islice
from typing import Any

from eval.studies.bench_world import instructions, make, plans, reset
from eval.studies.measuring import Measurement, Samples, timed
from gavel_env.errors import NotInstalled
from gavel_env.exchange import Observation
from gavel_env.world_model.actions import Action, Primitive

__all__ = ["AGENTS", "slow_endpoint"]


def _problems() -> Iterator[tuple[Any, tuple[Action, ...], Any]]:
    from gavel_env.house.scenes import load_scene
    from gavel_env.instructions.initial_graph import instruction_graph

    for instruction, _ in plans():
        yield (
            instruction_graph(load_scene(instruction.scene), instruction),
            instruction.reference_plan(),
            instruction.goal(),
        )


def _validations() -> Samples:
    from gavel_env.world_model.verdict import validate

    for graph, plan, goal in _problems():
        for _ in range(20):
            yield timed(partial(validate, graph, plan, goal), 5)


def _repairs() -> Samples:
    """Repair reference plans without their first OPEN, last NAVIGATE_TO and last CLOSE (or last step)."""
    from gavel_agents.edits.repair import repair

    for graph, plan, goal in _problems():
        broken = list(plan)
        for primitive, last in ((Primitive.OPEN, False), (Primitive.NAVIGATE_TO, True), (Primitive.CLOSE, True)):
            places = [i for i, action in enumerate(broken) if action.primitive is primitive]
            if places:
                del broken[places[-1 if last else 0]]
        for _ in range(10):
            yield timed(partial(repair, graph, tuple(broken), goal))


def _planners(belief: str) -> Iterator[tuple[Any, Observation, Any]]:
    """Yield agents that plan by graph edits and order once, each with an instruction of five tasks just begun."""
    from gavel_agents.beliefs.belief import load_prior
    from gavel_agents.methods import MethodConfig
    from gavel_agents.pipeline import PlanningAgent
    from gavel_agents.understanding import ReferenceUnderstanding

    chosen = [i for i in instructions("multi").values() if len(i.tasks) == 5]
    if not chosen:
        raise NotInstalled("no shipped instruction has five tasks")
    env, _ = make("symbolic")
    for instruction in islice(chosen, 20):
        observation = reset(env, instruction)
        understanding = ReferenceUnderstanding([instruction])
        config = MethodConfig(source="edits", attempts=0, order="once", belief=belief)  # type: ignore[arg-type]
        agent = PlanningAgent("bench", config, understanding=understanding, model=None, prior=load_prior("choice"))
        yield agent, observation, understanding


def _orderings() -> Samples:
    for agent, observation, _ in _planners("full"):
        for _ in range(3):
            agent.reset(observation, {})
            yield agent.trace.seconds["order"]


def _belief_updates() -> Samples:
    from gavel_agents.beliefs.belief import Belief, load_prior
    from gavel_agents.beliefs.believed_graph import believed_graph
    from gavel_agents.ordering.cost import TravelModel
    from gavel_env.world_model.ontology import default_ontology

    for _, observation, understanding in _planners("full"):
        observed = observation.observed
        world = observed.graph.world
        tasks = understanding.understand(observed.instruction).tasks
        graph = believed_graph(world.rooms, world.connections, tasks, default_ontology(), observed.graph.robot_room)
        rooms = TravelModel(observed.layout).rooms
        belief = Belief.initial(graph, observed.layout, rooms, load_prior("choice"))
        for _ in range(10):
            yield timed(partial(belief.update, graph, observed, {}))


def _readings(file: str) -> Samples:
    """Read the sentences of a file, in houses whose rooms are known: by the rules and by the network."""
    from gavel_agents.understanding import load_understanding
    from gavel_env.house.scenes import load_scene
    from gavel_env.world_model.graph import Room

    understanding = load_understanding("rules")
    records = list(instructions(file).values())[:100]
    rooms = {r.scene: {room.id: Room(room.id, room.type) for room in load_scene(r.scene).rooms} for r in records}
    understanding.understand(records[0].text, rooms=rooms[records[0].scene])
    for record in records:
        yield timed(partial(understanding.understand, record.text, rooms=rooms[record.scene]))


def _classical_plans() -> Samples:
    """Plan single tasks in the whole, known house by the package's own search."""
    from gavel_agents.classical.search import search
    from gavel_env.house.scenes import load_scene
    from gavel_env.instructions.initial_graph import instruction_graph
    from gavel_env.world_model.dynamics import Profile

    for instruction in islice(instructions("single").values(), 0, None, 5):
        graph = instruction_graph(load_scene(instruction.scene), instruction)
        yield timed(partial(search, graph, instruction.goal(), Profile.PAPER))


class _Endpoint(BaseHTTPRequestHandler):
    """An OpenAI-compatible endpoint that takes a second for every answer."""

    protocol_version = "HTTP/1.1"

    def do_POST(self) -> None:
        self.rfile.read(int(self.headers["Content-Length"]))
        time.sleep(1.0)
        message = {"role": "assistant", "content": "Task 1:\nRELEASE"}
        choices = [{"index": 0, "finish_reason": "stop", "message": message}]
        answer = {"id": "x", "object": "chat.completion", "created": 0, "model": "m", "choices": choices}
        body = json.dumps(answer | {"usage": {"prompt_tokens": 1, "completion_tokens": 1, "total_tokens": 2}}).encode()
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: Any) -> None:
        """Say nothing."""


@contextmanager
def slow_endpoint() -> Iterator[str]:
    """Serve on loopback while the block runs; gives the planner's spec.

    Raises:
        NotInstalled: the extra `[hosted]` is not installed.
    """
    if find_spec("openai") is None:
        raise NotInstalled("needs openai, of the extra [hosted]")
    server = ThreadingHTTPServer(("127.0.0.1", 0), _Endpoint)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"openai:m@http://127.0.0.1:{server.server_address[1]}/v1"
    finally:
        server.shutdown()
        server.server_close()


def _endpoint(connections: int) -> Samples:
    """Evaluate llm-only on the 100 single tasks against an endpoint that takes a second per call."""
    with slow_endpoint() as spec:
        for _ in range(3):
            with tempfile.TemporaryDirectory() as folder:
                arguments = ["--agents", "llm-only", "--planner", spec, "--kind", "single", "--quiet", "--out", folder]
                command = [sys.executable, "-m", "eval", "eval", *arguments, "--connections", str(connections)]
                yield timed(partial(subprocess.run, command, check=True, capture_output=True))


AGENTS: tuple[Measurement, ...] = (
    Measurement("read a sentence of a single task", "ms", 5.0, partial(_readings, "single")),
    Measurement("read a sentence of people (voices)", "ms", 5.0, partial(_readings, "voices")),
    Measurement("plan a single task classically", "ms", None, _classical_plans),
    Measurement("validate a 17-step plan", "µs", 150.0, _validations),
    Measurement("repair a plan with 3 defects", "ms", 3.0, _repairs),
    Measurement("order 5 tasks, full belief", "ms", 1.0, _orderings),
    Measurement("belief update, 5 tasks", "ms", 0.2, _belief_updates),
    Measurement("100 instructions, 1 s endpoint, 8 connections", "s", None, partial(_endpoint, 8)),
    Measurement("100 instructions, 1 s endpoint, 32 connections", "s", 8.0, partial(_endpoint, 32)),
)
