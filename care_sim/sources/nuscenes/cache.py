"""Tables that take long to make, kept in files that later processes map into their memory."""

import fcntl
import hashlib
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pyarrow as pa

from care_sim.base.digests import file_stamp
from care_sim.base.errors import InvalidInput
from care_sim.base.files import check_output, replacing

ARROW = rb"ARROW1"
_STAMP = b"made of"


def cached_table(
    file: Path, form: str, sources: Iterable[Path], make: Callable[[], pa.Table]
) -> pa.Table:
    """The table that `make` makes of the files `sources`, in the given `form`.

    It is kept in `file`, or where that cannot be written in the user's cache folder
    (`XDG_CACHE_HOME`, else `~/.cache`). It is made anew when a source has changed, when the file is
    cut short, and when nothing can be kept. Of processes that want it at once the first makes it.
    """
    stamp = _stamp(form, sources)
    for place in _places(file):
        table = _kept(place, stamp, make)
        if table is not None:
            return table
    return make()


def _places(file: Path) -> Iterator[Path]:
    yield file
    folder = hashlib.sha256(os.fsencode(file.parent.resolve())).hexdigest()[:16]
    with suppress(RuntimeError):  # the user has no home folder
        caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        yield caches / "care-sim" / folder / file.name


def _stamp(form: str, sources: Iterable[Path]) -> str:
    """Tells the sources as they are now from the same at another time."""
    stamps = [file_stamp(source)[1:] for source in sources if source.is_file()]
    return hashlib.sha256(repr((form, stamps)).encode()).hexdigest()


def _kept(place: Path, stamp: str, make: Callable[[], pa.Table]) -> pa.Table | None:
    """The table in the file `place`, made if it is not there; None where none can be kept."""
    table = _mapped(place, stamp)
    if table is not None:
        return table
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    with _alone(place.parent):
        # Another process may have made it while this one waited.
        table = _mapped(place, stamp)
        if table is None and _can_be_written(place):
            table = make().replace_schema_metadata({_STAMP: stamp})
            with suppress(OSError):  # the disk is full: it stays in memory alone
                _write(place, table)
                table = _mapped(place, stamp) or table
    return table


def _can_be_written(place: Path) -> bool:
    try:
        check_output(place, ARROW)
    except (OSError, InvalidInput):
        return False
    return True


def _mapped(place: Path, stamp: str) -> pa.Table | None:
    """The table of the file, which stays on the disk until it is read; None of another one."""
    try:
        table = pa.ipc.open_file(pa.memory_map(os.fspath(place))).read_all()
    # Arrow maps no file whose name is not UTF-8.
    except (OSError, UnicodeError, pa.ArrowException):
        return None
    return table if (table.schema.metadata or {}).get(_STAMP) == stamp.encode() else None


def _write(place: Path, table: pa.Table) -> None:
    with replacing(place, ARROW) as unfinished, unfinished.open("wb") as file:
        with pa.ipc.new_file(file, table.schema) as writer:
            writer.write_table(table)
        # On the disk before it gets its name: after a power cut it would else be there, and empty.
        file.flush()
        os.fsync(file.fileno())


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Other processes that ask for the same wait meanwhile."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:  # a folder that may not be listed
        yield
        return
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
