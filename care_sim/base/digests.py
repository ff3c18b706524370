"""Hashes of files and folders, and which files lie below a folder."""

import hashlib
import os
from collections.abc import Iterable, Iterator
from functools import lru_cache
from itertools import islice
from pathlib import Path

from care_sim.base.errors import InvalidInput

MOST_FILES = 10_000
"""A folder with more files is not read: hashing so many takes a second."""

Stamp = tuple[int, ...]
"""Numbers of a file that differ after the file is written."""
_OF_THE_SYSTEM = tuple(
    map(Path, ("/proc", "/sys", "/dev/fd", "/dev/stdin", "/dev/stdout", "/dev/stderr"))
)
"""Views of the system and of this process, nobody's files: they change from moment to moment."""


def file_digest(path: Path) -> str | None:
    """Hash of the content of a file, or of the files below a folder and their names; empty where
    there is neither, None of a folder with more than `MOST_FILES`.
    """
    # `os.path` takes every text for a path: a table of a recording may hold any.
    if not os.path.exists(path):
        return ""
    found = [path] if os.path.isfile(path) else [*islice(files_below(path), MOST_FILES + 1)]
    if len(found) > MOST_FILES:
        return None
    hashes = [
        f"{file.relative_to(path)} {content_digest(file)}"
        for file in sorted(found)
        if not is_compiled(file)
    ]
    return combined_digest(hashes) if hashes else ""


def data_digest(paths: Iterable[Path]) -> str:
    """Hash the content of several files and folders.

    Raises InvalidInput for a folder with more than `MOST_FILES` files.
    """
    digests = []
    for path in paths:
        digest = file_digest(path)
        if digest is None:
            raise InvalidInput(f"{path}: a folder may hold {MOST_FILES:,} files, or name the files")
        digests.append(digest)
    return combined_digest(digests)


def combined_digest(digests: Iterable[str]) -> str:
    """One hash of several, in their order."""
    return hashlib.sha256(" ".join(digests).encode()).hexdigest()[:16]


def content_digest(path: Path) -> str:
    """Hash of a file as it is now."""
    return _hashed(path, file_stamp(path))


def file_stamp(path: Path) -> Stamp:
    """Return the stamp of a file, without reading the file. Empty where there is no file."""
    try:
        stat = path.stat()
    except (OSError, ValueError):  # a table of a recording may name any text as a file
        return ()
    # A file that is written anew keeps neither of its times; the last one no program can set back.
    return stat.st_ino, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns


# As many as the sweeps of a large split. An entry takes some 300 bytes.
@lru_cache(maxsize=100_000)
def _hashed(path: Path, _stamp: Stamp) -> str:
    """Hash of a file that has not changed since it was last hashed."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:16]


def files_below(folder: Path, above: tuple[Path, ...] = ()) -> Iterator[Path]:
    """The regular files below a folder, in order of name, behind links too, but for links back to a
    folder above.
    """
    real = real_path(folder)
    if real in above or is_of_the_system(real):
        return
    try:
        inner = sorted(folder.iterdir())
    except OSError:
        return
    for path in inner:
        if os.path.isdir(path):
            yield from files_below(path, (*above, real))
        elif os.path.isfile(path) and not (path.is_symlink() and is_of_the_system(path)):
            yield path


def is_compiled(path: Path) -> bool:
    """Whether Python or Numba writes a file while code runs, so that no author did."""
    return path.suffix == ".pyc" or "__pycache__" in path.parts


def is_of_the_system(path: Path) -> bool:
    """Whether a path, or what it links to, is none of anybody's files but a view of the system."""
    return any(
        each.is_relative_to(place) for each in (path, real_path(path)) for place in _OF_THE_SYSTEM
    )


def real_path(path: Path) -> Path:
    """The path without links. A link that leads back to itself stays what it is: it has no content,
    and `Path.resolve` would raise.
    """
    return Path(os.path.realpath(path))
