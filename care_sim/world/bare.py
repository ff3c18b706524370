"""Importing parts of a package whose own import costs far more than they do."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec, module_from_spec


@contextmanager
def bare(package: str) -> Iterator[None]:
    """Modules of `package` are imported without running the package's own code while this lasts.

    They are forgotten at the end: whoever imports the package later gets it whole, in copies of its
    own. A package that is imported already is left as it is.
    """
    spec = None if package in sys.modules else find_spec(package)
    if spec is None:
        yield
        return
    sys.modules[package] = module_from_spec(spec)
    try:
        yield
    finally:
        for name in [name for name in sys.modules if name.partition(".")[0] == package]:
            del sys.modules[name]
