"""The texts and paths that the values of code hold."""

import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cache, partial
from os import PathLike
from pathlib import Path
from types import FunctionType, ModuleType, SimpleNamespace

Name = str | PathLike[str]
Held = tuple[object, Path, bool]
"""A value, the folder of the module that holds it, and whether it is a default of some function."""
Own = Mapping[str, Path]
"""The modules of a policy that are loaded, by name, and the folders that they are in."""

_WRAPPED = (staticmethod, classmethod, type(cache(lambda: None)))


def names(values: list[Held], own: Own) -> Iterator[tuple[Name, Path, bool]]:
    """The texts and paths that values hold; modules, classes and functions only where `own`."""
    waiting, seen = values[::-1], dict[int, object]()
    while waiting:
        value, home, loose = waiting.pop()
        if isinstance(value, str | PathLike):
            yield value, home, loose
        elif id(value) not in seen:
            seen[id(value)] = value
            module = _module_of(value)
            held = [*_held(value, module in own), *([sys.modules[module]] if module in own else [])]
            loose = value.__name__ != "__init__" if isinstance(value, FunctionType) else loose
            loose = loose and not isinstance(value, type | ModuleType)
            waiting += [(each, own.get(module, home), loose) for each in reversed(held)]


def _module_of(value: object) -> str:
    """The name of the module that a class, a function or the class of a value was written in."""
    if isinstance(value, ModuleType):
        return value.__name__
    return str((value if isinstance(value, type | FunctionType) else type(value)).__module__)


def _held(value: object, own: bool) -> Iterable[object]:
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
