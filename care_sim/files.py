"""Files that are there whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from care_sim.errors import InvalidInput

_being_written: set[Path] = set()


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A file beside `path` to write to, which takes its place in one move at the end: readers see the old file or the
    new. Its name has the same ending.

    Raises InvalidInput for a folder and for a file that this process is writing already, OSError where nothing can be
    written, before anything is computed.
    """
    place = path.resolve()
    if path.is_dir():
        raise InvalidInput(f"{path} is a folder, a file is wanted")
    if place in _being_written:
        raise InvalidInput(f"{path} is being written already: close what writes it, or name another file")
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{os.getpid()}.{path.name}")
    unfinished.touch()
    _being_written.add(place)
    try:
        yield unfinished
        unfinished.replace(path)
    finally:
        _being_written.remove(place)
        unfinished.unlink(missing_ok=True)
