"""Registries of things that a user names: built-in ones, and those of installed packages.

A package adds one through an entry point. Its name is what the user writes. Its object is a class
or another callable that makes the thing. If two entries have one name, the first on the path
counts, as for modules. A built-in name cannot be taken. A kind whose entries have longer names maps
them to what the user writes.

Anything else is named by its place, MODULE:OBJECT. The module is found as Python finds it, or in
the folder in which the program was started.
"""

import inspect
import os
import re
import sys
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from dataclasses import MISSING, dataclass, fields
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, Generic, TypeVar

from care_sim.base.errors import InvalidInput, error_line, unknown

SCENARIO_GROUP = "care_sim.scenarios"
"""Entry points of scenarios, called as the scenario is or by the id of its environment."""
_ID = re.compile(r"\w+-(\w+)-v\d+")


def is_environment_id(name: str) -> bool:
    """Whether a name has the form of an environment's id, `Mine-LeftBike-v0`."""
    return _ID.fullmatch(name) is not None


def scenario_of(name: str) -> str:
    """The scenario of an environment's id; any other name is the scenario's own."""
    told = _ID.fullmatch(name)
    return told[1].lower() if told else name


def refuse_link(package: str) -> None:
    """Raise ImportError for a package that is imported by its link: its registries would be others
    than those of `care_sim`.
    """
    if not package.startswith("care_sim."):
        raise ImportError(f"{package} is a link and no package: import care_sim.{package} instead")


Made = TypeVar("Made")
_PLACE = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*(\.[^\W\d]\w*)*")


@dataclass(frozen=True)
class Plugins(Generic[Made]):
    """All things of one `kind`, such as "detector". `built_in` holds makers by name, or entry
    points that name them. `group` holds the entries of installed packages. `faults` lists why a
    loaded object cannot make the kind; each fault ends a sentence that begins with the object's
    place. `called` maps an entry's name to what the user writes.
    """

    kind: str
    group: str
    built_in: Mapping[str, Callable[..., Made] | EntryPoint]
    faults: Callable[[Any], Iterable[str]]
    called: Callable[[str], str] = str

    def names(self) -> list[str]:
        """The built-in names in their order, then those of installed packages in alphabetical
        order.
        """
        return [*self.built_in, *sorted(set(self.entries()) - set(self.built_in))]

    def check(self, name: object) -> None:
        """Raise InvalidInput for an unknown name of this kind; a class is named with its place."""
        if inspect.isclass(name):
            place = f"{name.__module__}:{name.__qualname__}"
            asked = f"as {place!r}" if is_place(place) else "as MODULE:CLASS, from a module's top"
            raise InvalidInput(
                f"{self.kind} must be a name, got the class {name.__name__}: ask for it by its "
                f"place, {asked}"
            )
        # Installed packages are searched only for a name that is not built in.
        if not (isinstance(name, str) and (name in self.built_in or is_place(name))):
            names = self.names()
            if not (isinstance(name, str) and name in names):
                raise unknown(self.kind, name, names, self._in_a_file(name))

    def _in_a_file(self, name: object) -> str:
        """How to ask for what a file here holds, where a name is that of a file; else empty."""
        file, _, made = name.partition(":") if isinstance(name, str) else ("", "", "")
        stem = str(Path(file)).removesuffix(".py")
        place = f"{stem}:{made or stem.title().replace('_', '')}"
        if not (is_place(place) and Path(f"{stem}.py").is_file()):
            return ""
        return f"a {self.kind} in a file is MODULE:CLASS, as {place}"

    def maker(self, name: str) -> Callable[..., Made]:
        """Return what makes the thing.

        Raises InvalidInput with the reason for one that cannot be loaded, and for an unknown name.
        """
        if name in self.built_in:
            built_in = self.built_in[name]
            return self.load(built_in) if isinstance(built_in, EntryPoint) else built_in
        self.check(name)
        return self.load(self.entry(name))

    def entry(self, name: str) -> EntryPoint:
        """The entry of a name that is not built in, or one for a place."""
        return EntryPoint(name, name, self.group) if is_place(name) else self.entries()[name]

    def all_entries(self) -> list[EntryPoint]:
        """Every entry of installed packages in order of what it is called; of one name in order of
        the path.
        """
        return sorted(entry_points(group=self.group), key=lambda entry: self.called(entry.name))

    def entries(self) -> dict[str, EntryPoint]:
        """The entry that counts, by name."""
        # A dict keeps the last entry of a name; in reversed order that is the first on the path.
        return {self.called(entry.name): entry for entry in reversed(self.all_entries())}

    def hidden_entries(self) -> Iterator[tuple[EntryPoint, EntryPoint | None]]:
        """The entries that do not count, each with the one that does; None for a built-in thing."""
        counting: dict[str, EntryPoint] = {}
        for entry in self.all_entries():
            name = self.called(entry.name)
            first = counting.setdefault(name, entry)
            if name in self.built_in:
                yield entry, None
            elif first is not entry:
                yield entry, first

    def refusals(self) -> Iterator[tuple[EntryPoint, str]]:
        """The entries that do not count, each with the line that says so."""
        for entry, winner in self.hidden_entries():
            owner = f"that of {package_of(winner)}" if winner else "the built-in one"
            name = self.called(entry.name)
            line = f"{self.kind} {name} of {package_of(entry)} is refused: {owner} has its name"
            yield entry, line

    def load(self, entry: EntryPoint) -> Callable[..., Made]:
        """Load the object that an entry names. Raises InvalidInput with the reason, in one line,
        when it is of no use.
        """
        if is_place(entry.name):
            _look_here()
        try:
            made = entry.load()
        except KeyboardInterrupt:
            raise
        # Foreign code may raise anything; some leaves by `sys.exit`.
        except BaseException as error:
            raise InvalidInput(f"{error_line(error)}{_found_in(entry, error)}") from error
        # Report the first fault; the others may follow from it.
        for fault in self.faults(made):
            raise InvalidInput(f"{entry.value} {fault}")
        maker: Callable[..., Made] = made
        return maker


