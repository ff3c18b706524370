"""Files that are there whole or not at all. Every file that CARE-Sim writes goes through here, but
for journals.

A program may be ended at any time, and a disk may be full. A file that is written in its own place
is then cut short, and the old one is gone. So content goes to a file beside it, on the same file
system, where a move is one step that cannot be half done.
"""

import errno
import json
import os
import re
import shutil
import socket
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
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
"""What files of these kinds begin with, as patterns. Weights and checkpoints are ZIP."""

_MORE_BYTES = 2**16
_being_written: set[Path] = set()


@contextmanager
def replacing(path: Path, kind: bytes = b"") -> Iterator[Path]:
    """Yield a file to write to, with the same ending, which takes the place of `path` in one move
    at the end: readers see the old file or the new one. The file replaces a link at `path`: nothing
    is written through a link. A stream, such as a device or a pipe, is written into.

    Raises what `check_output` does, before anything is computed; an error of writing names `path`.
    """
    check_output(path, kind)
    with _written_into(path) if _is_stream(path) else _moved_to(path) as unfinished:
        yield unfinished


def told_if_replaced(path: Path) -> str:
    """The path as it is told when it is about to be written, and whether something lies there."""
    return f"{path} (the earlier one is replaced)" if path.exists() else str(path)


def check_output(path: Path, kind: bytes = b"") -> None:
    """Raise InvalidInput for a `path` that nothing can be written to, that this process is writing
    already, or that holds a file which does not begin like one of `kind`. Raise OSError where
    writing is not allowed. The folder is made.
    """
    # What stands there decides first. Then a file is made beside it and removed again, which tells
    # at once what the system would not allow at the end.
    if _is_stream(path):
        return
    if path.is_dir():
        raise InvalidInput(f"{path} is a folder, a file is wanted")
    if path.exists() and not path.is_symlink():
        if not path.is_file():
            raise InvalidInput(f"{path} is a block device or a socket: name a file")
        _check_old(path, kind)
    with _moved_to(path, keep=False):
        pass
    _clear_away_before(path)


def check_no_link(path: Path) -> None:
    """Raise InvalidInput where a file that grows has another name, or where it, or a folder inside
    an output folder, is a symbolic link: the target may lie anywhere.
    """
    if path.is_symlink() or (path.is_file() and path.stat().st_nlink > 1):
        raise InvalidInput(f"{path} is a link, and links are not followed here: remove it first")


def write_text(path: Path, text: str) -> None:
    """Write a text as a file, whole or not at all."""
    with replacing(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


def _check_old(path: Path, kind: bytes) -> None:
    """Raise for a file that must not be replaced."""
    # A move asks for rights to the folder alone. A file that may not be written is meant to stay.
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
def _moved_to(path: Path, keep: bool = True) -> Iterator[Path]:
    """Yield a file beside `path`, with the rights of the old file, which is moved there or, if not
    kept, removed.
    """
    # Two writers of one file would each lose what the other wrote, and share the name beside it.
    place = _place(path)
    if place in _being_written:
        raise InvalidInput(
            f"{path} is being written already: close what writes it, or name another file"
        )
    unfinished = place.with_name(f".{_host()}.{os.getpid()}.{_end_of_name(place)}")
    _being_written.add(place)
    try:
        # By its name: the resolved one would make the missing target of a link.
        path.parent.mkdir(parents=True, exist_ok=True)
        # Anybody who may write to the folder can guess the name: no link there is followed.
        unfinished.unlink(missing_ok=True)
        unfinished.open("x").close()
        yield unfinished

        # An error before this line leaves the old file as it is.
        if keep:
            if place.is_file() and not place.is_symlink():
                shutil.copymode(place, unfinished)
            unfinished.replace(place)
    except OSError as error:
        raise _named(error, path, unfinished) from error
    finally:
        _being_written.remove(place)
        unfinished.unlink(missing_ok=True)


def why_unwritable(path: Path) -> str | None:
    """Why a file cannot grow, None where it can. Libraries that write to it may not have told."""
    try:
        with path.open("ab", buffering=0) as file:
            written = file.write(bytes(_MORE_BYTES))
            # A disk takes what fits, and says at the next byte why not more.
            file.write(bytes(_MORE_BYTES - written))
    except OSError as error:
        return error.strerror
    return None


@contextmanager
def _written_into(path: Path) -> Iterator[Path]:
    """Yield a file elsewhere whose content goes into the stream `path`."""
    with _opened(path) as handle, TemporaryDirectory(prefix="care-sim-") as folder:
        # Its ending tells writers the form; of a name such as ..gif they would see none.
        unfinished = Path(folder) / f"stream{path.suffix}"
        unfinished.touch()
        yield unfinished

        # What was printed before must come before, where the stream is the output of this process.
        sys.stdout.flush()
        try:
            with (
                unfinished.open("rb") as content,
                os.fdopen(handle, "ab", closefd=False) as target,
            ):
                shutil.copyfileobj(content, target)
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(path)) from error


