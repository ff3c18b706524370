"""Files that are written whole or not at all, and JSON from a user's files.

Every file that CARE-Sim writes goes through here, except journals. A program may be ended at any
time, and a disk may be full. A file written in place would then be cut short, and the old one lost.
So content goes to a file beside it, on the same file system, where a move cannot be half done.
"""

import errno
import fcntl
import json
import os
import re
import shutil
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from care_sim.base.errors import InvalidInput

PNG = rb"\x89PNG"
GIF = rb"GIF8"
WEBP = rb"RIFF"
MP4 = rb".{4}ftyp"
HTML = rb"<!doctype"
JSON = rb"\s*[{[]"
SVG = rb"<\?xml|<svg"
ZIP = rb"PK"
RERUN = rb"RRF"
"""First bytes of each kind of file, as patterns. Weights and checkpoints are ZIP."""

MOST_BYTES = 2**28
"""Bytes of a file of JSON: more than the longest of ours, the configurations of a study (100,000
tasks of 2 kB).
"""
MOST_CHARACTERS = 2**18
"""Characters of one value of a list that is read value by value: five hundred times a row."""
_CHUNK = 2**21
_OPENED = re.compile(r"[ \t\n\r]*\[[ \t\n\r]*(\][ \t\n\r]*)?")
_VALUE_ENDED = re.compile(r"[ \t\n\r]*([,\]])[ \t\n\r]*")
_WAITS_S = (0.05, 0.1, 0.2)
_MORE_BYTES = 2**16


def cache_folder(name: str) -> Path:
    """Return the folder of a kind of files that can be made again, in the user's cache folder
    (`XDG_CACHE_HOME`, else `~/.cache`).
    """
    caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache").absolute()
    return caches / "care-sim" / name


@contextmanager
def replacing(path: Path, kind: bytes = b"") -> Iterator[Path]:
    """Yield a file to write to, which replaces `path` in one move at the end. Readers see the old
    file or the new one. The yielded file has the same ending. It replaces a link at `path`, and
    never writes through it.

    Raises as `check_output` does, before anything is computed. An error of writing names `path`.
    """
    check_output(path, kind)
    place = path.absolute()
    with _beside(path) as unfinished:
        yield unfinished
        # An error before this line leaves the old file as it is.
        if place.is_file() and not place.is_symlink():
            shutil.copymode(place, unfinished)
        unfinished.replace(place)


def describe_output(path: Path) -> str:
    """Return the path as messages show it, and whether it exists."""
    return f"{path} (the earlier one is replaced)" if path.exists() else str(path)


def check_output(path: Path, kind: bytes = b"") -> None:
    """Raise InvalidInput for a `path` that cannot be written, that another process is writing, or
    that holds a file of another `kind`. Raise OSError where writing is not allowed. The folder is
    made.
    """
    # Check first what exists at the path. Then a file is made beside it and removed again, so that
    # a missing permission shows now, and not at the end.
    if path.is_dir():
        raise InvalidInput(f"{path} is a folder, a file is wanted")
    # The system's own links, such as /dev/stdout, are not to be replaced.
    is_systems = os.path.realpath(path.parent) in ("/dev", os.path.realpath("/proc/self/fd"))
    is_there = path.exists() and not path.is_symlink()
    if is_systems or (is_there and not path.is_file()):
        raise InvalidInput(f"{path} is a device, a pipe or a socket: name a file")
    if is_there:
        _check_old(path, kind)
    with _beside(path):
        pass


def check_no_link(path: Path) -> None:
    """Raise InvalidInput for hard links and symbolic links, of a file that grows or a folder in an
    output folder. Their target may lie anywhere.
    """
    if path.is_symlink() or (path.is_file() and path.stat().st_nlink > 1):
        raise InvalidInput(f"{path} is a link, and links are not followed here: remove it first")


def write_text(path: Path, text: str) -> None:
    """Write a text as a file, whole or not at all."""
    with replacing(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


def why_unwritable(path: Path) -> str | None:
    """Return why a file cannot grow, None if it can. Libraries that write to it may hide errors."""
    try:
        with path.open("ab", buffering=0) as file:
            written = file.write(bytes(_MORE_BYTES))
            # A disk takes what fits, and says at the next byte why not more.
            file.write(bytes(_MORE_BYTES - written))
    except OSError as error:
        return error.strerror
    return None


def _check_old(path: Path, kind: bytes) -> None:
    """Raise for a file that must not be replaced."""
    # A move only needs write access to the folder. A write-protected file is meant to stay.
    if not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, "it is there and may not be written", str(path))
    with path.open("rb") as old:
        head = old.read(64)
    if head and not re.match(kind, head, re.DOTALL):
        raise InvalidInput(
            f"{path} holds something else than what would be written there: remove it first, or"
            " name another file"
        )