def class_faults(made: Any) -> Iterator[str]:
    """Why a class makes nothing: abstract methods."""
    if inspect.isabstract(made):
        yield f"is abstract: it lacks {', '.join(sorted(made.__abstractmethods__))}"


def dataclass_faults(made: Any, told: Container[str] = ()) -> Iterator[str]:
    """Return why a class cannot take its parameters. Only those in `told` may lack a default."""
    yield from class_faults(made)
    # Without the decorator the numbers are attributes of the class, and nobody can set them.
    if "__dataclass_fields__" not in vars(made) and inspect.get_annotations(made):
        yield "is no dataclass: @dataclass(frozen=True) stands above its class"
    for field in fields(made):
        if field.name not in told and field.default is MISSING:
            yield f"has no default for {field.name}"


def is_place(name: str) -> bool:
    """Whether a name is a place, MODULE:OBJECT."""
    # FILE.py:OBJECT would be a module `py` of a package, and is always meant otherwise.
    return _PLACE.fullmatch(name) is not None and ".py:" not in name


def _look_here() -> None:
    """Let modules be found in the current folder, after all other places: it hides none of them."""
    here = os.getcwd()
    if not {"", here} & {*sys.path}:
        sys.path.append(here)


def _found_in(entry: EntryPoint, error: BaseException) -> str:
    """Where a module is that lacks the name of an entry; empty for another error."""
    # Another file or folder of the same name may hide the module that is meant.
    module = sys.modules.get(entry.module)
    if module is None or not isinstance(error, AttributeError):
        return ""
    place = getattr(module, "__file__", None) or ", ".join(getattr(module, "__path__", ()))
    return f" (found in {place})" if place else ""


def package_of(entry: EntryPoint) -> str:
    """The distribution with its version, or the module of an entry that belongs to none."""
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.module
