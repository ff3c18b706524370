"""The sources of scenes as people read them: name, what it is, options."""

import inspect
from collections.abc import Iterator
from dataclasses import fields
from typing import Any

from care_sim.base.checks import option_text
from care_sim.base.errors import InvalidInput
from care_sim.base.plugins import package_of
from care_sim.sources.installed import SOURCES
from care_sim.sources.recordings import Recordings


def source_lines() -> Iterator[str]:
    """A line per source and one per option, an empty line between sources; at the end why entries
    of packages are refused.
    """
    for name in SOURCES.names():
        yield from _source_lines(name)
        yield ""
    yield from (reason for _, reason in SOURCES.refusals())


def _source_lines(name: str) -> list[str]:
    """A source as it is asked for and its parameters, or why it cannot be loaded."""
    package = "" if name in SOURCES.built_in else f" [{package_of(SOURCES.entry(name))}]"
    try:
        source: Any = SOURCES.maker(name)
    except InvalidInput as error:
        return [f"{name:17} (broken) {error}{package}"]
    has_folder = issubclass(source, Recordings) and not source.shipped
    asked = f"{name}:FOLDER" if has_folder else name
    about, _, _ = (inspect.getdoc(source) or "").partition("\n\n")
    return [
        f"{asked:17} {' '.join(about.split())}{package}",
        *(
            f"    {field.name}={option_text(field.default)}"
            for field in fields(source)
            # The folder is told behind the name.
            if field.name != "folder"
        ),
    ]
