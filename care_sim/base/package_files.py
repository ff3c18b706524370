"""The files that decide what an installed policy or detector does: every regular file of its
distribution, and every one that a default, constant or text of its code names.

Not seen are names that code puts together while it plays, or reads from elsewhere.
"""

import ast
import json
import os
import sys
from collections.abc import Collection, Iterable, Iterator
from functools import cache
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from inspect import signature
from pathlib import Path
from types import ModuleType
from urllib.parse import urlsplit
from urllib.request import url2pathname

from care_sim.base.checks import LONGEST_PATH
from care_sim.base.code_texts import Name, names

_OF_INSTALLERS = (".dist-info", ".egg-info")
_SCRIPTS = (["bin"], ["Scripts"])
_SITES = {"site-packages", "dist-packages"}
_OF_THE_SYSTEM = tuple(
    map(Path, ("/proc", "/sys", "/dev/fd", "/dev/stdin", "/dev/stdout", "/dev/stderr"))
)
"""No files of anybody: they change from one moment to the next."""


def shipped_files(entry: EntryPoint) -> dict[str, Path] | None:
    """The files that came with an entry point, by name: those that its distribution lists; of its
    package, or beside its module where no list names it; and of the code of the same project that
    it imports, where that is installed for editing. None where the code has no files to read.
    """
    files, project, first = _listed(entry), _project(entry), entry.module.partition(".")[0]
    tops = [first]
    for top in tops:
        roots = _roots(top)
        if top == first and not roots:
            return None
        for root in roots:
            if root.is_dir():
                new = {f"{root.name}/{file.relative_to(root)}": file for file in files_below(root)}
            else:
                beside = (
                    root.parent.iterdir() if top == first and root.name not in files else [root]
                )
                new = {file.name: file for file in beside}
            files |= new
            if project:
                imported = sorted(
                    set().union(*(_read(file)[1] for file in new.values() if file.suffix == ".py"))
                )
                tops += [
                    name for name in imported if name not in tops and _is_of(project, _roots(name))
                ]
    site = Path(str(entry.dist.locate_file(""))) if entry.dist else None
    return {
        name: file
        for name, file in files.items()
        if _counts(Path(name), file, site) and file.is_file()
    }


def files_below(folder: Path, above: tuple[Path, ...] = ()) -> Iterator[Path]:
    """The regular files below a folder, in order of name, behind links too, but for links back to a
    folder above.
    """
    real = _real(folder)
    if real in above or _is_of_the_system(real):
        return
    try:
        inner = sorted(folder.iterdir())
    except OSError:
        return
    for path in inner:
        if os.path.isdir(path):
            yield from files_below(path, (*above, real))
        elif os.path.isfile(path) and not (path.is_symlink() and _is_of_the_system(path)):
            yield path


def files_named_by(entry: EntryPoint) -> dict[str, Path]:
    """The files and folders that the defaults and constants in an entry point's code name; relative
    names from here and from their module. Nothing of code that cannot be loaded.

    A folder that holds the module, or the place where it is played, names no file in particular;
    nor does the relative default of a function other than the entry and `__init__`.
    """
    try:
        entry.load()
    except (Exception, SystemExit):
        return {}
    here = Path.cwd()
    found = (
        path
        for name, home, loose in _reached(sys.modules[entry.module], entry)
        for path in _named_by(name, (home,))
        if path.is_file()
        or not ((loose and not os.path.isabs(_filled(name))) or _holds(path, home, here))
    )
    return {f"named {number}": path for number, path in enumerate(found)}


def files_named_in(files: Collection[Path]) -> dict[str, Path]:
    """The further files that texts in the code among these name, wherever they stand in it:
    relative names from here and from the code. A folder that a text happens to name is left out.
    """
    own = {_real(file) for file in files}
    found = {
        f"{source.name} {text} {number}": path
        for source in files
        if source.suffix == ".py"
        for text in _read(source)[0]
        for number, path in enumerate(_named_by(text, (source.parent,)))
    }
    return {name: path for name, path in found.items() if path.is_file() and _real(path) not in own}


def paths_in(value: object) -> Iterator[Path]:
    """What a value names of files and folders that are there, from here; of structures what they
    hold.
    """
    for name, _, _ in names([(value, Path(), False)], {}):
        yield from _named_by(name, ())


