"""Answers of servers are read to a size, for a time, and no further; a few megabytes can unpack to any."""

from __future__ import annotations

import importlib
import time
from collections.abc import Iterator
from typing import Any

__all__ = ["bounded_client"]

_MOST_BYTES = 16 << 20
_MOST_PACKED_BYTES = 64 << 10
"""Of an answer that is compressed unasked; gzip makes a thousand times as much of it at most."""


def bounded_client(sdk: Any, timeout_s: float) -> Any:
    """Return an HTTP client of an SDK (openai or anthropic) that asks for plain answers and reads no endless ones.

    Args:
        sdk: the SDK's module.
        timeout_s: of one read, and of an answer's body in all: whoever waited for it has gone by then, and its
            connection is closed.
    """
    http: Any = importlib.import_module(sdk.DefaultHttpxClient.__mro__[1].__module__.partition(".")[0])

    class Bounded(http.SyncByteStream):  # type: ignore[misc]
        def __init__(self, stream: Any, most: int) -> None:
            self._stream, self._most = stream, most
            self._until_s = time.monotonic() + timeout_s

        def __iter__(self) -> Iterator[bytes]:
            total = 0
            for piece in self._stream:
                total += len(piece)
                if total > self._most:
                    raise http.DecodingError(f"an answer of more than {self._most} bytes")
                if time.monotonic() > self._until_s:
                    raise http.ReadTimeout(f"an answer that takes more than {timeout_s:g} s")
                yield piece

        def close(self) -> None:
            self._stream.close()

    def bound(response: Any) -> None:
        packed = response.headers.get("content-encoding", "identity") != "identity"
        response.stream = Bounded(response.stream, _MOST_PACKED_BYTES if packed else _MOST_BYTES)

    class Client(sdk.DefaultHttpxClient):  # type: ignore[misc]
        """Closes its connections when it is gone, as the SDK's own default client does."""

        def __del__(self) -> None:
            if not self.is_closed:
                self.close()

    return Client(timeout=timeout_s, headers={"Accept-Encoding": "identity"}, event_hooks={"response": [bound]})
