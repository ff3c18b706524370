"""Compiled functions (numba), whose machine code is kept for later processes.

Numba recompiles a function only when its own file changes. Here a file of kernels may use compiled
functions, named tuples and constants of other files, so kept code also depends on those.
"""

import hashlib
import inspect
import sys
from collections.abc import Callable, Iterator
from functools import cache
from types import ModuleType
from typing import Any, TypeVar

import numpy as np
from numba import config, njit
from numba.core import event

_F = TypeVar("_F", bound=Callable[..., Any])


def compiled(*, brief: bool = False, **options: Any) -> Callable[[_F], _F]:
    """Compile a function at its first call; `options` are those of `numba.njit`. Other Python
    threads may run meanwhile, unless the function is `brief`.

    The code is kept beside the file, or in the user's cache folder, or where NUMBA_CACHE_DIR says.
    Where none of these can be written, every process compiles anew. With NUMBA_DISABLE_JIT=1
    functions stay Python, for debuggers and measures of coverage.
    """
    # Releasing the GIL costs a wait to reacquire it.
    nogil = not brief

    def make(function: _F) -> Any:
        if config.DISABLE_JIT:
            # Compiled code overflows and divides by zero without a warning.
            return np.errstate(all="ignore")(function)
        try:
            kernel = njit(cache=True, nogil=nogil, **options)(function)
        except RuntimeError:  # nowhere to keep it
            return njit(nogil=nogil, **options)(function)
        # Numba reads the version before anything else of what is kept, and drops code of another
        # one. So code from other sources is never even unpickled: the classes of its arguments may
        # be gone by now. Numba does not keep options apart, either.
        kernel._cache._cache_file._version += f" {_sources_digest(function.__module__)} {nogil=}"
        return kernel

    return make


@cache
def _sources_digest(name: str) -> str:
    """Return a hash of all that is compiled into a module's functions. Covers its source, the
    constants that it holds or imports, and the same of the modules whose functions and named tuples
    it uses.
    """
    # Numba writes constants of the module into the machine code; imported ones are among them.
    module = sys.modules[name]
    constants = [
        (name, value)
        for name, value in vars(module).items()
        if not name.startswith("__") and isinstance(value, int | float | str | tuple)
    ]
    others = sorted(set(_used_modules(module)))
    content = inspect.getsource(module), repr(constants), *map(_sources_digest, others)
    return hashlib.sha256("\n".join(content).encode()).hexdigest()


def _used_modules(module: ModuleType) -> Iterator[str]:
    """The other modules whose compiled functions and named tuples a module imports."""
    for value in vars(module).values():
        is_named_tuple = isinstance(value, type) and hasattr(value, "_fields")
        if (is_named_tuple or hasattr(value, "py_func")) and value.__module__ != module.__name__:
            yield value.__module__


class _CompileNotice(event.Listener):  # type: ignore[misc]
    """Prints a notice once per process when the first use on a machine compiles."""

    def on_start(self, event: Any) -> None:
        """A function is compiled, not read from what is kept."""
        if event.data["dispatcher"].py_func.__module__.startswith("care_sim"):
            _stop_listening()
            if sys.stderr.isatty():
                print(
                    "care_sim: compiling; this takes up to a minute, once on a machine",
                    file=sys.stderr,
                )

    def on_end(self, event: Any) -> None:
        """Nothing to say."""


_NOTICE = _CompileNotice()
event.register("numba:compile", _NOTICE)


def _stop_listening() -> None:
    event.unregister("numba:compile", _NOTICE)
