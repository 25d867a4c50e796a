"""A loopback server that plans as a hosted model would: it finds the instruction in the prompt and answers its plan."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from gavel_agents.llm import Prompt
from gavel_agents.llm.reference import ReferencePlans
from gavel_env.instructions.lookup import About
from gavel_env.instructions.record import Instruction

__all__ = ["PlanServer", "plan_server"]


class PlanServer:
    """What the server does and was asked.

    Attributes:
        url: base address.
        latency_s: before every answer.
        calls: requests so far.
        most: requests under way at the same time, at most.
        dead: answer with HTTP 503 from now on.
        dies_after: become dead after so many requests, or never.
    """

    def __init__(self, instructions: Iterable[Instruction], latency_s: float, dies_after: int | None) -> None:
        records = list(instructions)
        plans = ReferencePlans(records)
        self.plans = {i.text: plans.complete([Prompt((), About(i.text))])[0].text for i in records}
        self.latency_s, self.dies_after = latency_s, dies_after
        self.url = ""
        self.calls = self.most = self.now = 0
        self.turn = threading.Lock()

    def answer(self, question: str) -> str:
        return next((plan for text, plan in self.plans.items() if f"Instruction: {text}\n" in question), "yes")


class _Server(ThreadingHTTPServer):
    request_queue_size = 64


def _handler(server: PlanServer) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            with server.turn:
                server.calls += 1
                server.now += 1
                server.most = max(server.most, server.now)
                dead = server.dies_after is not None and server.calls > server.dies_after
            time.sleep(server.latency_s)
            with server.turn:
                server.now -= 1
            text = server.answer(body["messages"][-1]["content"])
            message = {"index": 0, "finish_reason": "stop", "message": {"role": "assistant", "content": text}}
            usage = {"prompt_tokens": 100, "completion_tokens": 50, "total_tokens": 150}
            answer = {"id": "c", "object": "chat.completion", "created": 0, "model": body["model"]}
            content = json.dumps(answer | {"choices": [message], "usage": usage}).encode()
            self.send_response(401 if dead else 200)
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, format: str, *args: object) -> None:
            """Say nothing."""

    return Handler


@contextmanager
def plan_server(
    instructions: Iterable[Instruction], latency_s: float = 0.0, dies_after: int | None = None
) -> Iterator[PlanServer]:
    """Serve until the context ends."""
    state = PlanServer(instructions, latency_s, dies_after)
    server = _Server(("127.0.0.1", 0), _handler(state))
    server.daemon_threads = True
    state.url = f"http://127.0.0.1:{server.server_address[1]}/v1"
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield state
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
