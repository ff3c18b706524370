"""The files that an installed policy or detector came with: every regular file of its distribution,
and of the code of its project.

What else it reads is told by `care_sim.base.named_files`.
"""

import ast
import json
from collections.abc import Collection, Iterable
from functools import cache
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlsplit
from urllib.request import url2pathname

from care_sim.base.digests import files_below, real_path

_OF_INSTALLERS = (".dist-info", ".egg-info")
_SCRIPTS = (["bin"], ["Scripts"])
_SITES = {"site-packages", "dist-packages"}
_THIS = __name__.partition(".")[0]


class SourceNames(NamedTuple):
    """What a file of code names: `texts` of one line, and the top `modules` that it imports."""

    texts: tuple[str, ...] = ()
    modules: frozenset[str] = frozenset()


def shipped_files(entry: EntryPoint) -> dict[str, Path] | None:
    """The files that came with an entry point, by name: those that its distribution lists; of its
    package, or beside its module where no list names it; and of the code of the same project that
    it imports, where that is installed for editing. None where the code has no files to read.
    """
    files = _listed(entry)
    project = _project(entry)
    first = entry.module.partition(".")[0]

    # A worklist of packages and modules: code of the project may import more of the project, which
    # is then looked into as well, each once.
    # This package has a hash of its own, which stands beside that of every other code: a module in
    # the root of its clone has it in its project, and is no part of it.
    known = [first, _THIS]
    waiting = [first]
    while waiting:
        top = waiting.pop(0)
        roots = _roots(top)
        if top == first and not roots:
            return None
        for root in roots:
            # A module that is asked for by its place lies among files of any kind, which may change
            # while it plays: its results, or the log that the shell writes.
            beside = entry.dist is not None and top == first and root.name not in files
            new = _files_at(root, beside)
            files |= new
            if project:
                further = _further_tops(new.values(), project, known)
                known += further
                waiting += further

    site = Path(str(entry.dist.locate_file(""))) if entry.dist else None
    return {
        name: file
        for name, file in files.items()
        if _counts(Path(name), file, site) and file.is_file()
    }


@cache
def source_names(source: Path) -> SourceNames:
    """What a file of code names; read once per process, which has it loaded."""
    try:
        nodes = [*ast.walk(ast.parse(source.read_bytes()))]
    except (OSError, ValueError, SyntaxError, RecursionError):
        return SourceNames()
    # Documentation is text as well; what names no file does no harm.
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
    return SourceNames(
        tuple(sorted(filter(str.isprintable, texts))),
        frozenset(name.partition(".")[0] for name in imported),
    )


def _files_at(root: Path, beside: bool) -> dict[str, Path]:
    """The files of a package's folder, or the file of a module, by name; all that lie beside that
    one where nobody lists it.
    """
    if root.is_dir():
        return {f"{root.name}/{file.relative_to(root)}": file for file in files_below(root)}
    return {file.name: file for file in (root.parent.iterdir() if beside else [root])}


def _further_tops(files: Iterable[Path], project: Path, tops: Collection[str]) -> list[str]:
    """The packages and modules of the project that files of code import, in order of name, beyond
    the known `tops`.
    """
    imported = sorted(
        set().union(*(source_names(file).modules for file in files if file.suffix == ".py"))
    )
    return [name for name in imported if name not in tops and _is_of(project, _roots(name))]


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


def _project(entry: EntryPoint) -> Path | None:
    """The folder that a distribution is installed from for editing (PEP 610); of a module that
    belongs to none, its own folder.
    """
    if entry.dist is None:
        places = _roots(entry.module.partition(".")[0])
        return real_path(places[0].parent) if places else None
    try:
        told = json.loads(entry.dist.read_text("direct_url.json") or "")
        return (
            real_path(Path(url2pathname(urlsplit(told["url"]).path)))
            if told["dir_info"]["editable"]
            else None
        )
    except (ValueError, KeyError, TypeError):
        return None


def _is_of(project: Path, roots: Collection[Path]) -> bool:
    """Whether code lies in a project, and not in an environment within it."""
    real = [real_path(root) for root in roots]
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
