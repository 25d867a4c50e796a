"""A loopback server that speaks as hosted models do, or fails in the ways that they do."""

from __future__ import annotations

import contextlib
import itertools
import json
import socket
import struct
import threading
import time
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

__all__ = ["Faults", "faulty_server"]


@dataclass
class Faults:
    """What the server does next, request by request, and what it was asked.

    Attributes:
        script: names of faults; the last request's answer is good. A message `fault: NAME` names its own.
        url: base address.
        asked: bodies of the requests.
        keys: what the requests authenticated with.
        slow_s: how long a `slow` answer takes.
        at_once: requests that wait for each other before the first of them is answered.
    """

    script: list[str] = field(default_factory=list)
    url: str = ""
    asked: list[dict[str, Any]] = field(default_factory=list)
    keys: list[str] = field(default_factory=list)
    slow_s: float = 1.0
    at_once: threading.Barrier = field(default_factory=lambda: threading.Barrier(1))
    _open: int = 0
    _changed: threading.Condition = field(default_factory=threading.Condition)

    def opened(self, by: int) -> None:
        """Note connections that were opened (by < 0: closed)."""
        with self._changed:
            self._open += by
            self._changed.notify_all()

    def all_closed(self, patience_s: float = 120.0) -> bool:
        """Wait until no connection is open; patience is for what never happens."""
        with self._changed:
            return self._changed.wait_for(lambda: not self._open, patience_s)


_STATUS = {"429": 429, "500": 500, "503": 503, "401": 401, "403": 403, "404": 404, "400": 400, "529": 529}


_FLOOD = b" " * (20 << 20)


def _good(path: str, body: dict[str, Any], ended: str) -> dict[str, Any]:
    """Return an answer that repeats the last message, in the service's own form."""
    text = f"echo: {body['messages'][-1]['content']}"
    if path.endswith("/messages"):
        return {
            "id": "m",
            "type": "message",
            "role": "assistant",
            "model": body["model"],
            "content": [{"type": "text", "text": text}],
            "stop_reason": {"length": "max_tokens", "filter": "refusal"}.get(ended, "end_turn"),
            "stop_sequence": None,
            "usage": {"input_tokens": 7, "output_tokens": 3},
        }
    message = {
        "index": 0,
        "finish_reason": {"length": "length", "filter": "content_filter"}.get(ended, "stop"),
        "message": {"role": "assistant", "content": text},
    }
    usage = {"prompt_tokens": 7, "completion_tokens": 3, "total_tokens": 10}
    return {"id": "c", "object": "chat.completion", "created": 0, "model": body["model"], "choices": [message],
            "usage": usage}  # fmt: skip


def _bomb() -> bytes:
    """Return 300 MB of spaces, packed piece by piece."""
    packer = zlib.compressobj(9, wbits=zlib.MAX_WBITS | 16)
    return b"".join([*(packer.compress(b" " * (1 << 20)) for _ in range(300)), packer.flush()])


def _handler(faults: Faults) -> type[BaseHTTPRequestHandler]:
    turn = threading.Lock()

    class Handler(BaseHTTPRequestHandler):
        def setup(self) -> None:
            super().setup()
            faults.opened(1)

        def finish(self) -> None:
            try:
                super().finish()
            except ConnectionError:
                pass
            finally:
                faults.opened(-1)

        def do_POST(self) -> None:
            body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            key = self.headers.get("Authorization", "") + self.headers.get("x-api-key", "")
            with turn:
                faults.asked.append(body)
                faults.keys.append(key)
                fault = faults.script.pop(0) if faults.script else "good"
            said = str(body["messages"][-1]["content"])
            fault = said.partition("fault: ")[2] or fault
            faults.at_once.wait()
            if fault == "slow":
                time.sleep(faults.slow_s)
            if fault == "drip":
                self.drip(b"HTTP/1.1 200 OK\r\nX: " + b"x" * 60)
            elif fault == "drip on":
                self.drip(b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\n\r\n", itertools.repeat(b" "))
            elif fault == "hang":
                self.hang()
            elif fault == "reset":
                self.reset()
            elif fault == "bomb":
                self.reply(200, _bomb(), packed=True)
            elif fault == "flood":
                self.reply(200, _FLOOD)
            elif fault == "cut":
                self.reply(200, b'{"id": "c", "choi', length=500)
            elif fault == "nonsense":
                self.reply(200, b"<html>It works!</html>", kind="text/html")
            elif fault == "no json":
                self.reply(200, b'{"id": ')
            elif fault == "no choices":
                self.reply(200, b'{"id": "c", "object": "chat.completion", "choices": [], "content": []}')
            elif fault == "null":
                self.reply(200, b"null")
            elif fault in _STATUS:
                # Some services quote the key they were sent.
                error = {"error": {"message": f"fault {fault}; you sent {key}", "type": "fault"}}
                self.reply(_STATUS[fault], json.dumps(error).encode())
            else:
                self.reply(200, json.dumps(_good(self.path, body, fault)).encode())

        def drip(self, head: bytes, body: Iterable[bytes] = ()) -> None:
            """Send a byte now and then, always before a read would time out, until the client has closed."""
            with contextlib.suppress(ConnectionError):
                for byte in itertools.chain((bytes([byte]) for byte in head), body):
                    self.wfile.write(byte)
                    self.wfile.flush()
                    time.sleep(0.05)
            self.close_connection = True

        def hang(self) -> None:
            """Say nothing until the client has closed."""
            with contextlib.suppress(ConnectionError):
                self.rfile.read(1)
            self.close_connection = True

        def reset(self) -> None:
            """Break the connection off within the body, without the usual farewell."""
            self.reply(200, b'{"id": "c", "choi', length=500)
            self.wfile.flush()
            self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            self.connection.close()

        def reply(
            self, status: int, content: bytes, *, kind: str = "application/json", length: int = 0, packed: bool = False
        ) -> None:
            try:
                self.send_response(status)
                if packed:
                    self.send_header("Content-Encoding", "gzip")
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(length or len(content)))
                if status == 429:
                    self.send_header("Retry-After", "7")
                self.end_headers()
                self.wfile.write(content)
            except ConnectionError:
                return  # the client gave up on a slow answer
            self.close_connection = True

        def log_message(self, format: str, *args: object) -> None:
            """Say nothing."""

    return Handler


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    request_queue_size = 128


@contextmanager
def faulty_server(*script: str) -> Iterator[Faults]:
    """Serve until the context ends."""
    faults = Faults(list(script))
    server = _Server(("127.0.0.1", 0), _handler(faults))
    faults.url = f"http://127.0.0.1:{server.server_address[1]}"
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield faults
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
