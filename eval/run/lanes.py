"""Episodes of one process side by side, in threads: while one waits for a model, others plan and drive."""

from __future__ import annotations

import queue
import threading

from eval.run.episodes import Episode
from eval.run.rig import Finished, Rig

__all__ = ["Lanes", "lanes_for"]

_LANES_PER_CONNECTION = 4
_MOST_LANES = 256


def lanes_for(connections: int) -> int:
    """Return how many episodes are under way for so many calls at once.

    More than calls, since methods that ask the same wait for one answer.
    """
    return 1 if connections == 1 else min(_MOST_LANES, _LANES_PER_CONNECTION * connections)


class Lanes:
    """Threads that run episodes of one rig. They end with the process and hold nothing up."""

    def __init__(self, rig: Rig, count: int, timeout_s: float | None = None) -> None:
        """Start the threads.

        Args:
            rig: checked and warm.
            count: episodes under way at once.
            timeout_s: as of `Rig.run`.
        """
        self.count = count
        self._rig, self._timeout_s = rig, timeout_s
        self._waiting: queue.SimpleQueue[tuple[int, Episode] | None] = queue.SimpleQueue()
        self._ended: queue.SimpleQueue[tuple[int, Finished | None]] = queue.SimpleQueue()
        for _ in range(count):
            threading.Thread(target=self._serve, daemon=True).start()

    def put(self, number: int, episode: Episode) -> None:
        """Give an episode to the next thread that is free."""
        self._waiting.put((number, episode))

    def get(self) -> tuple[int, Finished]:
        """Wait for an episode to end; return its number and what it came to.

        Raises:
            KeyboardInterrupt: the user's, or an agent's in one of the threads.
        """
        number, finished = self._ended.get()
        if finished is None:
            raise KeyboardInterrupt
        return number, finished

    def close(self) -> None:
        """Let threads end after what they are doing."""
        for _ in range(self.count):
            self._waiting.put(None)

    def _serve(self) -> None:
        while (given := self._waiting.get()) is not None:
            number, episode = given
            finished = None
            try:
                finished = self._rig.run(episode, self._timeout_s)
            finally:
                self._ended.put((number, finished))