def _named_by(value: Name, places: Iterable[Path]) -> Iterator[Path]:
    name = _filled(value)
    if 0 < len(name) <= LONGEST_PATH:
        for path in dict.fromkeys(
            [str(value), name, *(os.path.join(place, name) for place in places)]
        ):
            if (os.path.isfile(path) or os.path.isdir(path)) and not _is_of_the_system(Path(path)):
                yield Path(path)


def _filled(name: Name) -> str:
    return os.path.expanduser(os.path.expandvars(str(name)))


@cache
def _read(source: Path) -> tuple[tuple[str, ...], frozenset[str]]:
    """The texts of one line in a file of code, and the modules that it imports; once a process,
    which has it loaded.
    """
    try:
        nodes = [*ast.walk(ast.parse(source.read_bytes()))]
    except (OSError, ValueError, SyntaxError, RecursionError):
        return (), frozenset()
    texts = {
        node.value
        for node in nodes
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }
    imported = [
        alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names
    ]
    imported += [
        node.module
        for node in nodes
        if isinstance(node, ast.ImportFrom) and node.module and not node.level
    ]
    return tuple(sorted(filter(str.isprintable, texts))), frozenset(
        name.partition(".")[0] for name in imported
    )


@cache
def _reached(module: ModuleType, entry: EntryPoint) -> tuple[tuple[Name, Path, bool], ...]:
    """What the values of an entry point's code name, as it is when first looked at: it may load
    more while it plays.
    """
    files = {os.path.realpath(file) for file in (shipped_files(entry) or {}).values()}
    loaded = {name: each for name, each in sys.modules.items() if isinstance(each, ModuleType)}
    places = {name: vars(each).get("__file__") or "" for name, each in loaded.items()}
    own = {
        name: _real(Path(file).parent)
        for name, file in places.items()
        if os.path.realpath(file) in files or entry.module.startswith(f"{name}.")
    }
    home, make = own.get(entry.module, Path()), entry.load()
    try:
        given = [parameter.default for parameter in signature(make).parameters.values()]
    except (TypeError, ValueError):
        given = []
    return tuple(names([(value, home, False) for value in (given, make, module)], own))


def _holds(folder: Path, *places: Path) -> bool:
    real = _real(folder)
    return any(place.is_relative_to(real) for place in places)


def _is_of_the_system(path: Path) -> bool:
    return any(
        each.is_relative_to(place) for each in (path, _real(path)) for place in _OF_THE_SYSTEM
    )


def _real(path: Path) -> Path:
    """The path without links. A link that leads back to itself stays what it is: it has no content,
    and `Path.resolve` would raise.
    """
    return Path(os.path.realpath(path))


def _roots(top: str) -> list[Path]:
    """Where a package or module lies; nowhere, if any of it is in no file."""
    try:
        spec = find_spec(top)
    except (ImportError, ValueError):
        return []
    places = (spec.submodule_search_locations or [spec.origin or ""]) if spec else []
    roots = [Path(place) for place in places]
    return roots if all(root.name and root.exists() for root in roots) else []


def _project(entry: EntryPoint) -> Path | None:
    """The folder that a distribution is installed from for editing (PEP 610)."""
    try:
        told = json.loads((entry.dist and entry.dist.read_text("direct_url.json")) or "")
        return (
            _real(Path(url2pathname(urlsplit(told["url"]).path)))
            if told["dir_info"]["editable"]
            else None
        )
    except (ValueError, KeyError, TypeError):
        return None


def _is_of(project: Path, roots: Collection[Path]) -> bool:
    """Whether code lies in a project, and not in an environment within it."""
    real = [_real(root) for root in roots]
    return bool(real) and all(
        root.is_relative_to(project) and _SITES.isdisjoint(root.parts) for root in real
    )


def _listed(entry: EntryPoint) -> dict[str, Path]:
    files = (entry.dist.files if entry.dist else None) or []
    return {str(file): Path(str(file.locate())) for file in files}


def _counts(name: Path, file: Path, site: Path | None) -> bool:
    """Whether a file is the author's own: no installer's note, script or path file, not what Python
    and Numba keep.
    """
    inner = [part for part in name.parts if part != ".."]
    return not (
        "__pycache__" in inner
        or (name.parts[0] == ".." and inner[:1] in _SCRIPTS)
        or name.parts[0].endswith(_OF_INSTALLERS)
        or name.suffix == ".pyc"
        or (file.parent == site and (name.suffix == ".pth" or name.name.startswith("__editable__")))
    )
