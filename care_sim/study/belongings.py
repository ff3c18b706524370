"""The files that decide what an installed policy or detector does, as far as distribution and code name them."""

import inspect
import sys
from collections.abc import Callable, Iterable, Iterator
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from os import PathLike
from pathlib import Path
from types import ModuleType
from typing import Any

LONGEST_PATH = 4096
"""Characters of a path on Linux."""
_OF_INSTALLERS = (".dist-info", ".egg-info")


def shipped(entry: EntryPoint) -> dict[str, Path] | None:
    """The files that came with an entry point, by name: of its package, or beside its module where no list of its
    distribution names it; and those of that list. None where the code has no files to read.
    """
    spec = find_spec(_top(entry))
    roots = [Path(place) for place in spec.submodule_search_locations or [spec.origin or ""]] if spec else []
    if not roots or not all(root.name and root.exists() for root in roots):
        return None
    files = _listed(entry)
    for root in roots:
        if root.is_dir():
            files |= {f"{root.name}/{file.relative_to(root)}": file for file in root.rglob("*")}
        elif root.name not in files:
            files |= {file.name: file for file in root.parent.iterdir()}
    return {name: file for name, file in files.items() if _counts(Path(name)) and file.is_file()}


def named(entry: EntryPoint) -> dict[str, Path]:
    """The files and folders that the defaults of an entry point's parameters, and the constants of its classes and
    modules, name; relative names from here and from its module. Nothing of code that cannot be loaded.

    A folder that holds the module, or the place where it is played, names no file in particular.
    """
    try:
        make = entry.load()
    except (Exception, SystemExit):
        return {}
    home = Path(getattr(sys.modules.get(entry.module), "__file__", None) or "").parent.resolve()
    found = ((name, path) for name, value in _values(entry, make) for path in paths(value, home))
    here = Path.cwd()
    return {
        f"{name} {number}": path
        for number, (name, path) in enumerate(found)
        if path.is_file() or not any(place.is_relative_to(path.resolve()) for place in (home, here))
    }


def paths(value: object, *places: Path) -> Iterator[Path]:
    """What a value names of files and folders that are there, from here or from further places."""
    if isinstance(value, list | tuple):
        for each in value:
            yield from paths(each, *places)
    elif isinstance(value, str | PathLike) and 0 < len(str(value)) <= LONGEST_PATH:
        for path in dict.fromkeys([Path(value), *(place / value for place in places)]):
            if _exists(path):
                yield path


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except OSError:  # a name that no file can have
        return False


def _top(entry: EntryPoint) -> str:
    return entry.module.partition(".")[0]


def _listed(entry: EntryPoint) -> dict[str, Path]:
    files = (entry.dist.files if entry.dist else None) or []
    return {str(file): Path(str(file.locate())) for file in files}


def _counts(name: Path) -> bool:
    """Whether a file is the author's own: not an installer's note, not what Python and Numba keep beside code."""
    return not (
        name.parts[0] in ("..", "__pycache__")
        or "__pycache__" in name.parts
        or name.parts[0].endswith(_OF_INSTALLERS)
        or name.suffix in (".pyc", ".pth")
        or name.name.startswith("__editable__")
    )


def _values(entry: EntryPoint, make: Callable[..., Any]) -> Iterable[tuple[str, object]]:
    """Defaults and constants, with their names."""
    try:
        parameters = [*inspect.signature(make).parameters.values()]
    except (TypeError, ValueError):
        parameters = []
    yield from ((parameter.name, parameter.default) for parameter in parameters)
    top = _top(entry)
    own = [sys.modules[name] for name in sorted(sys.modules) if name == top or name.startswith(f"{top}.")]
    classes = [each for each in getattr(make, "__mro__", ()) if each.__module__.partition(".")[0] == top]
    for holder in (*own, *classes):
        yield from _constants(holder)


def _constants(holder: ModuleType | type) -> Iterator[tuple[str, object]]:
    return ((name, value) for name, value in [*vars(holder).items()] if not name.startswith("__"))
