"""The files that decide what an installed policy or detector does, as far as distribution and code
name them.

Not seen are names that code puts together while it plays, or reads from elsewhere.
"""

import ast
import inspect
import os
import sys
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import fields, is_dataclass
from functools import cache
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from os import PathLike
from pathlib import Path
from types import ModuleType
from typing import Any

LONGEST_PATH = 4096
"""Characters of a path on Linux."""
MOST_NESTED = 8
"""Values within values that are looked through for names of files."""
_OF_INSTALLERS = (".dist-info", ".egg-info")
_SCRIPTS = (["bin"], ["Scripts"])
_OF_THE_SYSTEM = tuple(map(Path, ("/proc", "/sys", "/dev")))
"""What is no file of anybody, and another one at every look."""


def shipped_files(entry: EntryPoint) -> dict[str, Path] | None:
    """The files that came with an entry point, by name: of its package, or beside its module where
    no list of its distribution names it; and those of that list. None where the code has no files
    to read.
    """
    spec = find_spec(_top(entry))
    roots = (
        [Path(place) for place in spec.submodule_search_locations or [spec.origin or ""]]
        if spec
        else []
    )
    if not roots or not all(root.name and root.exists() for root in roots):
        return None
    files = _listed(entry)
    for root in roots:
        if root.is_dir():
            files |= {f"{root.name}/{file.relative_to(root)}": file for file in root.rglob("*")}
        elif root.name not in files:
            files |= {file.name: file for file in root.parent.iterdir()}
    return {name: file for name, file in files.items() if _counts(Path(name)) and file.is_file()}


def files_named_by(entry: EntryPoint) -> dict[str, Path]:
    """The files and folders that the defaults of an entry point's parameters, and the constants of
    its classes and modules, name; relative names from here and from its module. Nothing of code
    that cannot be loaded.

    A folder that holds the module, or the place where it is played, names no file in particular.
    """
    try:
        make = entry.load()
    except (Exception, SystemExit):
        return {}
    home = Path(getattr(sys.modules.get(entry.module), "__file__", None) or "").parent.resolve()
    found = ((name, path) for name, value in _values(entry, make) for path in paths_in(value, home))
    here = Path.cwd()
    return {
        f"{name} {number}": path
        for number, (name, path) in enumerate(found)
        if path.is_file() or not any(place.is_relative_to(path.resolve()) for place in (home, here))
    }


def files_named_in(files: Collection[Path]) -> dict[str, Path]:
    """The further files that texts in the code among these name, wherever they stand in it:
    relative names from here and from the code. A folder that a text happens to name is left out.
    """
    own = {file.resolve() for file in files}
    found = {
        f"{source.name} {text} {number}": path
        for source in files
        if source.suffix == ".py"
        for text in _file_names(source)
        for number, path in enumerate(paths_in(text, source.parent))
    }
    return {
        name: path for name, path in found.items() if path.is_file() and path.resolve() not in own
    }


def paths_in(value: object, *places: Path, depth: int = MOST_NESTED) -> Iterator[Path]:
    """What a value names of files and folders that are there, from here or from further places; of
    structures what they hold.
    """
    if isinstance(value, str | PathLike):
        yield from _named_by(value, places)
    elif depth:
        for each in _held(value):
            yield from paths_in(each, *places, depth=depth - 1)


def _held(value: object) -> Iterable[object]:
    if isinstance(value, list | tuple):
        return value
    if isinstance(value, set | frozenset):
        return sorted(value, key=repr)
    if isinstance(value, dict):
        return [*value.keys(), *value.values()]
    if is_dataclass(value) and not isinstance(value, type):
        return [getattr(value, field.name, None) for field in fields(value)]
    return ()


def _named_by(value: "str | PathLike[str]", places: Iterable[Path]) -> Iterator[Path]:
    name = os.path.expanduser(os.path.expandvars(str(value)))
    if 0 < len(name) <= LONGEST_PATH:
        for path in dict.fromkeys([Path(value), Path(name), *(place / name for place in places)]):
            if _exists(path) and not any(path.is_relative_to(place) for place in _OF_THE_SYSTEM):
                yield path


@cache
def _file_names(source: Path) -> tuple[str, ...]:
    """The texts in a file of code that look like a file's name, once a process, which has it
    loaded.
    """
    try:
        tree = ast.parse(source.read_bytes())
    except (OSError, ValueError, SyntaxError, RecursionError):
        return ()
    texts = {
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }
    return tuple(sorted(text for text in texts if text.isprintable() and Path(text).suffix))


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
    """Whether a file is the author's own: no installer's note or script, not what Python and Numba
    keep beside code.
    """
    inner = [part for part in name.parts if part != ".."]
    return not (
        "__pycache__" in inner
        or (name.parts[0] == ".." and inner[:1] in _SCRIPTS)
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
    own = [
        sys.modules[name]
        for name in sorted(sys.modules)
        if name == top or name.startswith(f"{top}.")
    ]
    classes = [
        each for each in getattr(make, "__mro__", ()) if each.__module__.partition(".")[0] == top
    ]
    for holder in (*own, *classes):
        yield from _constants(holder)


def _constants(holder: ModuleType | type) -> Iterator[tuple[str, object]]:
    return ((name, value) for name, value in [*vars(holder).items()] if not name.startswith("__"))
