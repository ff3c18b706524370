"""One core for all that a process does."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_THREADS = Path("/proc/self/task")


@contextmanager
def one_core() -> Iterator[None]:
    """Keep every thread of this process on one core while this lasts; without effect where only
    Linux could.
    """
    if not _THREADS.exists():
        yield
        return
    allowed = os.sched_getaffinity(0)
    _bind({max(allowed)})
    try:
        yield
    finally:
        _bind(allowed)


def _bind(cores: set[int]) -> None:
    for thread in _THREADS.iterdir():
        with suppress(ProcessLookupError):
            os.sched_setaffinity(int(thread.name), cores)