@contextmanager
def _beside(path: Path) -> Iterator[Path]:
    """Yield an empty file beside `path`, which is removed at the end where it is still there."""
    # One name for all writers of a file, so that what a killed one has left is overwritten. As much
    # of the file's name as fits beside the rest into the 255 bytes of a name: its ending tells
    # writers the form.
    end = os.fsencode(path.name)[-200:].decode(errors="ignore")
    unfinished = path.absolute().with_name(f".unfinished-{end}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with _locked(unfinished, path):
            yield unfinished
    except OSError as error:
        raise _named(error, path, unfinished) from error


@contextmanager
def _locked(unfinished: Path, path: Path) -> Iterator[None]:
    """Make a file, or empty it, and keep other writers away from it."""
    # Anybody who may write to the folder can guess the name: no link there is followed, and no file
    # with another name is emptied.
    if unfinished.is_symlink() or (unfinished.exists() and unfinished.stat().st_nlink > 1):
        unfinished.unlink()
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW
    # Another writer may only look whether the file can be written, which takes a moment.
    for wait_s in (*_WAITS_S, None):
        with os.fdopen(os.open(unfinished, flags, 0o666), "r+b") as file:
            if _is_locked(file.fileno(), unfinished):
                file.truncate()
                try:
                    yield
                finally:
                    # Once it has been moved, the name may be another writer's.
                    with suppress(FileNotFoundError):
                        if os.path.samestat(os.fstat(file.fileno()), unfinished.stat()):
                            unfinished.unlink()
                return
        if wait_s is not None:
            time.sleep(wait_s)
    raise InvalidInput(
        f"{path} is being written already: close what writes it, or name another file"
    )


def _is_locked(handle: int, unfinished: Path) -> bool:
    """Lock an open file for this process, which holds the lock until it closes the file or ends.
    Return False where another writer holds it, or has moved the file meanwhile.
    """
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return os.path.samestat(os.fstat(handle), unfinished.stat())
    except (BlockingIOError, FileNotFoundError):
        return False
    except OSError:  # a file system without locks
        return True


def _named(error: OSError, path: Path, unfinished: Path) -> OSError:
    """The error with the name that the user knows, where it tells of the file or of its disk."""
    of_the_disk = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
    of_the_file = error.filename is not None and os.fspath(error.filename) == str(unfinished)
    return OSError(error.errno, error.strerror, str(path)) if of_the_disk or of_the_file else error


def json_content(path: Path, most: int = MOST_BYTES) -> Any:
    """The content of a file of at most `most` bytes.

    Raises OSError for a file that cannot be read, ValueError as `check_file_size` and `parsed_json`
    do.
    """
    # The size is looked at first, so that a file of another kind is refused before it fills the
    # memory.
    check_file_size(path, most)
    return parsed_json(path.read_text(encoding="utf-8"))


def listed_values(path: Path, most: int = MOST_BYTES) -> Iterator[Any]:
    """Yield the values of the list in a file of at most `most` bytes. Only some of them are in
    memory at a time. Each may be `MOST_CHARACTERS` long.

    Raises OSError for a file that cannot be read, and ValueError as `check_file_size` does. Raises
    ValueError, after the values before it, for text that is not JSON, not a list, or too deep for
    Python.
    """
    check_file_size(path, most)
    decode = json.JSONDecoder().raw_decode
    with path.open(encoding="utf-8") as file:
        text = file.read(_CHUNK)
        opened = _OPENED.match(text)
        if opened is None:
            raise ValueError("it holds no list")
        place = opened.end()
        is_open = opened[1] is None
        number = 0
        while is_open:
            number += 1
            # From here on the text holds the next value as a whole, or all that is left.
            if len(text) - place < MOST_CHARACTERS:
                text, place = text[place:] + file.read(_CHUNK), 0
            try:
                value, place = decode(text, place)
            except RecursionError as error:
                raise ValueError("it is nested too deep") from error
            # The place that the error tells is one of the text in memory, not of the file.
            except json.JSONDecodeError as error:
                limit = f"at most {MOST_CHARACTERS} characters"
                raise ValueError(f"value {number} is no JSON of {limit}: {error.msg}") from error
            yield value
            ended = _VALUE_ENDED.match(text, place)
            if ended is None:
                raise ValueError("neither a comma nor the end of the list after a value")
            place = ended.end()
            is_open = ended[1] == ","
        if place < len(text) or file.read(1):
            raise ValueError("text after the end of the list")


def check_file_size(path: Path, most: int = MOST_BYTES) -> None:
    """Raise ValueError for a file of more than `most` bytes, and for what is none, such as a device
    without end.
    """
    there = path.stat()
    if not stat.S_ISREG(there.st_mode):
        raise ValueError("it is not a regular file")
    if there.st_size > most:
        raise ValueError(f"it holds {there.st_size} bytes and may hold {most}")


def parsed_json(text: str | bytes) -> Any:
    """The content of a text. Raises ValueError for what is no JSON, and for what is nested too deep
    for Python.
    """
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError("it is nested too deep") from error
