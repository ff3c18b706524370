"""Hashes of files and folders, of what an entry point names, and of what happened."""

import hashlib
import math
import os
import sys
from collections.abc import Iterable, Iterator
from functools import lru_cache
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from care_sim.base.checks import LONGEST_PATH
from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput

MOST_FILES = 10_000
"""A folder with more files is not read: hashing so many takes a second."""
CODE = (".py", ".so", ".pyd")
"""Endings of files that a process loads once."""
_VIEWS = ("/proc/", "/sys/", "/dev/fd/", "/dev/std")
"""Paths of the system's views, which are not files and change all the time."""
Stamp = tuple[int, ...]
"""Numbers of a file that differ after the file is written."""

STEP = 1e-4
"""Rounding step of measured numbers: metres, radians, metres per second. With other features of the
processor, poses of a whole episode move by less than 1e-13. The float32 ranges of an observation
move by their last bit, 4e-6. Outcomes depend on centimetres: sizes, margins, the spacing of rays.
"""
SHIFT = (5**0.5 - 1) / 2
"""Offset of the borders between steps from round numbers, in steps. Scenes are made of round
numbers (0, 0.05, 1.5, a half of anything). A number on a border would be rounded by its last bit.
"""
_LARGEST = 2.0**61
_INFINITE = 2**62
_NONE = 2**62 + 1


def file_digest(path: Path) -> str | None:
    """Hash a file's content, or the names and contents of the files below a folder. Returns an
    empty text if neither exists, None for a folder with more than `MOST_FILES`.
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
        if not _is_compiled(file)
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
    """Combine several hashes, in their order, into one."""
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


def files_below(folder: Path) -> Iterator[Path]:
    """The regular files below a folder, in order of name within each folder, behind links too."""
    seen = set()
    for place, folders, names in os.walk(folder, followlinks=True):
        # A link may lead back to a folder above, or into the system's views of itself.
        real = os.path.realpath(place)
        if real in seen or f"{real}/".startswith(_VIEWS):
            folders.clear()
            continue
        seen.add(real)
        folders.sort()
        paths = (os.path.join(place, name) for name in sorted(names))
        yield from map(Path, filter(os.path.isfile, paths))


def _is_compiled(path: Path) -> bool:
    """Whether Python or Numba writes a file while code runs, so that no author did."""
    return path.suffix == ".pyc" or "__pycache__" in path.parts


def paths_in(value: object) -> Iterator[Path]:
    """Return the files and folders that a parameter, or a list's items, names."""
    if isinstance(value, list | tuple):
        for item in value:
            yield from paths_in(item)
    elif isinstance(value, str | os.PathLike):
        name = os.path.expanduser(os.path.expandvars(str(value)))
        there = 0 < len(name) <= LONGEST_PATH and (os.path.isfile(name) or os.path.isdir(name))
        if there and not any(f"{at}/".startswith(_VIEWS) for at in (name, os.path.realpath(name))):
            yield Path(name)


def entry_files(entry: EntryPoint) -> dict[str, Path] | None:
    """Return, by name, the files that decide what an installed policy, detector, scenario or source
    does.

    For a package: all files in its folder. For a single module: its file, and code beside it unless
    it was installed. For both: the files in `files`. Returns None where the code is in no file, or
    in too many.

    Raises InvalidInput for `files` that are no names, or that are missing.
    """
    try:
        spec = find_spec(entry.module.partition(".")[0])
    except (ImportError, ValueError):
        return None
    # A namespace package has several places, a module one. In a zip archive none of them is a file.
    places = (spec.submodule_search_locations or [spec.origin or ""]) if spec else []
    if not all(place and os.path.exists(place) for place in places):
        return None
    files = {
        f"{root.name}/{file.relative_to(root if root.is_dir() else root.parent)}": file
        for root in map(Path, places)
        for file in islice(_code_of(root), MOST_FILES + 1)
    }
    if not 0 < len(files) <= MOST_FILES:
        return None
    return files | {f"declared {number}": path for number, path in enumerate(declared_files(entry))}


def _code_of(root: Path) -> Iterator[Path]:
    """The files of a package's folder, or of a module's file."""
    if root.is_dir():
        yield from (file for file in files_below(root) if not _is_compiled(file))
    elif not {"site-packages", "dist-packages"}.isdisjoint(root.parts):
        yield root
    elif root.is_file():
        beside = sorted(root.parent.iterdir())
        yield from (file for file in beside if file.suffix in CODE and file.is_file())


def declared_files(entry: EntryPoint) -> list[Path]:
    """The files that an entry declares; relative names count from its module. Nothing of code that
    cannot be loaded.
    """
    try:
        declared = getattr(entry.load(), "files", ())
    except KeyboardInterrupt:
        raise
    except BaseException:
        return []
    # A source has a method of this name, which says what a scene is read from.
    if callable(declared):
        return []
    if not (
        isinstance(declared, tuple | list)
        and all(isinstance(name, str | os.PathLike) for name in declared)
    ):
        raise InvalidInput(f"{entry.value}: files must be a tuple of names, got {declared!r}")
    home = Path(sys.modules[entry.module].__file__ or "").parent
    paths = [home / Path(name).expanduser() for name in declared]
    for path in paths:
        if not path.exists():
            raise InvalidInput(f"{entry.value}: files names {path}, which does not exist")
    return paths


Content = str | ArrayLike


def portable_bytes(*parts: Content | tuple[Content, ...]) -> bytes:
    """The bytes of texts, arrays and numbers, and of tuples of them, with their shapes, which are
    equal wherever the same happened.

    Processors, mathematical libraries and their versions differ in the last bits of sine,
    arctangent or a matrix product. So whole numbers and flags are taken exactly, the others to
    `STEP`; -0.0 is 0, float32 and float64 are one, infinities and NaN are numbers of their own.
    """
    return b"".join(map(_bytes_of, parts))


def _bytes_of(part: object) -> bytes:
    # Each part begins with its kind and size, so that no two different sequences of parts are the
    # same bytes: ("ab", "c") is not ("a", "bc").
    if isinstance(part, str):
        text = part.encode(errors="surrogatepass")
        return b"text %d " % len(text) + text
    if isinstance(part, tuple):
        return b"tuple %d " % len(part) + portable_bytes(*part)
    numbers = np.asarray(part)
    whole = numbers if numbers.dtype.kind in "biu" else _rounded(numbers)
    return b"array %r " % (numbers.shape,) + np.ascontiguousarray(whole, "<i8").tobytes()


def _rounded(numbers: NDArray[np.floating]) -> NDArray[np.int64]:
    """The step that each number lies in."""
    # Compiled for the two kinds of floats that arrays come in; any other is taken as the wider one.
    table: NDArray[np.floating] = np.ascontiguousarray(
        numbers, np.float32 if numbers.dtype == np.float32 else np.float64
    )
    return np.asarray(_steps(table.reshape(-1)).reshape(numbers.shape))


@compiled()
def _steps(numbers: NDArray[np.floating]) -> NDArray[np.int64]:
    """(n,) the steps of numbers (n,)."""
    steps = np.empty(len(numbers), np.int64)
    for n in range(len(numbers)):
        number = np.float64(numbers[n])
        # Floor, not round: a border lies SHIFT beside each multiple of the step. Held in bounds,
        # so that every step is a 64-bit integer, and those beyond are left for infinity and NaN.
        if math.isfinite(number):
            step = math.floor(min(max(number / STEP + SHIFT, -_LARGEST), _LARGEST))
        elif math.isnan(number):
            step = _NONE
        else:
            step = _INFINITE if number > 0 else -_INFINITE
        steps[n] = step
    return steps
