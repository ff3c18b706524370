"""Threads that work at the same time, and end with whoever asked for them."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any, TypeVar
from weakref import finalize

_T = TypeVar("_T")


class Threads:
    """Up to `count` threads. They begin when they are first needed; none outlives this object."""

    def __init__(self, count: int):
        self._count = count
        self._pool: ThreadPoolExecutor | None = None
        self._process = -1
        self._others: list[Future[Any]] = []

    def all(self, tasks: Sequence[Callable[[], _T]]) -> list[_T]:
        """What every task gives. The first of them is done by the thread that asks."""
        if len(tasks) < 2:
            return [task() for task in tasks]
        # A fork copies no threads: in a new process they begin anew.
        if self._pool is None or self._process != os.getpid():
            self._pool = ThreadPoolExecutor(self._count - 1, "care-sim worlds")
            self._process = os.getpid()
            self._others = []
            finalize(self, self._pool.shutdown, wait=False)
        # Whoever was interrupted while waiting has left some at work.
        wait(self._others)
        self._others = others = [self._pool.submit(task) for task in tasks[1:]]
        # All are waited for, whatever one of them raises: nothing goes on behind the caller's back.
        try:
            first = tasks[0]()
        finally:
            wait(others)
        return [first, *(other.result() for other in others)]

    def close(self) -> None:
        """End the threads; they begin again if they are needed."""
        if self._pool is not None and self._process == os.getpid():
            self._pool.shutdown()
        self._pool = None
