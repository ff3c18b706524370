"""Durations of calls, taken from outside the code that is measured."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def timed(owner: Any, name: str) -> Iterator[list[float]]:
    """The durations, in seconds, of the calls of `owner.name` (of a class or a module) while this
    lasts.
    """
    durations: list[float] = []
    inherited, original = name not in vars(owner), vars(owner).get(name)
    call = getattr(owner, name)

    def measured(*arguments: Any, **named: Any) -> Any:
        started = time.perf_counter()
        try:
            return call(*arguments, **named)
        finally:
            durations.append(time.perf_counter() - started)

    setattr(owner, name, staticmethod(measured) if isinstance(original, classmethod) else measured)
    try:
        yield durations
    finally:
        delattr(owner, name) if inherited else setattr(owner, name, original)
