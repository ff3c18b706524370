"""Compiled functions (numba), whose machine code is kept for later processes.

They lie in files whose names end in `kernels.py`, and may call each other across files: what is
kept is used only while all of these files are as they were.
"""

import hashlib
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from numba import njit
from numba.core import event
from numba.core.caching import FunctionCache, IndexDataCacheFile

PACKAGE = Path(__file__).parents[1]


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function at its first call; `options` are those of `numba.njit`.

    The code is kept beside the file, or in the user's cache folder, or where NUMBA_CACHE_DIR says.
    Where none of these can be written every process compiles anew.
    """

    def make(function: Callable[..., Any]) -> Any:
        dispatcher = njit(**options)(function)
        # Numba raises RuntimeError where it finds no folder that can be written.
        with suppress(RuntimeError):
            dispatcher._cache = _KernelCache(function)
        return dispatcher

    return make


class _KernelCache(FunctionCache):  # type: ignore[misc]
    """Numba's cache of a function; by itself it notices a change in the function's file only."""

    def __init__(self, function: Callable[..., Any]):
        super().__init__(function)
        stamp = self._impl.locator.get_source_stamp(), _sources()
        self._cache_file = IndexDataCacheFile(self._cache_path, self._impl.filename_base, stamp)


@cache
def _sources() -> str:
    """A hash of all files of kernels."""
    content = hashlib.sha256()
    for file in sorted(PACKAGE.rglob("*kernels.py")):
        content.update(
            file.relative_to(PACKAGE).as_posix().encode() + b"\0" + file.read_bytes() + b"\0"
        )
    return content.hexdigest()


class _Patience(event.Listener):  # type: ignore[misc]
    """Says on a terminal, once a process, that the first use on a machine takes its time."""

    def on_start(self, event: Any) -> None:
        """A function is compiled, not read from what is kept."""
        if event.data["dispatcher"].py_func.__module__.startswith("care_sim"):
            _stop_listening()
            if sys.stderr.isatty():
                print(
                    "care_sim: compiling; this takes half a minute, once on a machine",
                    file=sys.stderr,
                )

    def on_end(self, event: Any) -> None:
        """Nothing to say."""


_PATIENCE = _Patience()
event.register("numba:compile", _PATIENCE)


def _stop_listening() -> None:
    event.unregister("numba:compile", _PATIENCE)
