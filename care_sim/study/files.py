"""Files that are there whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from care_sim.errors import InvalidInput


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A file beside `path` to write to, which takes its place in one move at the end: readers see the old file or the
    new. Raises InvalidInput for a folder and OSError where nothing can be written, before anything is computed.
    """
    if path.is_dir():
        raise InvalidInput(f"{path} is a folder, a file is wanted")
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    unfinished.touch()
    try:
        yield unfinished
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)
