"""Threads that share the worlds of compiled kernels."""

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Threads:
    """Up to `count` threads, the calling one among them. The others begin when they are first
    needed; none outlives this object.
    """

    def __init__(self, count: int):
        self._count = count
        self._pool: ThreadPoolExecutor | None = None
        self._process = -1
        self._others: list[Future[None]] = []

    def share(self, kernel: Callable[..., None], live: NDArray[np.bool_], *given: Any) -> None:
        """Run `kernel(live, *given)`, which works on the rows of the worlds that are `live` (W,)
        alone. Every thread takes some of these worlds.
        """
        self.settle()
        count = min(self._count, int(np.count_nonzero(live)))
        if count < 2:
            kernel(live, *given)
            return
        worlds = np.flatnonzero(live)
        parts = np.zeros((count, len(live)), np.bool_)
        parts[np.arange(len(worlds)) * count // len(worlds), worlds] = True
        pool = self._executor()
        others = self._others = list[Future[None]]()
        # All are waited for, whatever one of them raises: no task outlives the call.
        try:
            others.extend(pool.submit(kernel, part, *given) for part in parts[1:])
            kernel(parts[0], *given)
        finally:
            self.settle()
        # An error must not hold the list that holds it.
        while others:
            others.pop().result()

    def settle(self) -> None:
        """Wait for what an interrupt while waiting has left at work."""
        # A fork copies no threads, and so no work.
        if self._process == os.getpid():
            for other in self._others:
                other.exception()

    def close(self) -> None:
        """End the threads; they begin again if they are needed."""
        if self._pool is not None and self._process == os.getpid():
            self._pool.shutdown()
        self._pool = None

    def __getstate__(self) -> dict[str, Any]:
        return vars(Threads(self._count))

    def _executor(self) -> ThreadPoolExecutor:
        """Return the other threads. In a new process they begin anew."""
        if self._pool is None or self._process != os.getpid():
            self._pool = ThreadPoolExecutor(self._count - 1, "care-sim worlds")
            self._process = os.getpid()
        return self._pool


ALONE = Threads(1)
"""The calling thread."""
