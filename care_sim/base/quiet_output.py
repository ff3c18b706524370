"""Silence for libraries that print from C."""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager

STANDARD_OUTPUT, STANDARD_ERROR = 1, 2


@contextmanager
def silenced(descriptor: int) -> Iterator[None]:
    """Nothing that is written to a file descriptor comes through while this lasts."""
    c_library = ctypes.CDLL(None)
    c_library.fflush(None)
    kept, nowhere = os.dup(descriptor), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, descriptor)
    try:
        yield
    finally:
        c_library.fflush(None)
        os.dup2(kept, descriptor)
        os.close(kept)
        os.close(nowhere)
