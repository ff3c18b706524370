"""The files that the code of an installed policy or detector names, in a default, a constant or any
other text.

Not seen are names that code puts together while it plays, or reads from elsewhere.
"""

import os
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cache, partial
from importlib.metadata import EntryPoint
from inspect import signature
from os import PathLike
from pathlib import Path
from types import FunctionType, ModuleType, SimpleNamespace
from typing import NamedTuple

from care_sim.base.checks import LONGEST_PATH
from care_sim.base.digests import is_of_the_system, real_path
from care_sim.base.package_files import shipped_files, source_names

_WRAPPED = (staticmethod, classmethod, type(cache(lambda: None)))
_Modules = Mapping[str, Path]
"""The modules of a policy that are loaded, by name, and the folders that they are in."""


class _Held(NamedTuple):
    """A value that code holds, the folder of the module that holds it, and whether it is a
    `default` of some function.
    """

    value: object
    home: Path
    default: bool


class _Named(NamedTuple):
    """A text or path that code holds; the rest as in `_Held`."""

    name: str | PathLike[str]
    home: Path
    default: bool


def files_named_by(entry: EntryPoint) -> dict[str, Path]:
    """The files and folders that the defaults and constants in an entry point's code name; relative
    names from here and from their module. Nothing of code that cannot be loaded.

    A folder that holds the module, or the place where it is played, names no file in particular;
    nor does the relative default of a function other than the entry and `__init__`.
    """
    try:
        entry.load()
    except KeyboardInterrupt:
        raise
    except BaseException:
        return {}
    # A file counts wherever a name of it is found. A folder counts as all files below it, so only
    # one that is meant as such.
    here = Path.cwd()
    found = (
        path
        for name, home, default in _reached(sys.modules[entry.module], entry)
        for path in _places_of(name, (home,))
        if path.is_file()
        or not ((default and not os.path.isabs(_filled(name))) or _holds(path, home, here))
    )
    return {f"named {number}": path for number, path in enumerate(found)}


def files_named_in(files: Collection[Path]) -> dict[str, Path]:
    """The further files that texts in the code among these name, wherever they stand in it:
    relative names from here and from the code. A folder that a text happens to name is left out.
    """
    own = {real_path(file) for file in files}
    found = {
        f"{source.name} {text} {number}": path
        for source in files
        if source.suffix == ".py"
        for text in source_names(source).texts
        for number, path in enumerate(_places_of(text, (source.parent,)))
    }
    return {
        name: path for name, path in found.items() if path.is_file() and real_path(path) not in own
    }


def paths_in(value: object) -> Iterator[Path]:
    """What a value names of files and folders that are there, from here; of structures what they
    hold.
    """
    for name, _, _ in _names([_Held(value, Path(), False)], {}):
        yield from _places_of(name, ())


def _places_of(value: str | PathLike[str], folders: Iterable[Path]) -> Iterator[Path]:
    """The files and folders that a name means: as it stands, with its variables filled in, and from
    each of `folders`.
    """
    name = _filled(value)
    if 0 < len(name) <= LONGEST_PATH:
        for path in dict.fromkeys(
            [str(value), name, *(os.path.join(folder, name) for folder in folders)]
        ):
            if (os.path.isfile(path) or os.path.isdir(path)) and not is_of_the_system(Path(path)):
                yield Path(path)


def _filled(name: str | PathLike[str]) -> str:
    return os.path.expanduser(os.path.expandvars(str(name)))


def _holds(folder: Path, *places: Path) -> bool:
    real = real_path(folder)
    return any(place.is_relative_to(real) for place in places)


@cache
def _reached(module: ModuleType, entry: EntryPoint) -> tuple[_Named, ...]:
    """What the values of an entry point's code name, as it is when first looked at: it may load
    more while it plays.
    """
    own = _own_modules(entry)
    home = own.get(entry.module, Path())
    make = entry.load()
    try:
        given = [parameter.default for parameter in signature(make).parameters.values()]
    except (TypeError, ValueError):
        given = []
    return tuple(_names([_Held(value, home, False) for value in (given, make, module)], own))


def _own_modules(entry: EntryPoint) -> dict[str, Path]:
    """The loaded modules that came with an entry point or hold its module."""
    files = {os.path.realpath(file) for file in (shipped_files(entry) or {}).values()}
    loaded = {name: each for name, each in sys.modules.items() if isinstance(each, ModuleType)}
    places = {name: vars(each).get("__file__") or "" for name, each in loaded.items()}
    return {
        name: real_path(Path(file).parent)
        for name, file in places.items()
        if os.path.realpath(file) in files or entry.module.startswith(f"{name}.")
    }


def _names(values: list[_Held], own: _Modules) -> Iterator[_Named]:
    """The texts and paths that values hold; modules, classes and functions only where `own`.

    Depth first and in order: the hash that is made of what is found depends on its order.
    """
    waiting = values[::-1]
    seen = dict[int, object]()
    while waiting:
        value, home, default = waiting.pop()
        if isinstance(value, str | PathLike):
            yield _Named(value, home, default)
        elif id(value) not in seen:
            # Kept as well as known: the number of an object that is gone goes to another.
            seen[id(value)] = value
            module = _module_of(value)
            held = [*_held(value, module in own), *([sys.modules[module]] if module in own else [])]

            # Values below a function's defaults are defaults, unless it is a constructor; those of
            # a class or module are not.
            default = value.__name__ != "__init__" if isinstance(value, FunctionType) else default
            default = default and not isinstance(value, type | ModuleType)
            waiting += [_Held(each, own.get(module, home), default) for each in reversed(held)]


def _module_of(value: object) -> str:
    """The name of the module that a class, a function or the class of a value was written in."""
    if isinstance(value, ModuleType):
        return value.__name__
    return str((value if isinstance(value, type | FunctionType) else type(value)).__module__)


def _held(value: object, own: bool) -> Iterable[object]:
    """The values that one holds: of structures their items, of own code what decides what it does,
    of any other object nothing.
    """
    if isinstance(value, list | tuple):
        return value
    if isinstance(value, set | frozenset):
        return sorted(value, key=repr)
    if isinstance(value, dict):
        return [*value.keys(), *value.values()]
    if isinstance(value, partial):
        return [value.func, value.args, value.keywords]
    if isinstance(value, _WRAPPED):
        return [value.__wrapped__]
    if isinstance(value, FunctionType):
        return [value.__defaults__, value.__kwdefaults__, *vars(value).values()] if own else []
    return _attributes(value, own)


def _attributes(value: object, own: bool) -> list[object]:
    """The fields of a dataclass; the attributes too of what is `own`, and of a class its bases."""
    held = (
        [getattr(value, field.name, None) for field in fields(value)] if is_dataclass(value) else []
    )
    if own or isinstance(value, SimpleNamespace):
        items = [*getattr(value, "__dict__", {}).items()]
        held += [
            each
            for name, each in items
            if isinstance(each, FunctionType) or not name.startswith("__")
        ]
    return [*held, *value.__mro__[1:]] if isinstance(value, type) and own else held
