"""The files that decide what an installed policy, detector, scenario or source does."""

import os
import sys
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from itertools import islice
from pathlib import Path

from care_sim.base.checks import LONGEST_PATH
from care_sim.base.digests import MOST_FILES, files_below, is_compiled, is_of_the_system
from care_sim.base.errors import InvalidInput

_SITES = {"site-packages", "dist-packages"}
CODE = (".py", ".so", ".pyd")
"""Endings of files that a process loads once."""


def entry_files(entry: EntryPoint) -> dict[str, Path] | None:
    """The files by name. A package: all files in its folder. A single module: its file, and code
    beside it unless it was installed. Both: the files in `files`. None where its code is in no
    file, or in too many.

    Raises InvalidInput for `files` that are no names, or that are missing.
    """
    roots = _roots(entry.module.partition(".")[0])
    files = {
        f"{root.name}/{file.relative_to(root if root.is_dir() else root.parent)}": file
        for root in roots
        for file in islice(_of_root(root), MOST_FILES + 1)
    }
    if not 0 < len(files) <= MOST_FILES:
        return None
    return files | {f"declared {number}": path for number, path in enumerate(_declared(entry))}


def paths_in(value: object) -> Iterator[Path]:
    """The files and folders that a parameter names, from here; of a list those of its items."""
    if isinstance(value, list | tuple):
        for item in value:
            yield from paths_in(item)
    elif isinstance(value, str | os.PathLike):
        name = os.path.expanduser(os.path.expandvars(str(value)))
        there = 0 < len(name) <= LONGEST_PATH and (os.path.isfile(name) or os.path.isdir(name))
        if there and not is_of_the_system(Path(name)):
            yield Path(name)


def _roots(top: str) -> list[Path]:
    """Where a package or module lies; nowhere, if any of it is in no file."""
    try:
        spec = find_spec(top)
    except (ImportError, ValueError):
        return []
    # A namespace package has several places, a module one. In a zip archive none of them is a file.
    places = (spec.submodule_search_locations or [spec.origin or ""]) if spec else []
    roots = [Path(place) for place in places]
    return roots if all(root.name and root.exists() for root in roots) else []


def _of_root(root: Path) -> Iterator[Path]:
    if root.is_dir():
        yield from (file for file in files_below(root) if not is_compiled(file))
    elif _SITES.isdisjoint(root.parts):
        yield from (
            file for file in sorted(root.parent.iterdir()) if file.suffix in CODE and file.is_file()
        )
    else:
        yield root


def _declared(entry: EntryPoint) -> list[Path]:
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
