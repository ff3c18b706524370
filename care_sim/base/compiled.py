"""Compiled functions (numba), whose machine code is kept for later processes.

What is kept notices a change in a function's own file only: compiled functions of one file call none of another.
"""

import sys
from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core import event


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function at its first call; `options` are those of `numba.njit`.

    The code is kept beside the file, or in the user's cache folder, or where NUMBA_CACHE_DIR says. Where none of these
    can be written every process compiles anew.
    """

    def make(function: Callable[..., Any]) -> Any:
        try:
            return njit(cache=True, **options)(function)
        except RuntimeError:
            return njit(**options)(function)

    return make


class _Patience(event.Listener):  # type: ignore[misc]
    """Says on a terminal, once a process, that the first use on a machine takes its time."""

    def on_start(self, event: Any) -> None:
        """A function is compiled, not read from what is kept."""
        if event.data["dispatcher"].py_func.__module__.startswith("care_sim"):
            _stop_listening()
            if sys.stderr.isatty():
                print("care_sim: compiling; this takes half a minute, once on a machine", file=sys.stderr)

    def on_end(self, event: Any) -> None:
        """Nothing to say."""


_PATIENCE = _Patience()
event.register("numba:compile", _PATIENCE)


def _stop_listening() -> None:
    event.unregister("numba:compile", _PATIENCE)