@contextmanager
def _opened(path: Path) -> Iterator[int]:
    """Yield the open descriptor of a stream. Raises InvalidInput for a pipe without a reader: a
    plain open would wait for ever.
    """
    try:
        handle = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_NONBLOCK)
    except OSError as error:
        if error.errno == errno.ENXIO and path.is_fifo():
            raise InvalidInput(f"nobody reads the pipe {path}: start its reader first") from error
        raise
    os.set_blocking(handle, True)
    try:
        yield handle
    finally:
        os.close(handle)


def _clear_away_before(path: Path) -> None:
    """Remove what writers of the file have left beside it that were killed on this host."""
    # The name tells host and process: on a shared file system another host's may still be at work.
    place = _place(path)
    ours = re.compile(rf"\.{_host()}\.(\d{{1,9}})\.{re.escape(_end_of_name(place))}")
    for name in os.listdir(place.parent):
        left = ours.fullmatch(name)
        if left and not _runs(int(left[1])):
            with suppress(OSError):
                place.with_name(name).unlink()


def _runs(pid: int) -> bool:
    """Whether there is a process of this number: signal 0 asks without sending anything."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:  # it is another user's
        return True
    return True


def _host() -> str:
    return re.sub(r"\W", "-", socket.gethostname(), flags=re.ASCII)[:30]


def _end_of_name(place: Path) -> str:
    """As much of the file's name as fits beside the rest into the 255 bytes of a name."""
    return os.fsencode(place.name)[-200:].decode(errors="ignore")


def _is_stream(path: Path) -> bool:
    """Whether `path` is a character device, a pipe or what this process prints to, be it a file.
    Only the system's own links, such as /dev/stdout, lead to a stream.
    """
    systems = (Path("/dev"), Path("/proc/self/fd").resolve())
    if path.is_symlink() and path.parent.resolve() not in systems:
        return False
    try:
        there = path.stat()
    except OSError:
        return False
    if stat.S_ISCHR(there.st_mode) or stat.S_ISFIFO(there.st_mode):
        return True
    return any(os.path.samestat(there, printed) for printed in _printed_to())


def _printed_to() -> Iterator[os.stat_result]:
    for descriptor in (1, 2):
        try:
            yield os.fstat(descriptor)
        except OSError:  # it is closed
            continue


def _place(path: Path) -> Path:
    """The path with every link resolved but the last name, which is replaced if it is a link."""
    try:
        return path.parent.resolve() / path.name
    except RuntimeError as error:
        raise InvalidInput(
            f"{path.parent} is a link that leads back to itself: name a folder"
        ) from error


def _named(error: OSError, path: Path, unfinished: Path) -> OSError:
    """The error with the name that the user knows, where it tells of the file or of its disk."""
    of_the_disk = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
    of_the_file = error.filename is not None and os.fspath(error.filename) == str(unfinished)
    return OSError(error.errno, error.strerror, str(path)) if of_the_disk or of_the_file else error


MOST_LEVELS = 200
"""Levels that lists and maps may be nested: more than any file here needs, few enough for all that
walk them.
"""
MOST_BYTES = 2**28
"""Bytes of a file: more than the longest of ours, the configurations of a study (100,000 tasks of 2
kB).
"""
MOST_CHARACTERS = 2**18
"""Characters of one value of a list that is read value by value: five hundred times a row."""
_CHUNK = 2**21
_OPENED = re.compile(r"[ \t\n\r]*\[[ \t\n\r]*(\][ \t\n\r]*)?")
_VALUE_ENDED = re.compile(r"[ \t\n\r]*([,\]])[ \t\n\r]*")


def json_content(path: Path, most: int = MOST_BYTES) -> Any:
    """The content of a file of at most `most` bytes.

    Raises OSError for a file that cannot be read, ValueError as `check_file_size` and `parsed_json`
    do, and for one that the memory does not hold.
    """
    # The size is looked at first, so that a file of another kind is refused before it fills the
    # memory.
    check_file_size(path, most)
    try:
        return parsed_json(path.read_text(encoding="utf-8"))
    except MemoryError as error:
        raise ValueError("it is larger than the memory that is free") from error


def listed_values(path: Path, most: int = MOST_BYTES) -> Iterator[Any]:
    """The values of the list that a file of at most `most` bytes holds, one after the other: only
    some of them lie in memory at a time. Each may be `MOST_CHARACTERS` long.

    Raises OSError for a file that cannot be read, ValueError as `check_file_size` does, for what is
    no JSON or no list, and for a value too deep for Python; values before it have come by then.
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
    """The content of a text.

    Raises ValueError for what is no JSON, and for what is nested deeper than `MOST_LEVELS`, or so
    deep that Python cannot read it.
    """
    try:
        content = json.loads(text)
    except RecursionError as error:
        raise ValueError("it is nested too deep") from error
    if _is_deep(content):
        raise ValueError(f"it is nested deeper than {MOST_LEVELS} levels")
    return content


def _is_deep(content: object) -> bool:
    """Whether it is; level by level, without recursion."""
    # One pass per level keeps only the lists and maps that lie one level deeper.
    level = [content]
    for _ in range(MOST_LEVELS):
        level = [
            each
            for thing in level
            if isinstance(thing, list | dict)
            for each in (thing.values() if isinstance(thing, dict) else thing)
            if isinstance(each, list | dict)
        ]
        if not level:
            return False
    return True
