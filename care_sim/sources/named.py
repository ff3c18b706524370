"""Sources by a text: generated streets, recordings in a folder, and those of other packages.

An entry of the group `care_sim.sources` names a class of `Recordings`, with the text NAME:FOLDER,
or of `Generated`, with the text NAME. Either can also be named by its place, MODULE:CLASS:FOLDER or
MODULE:CLASS.
"""

import inspect
from collections.abc import Iterator
from dataclasses import fields
from importlib.util import find_spec
from typing import Any

from care_sim.base.checks import check_known, option_text
from care_sim.base.errors import InvalidInput
from care_sim.base.plugins import is_place, package_of
from care_sim.core.sensor_setup import SensorSetup
from care_sim.sensors.setups import DEFAULT_SETUP
from care_sim.sources.installed import (
    RECORDING_KINDS,
    RECORDING_TEXTS,
    SOURCES,
    Installed,
    recordings,
)
from care_sim.sources.recordings import Recordings
from care_sim.sources.scenes import SPLITS, Recorded, Source, Streets


def source_of(text: str, **options: object) -> Source:
    """Return the source that a text names: `streets`, one of
    `care_sim.sources.installed.RECORDING_TEXTS`, or one of another package. `options` are those of
    its kind (`split`, and the fields of its class); None means not given.

    Raises InvalidInput for another text, a folder that is none, an option that the kind does not
    have, a source that cannot be loaded.
    """
    given = {name: value for name, value in options.items() if value is not None}
    if text == Streets.kind:
        return _streets(given)
    name = source_name(text)
    if name not in RECORDING_KINDS and not _is_foreign(name):
        raise _unknown(text)
    return replayed_source(text, **given)


def source_name(text: str) -> str:
    """The name or place of a source, without the folder behind it, whether there is one or not."""
    return _parted(text)[0]


def replayed_source(text: str, **options: object) -> Source:
    """Return a source that `CARE-Replay-v0` plays: all but `streets`, which have their own
    environment.
    """
    name, folder = _parted(text) if isinstance(text, str) else ("", "")
    if not _is_foreign(name):
        return Recorded(recordings(text, options))
    given = {name: value for name, value in options.items() if value is not None}
    try:
        return Installed(name, folder, tuple(given.items()))
    except InvalidInput as error:
        # A misspelt kind, `nuscene:FOLDER`, looks like a place.
        if is_place(name) and find_spec(name.partition(":")[0].partition(".")[0]) is None:
            raise _unknown(text) from error
        raise


def _streets(given: dict[str, object]) -> Streets:
    sensor = given.pop("sensor", DEFAULT_SETUP)
    split = str(given.pop("split", "evaluation"))
    if given:
        raise InvalidInput(f"{', '.join(given)} has no meaning for streets")
    check_known("split of the streets", split, SPLITS)
    return Streets(split, sensor=sensor if isinstance(sensor, SensorSetup) else str(sensor))


def _parted(text: str) -> tuple[str, str]:
    """The name or place of a source, and the folder behind it."""
    name, _, rest = text.partition(":")
    second, _, folder = rest.partition(":")
    place = f"{name}:{second}"
    if name not in SOURCES.names() and is_place(place):
        return place, folder
    return name, rest


def _is_foreign(name: str) -> bool:
    return name not in SOURCES.built_in and (is_place(name) or name in SOURCES.entries())


def _unknown(text: str) -> InvalidInput:
    known = [Streets.kind, *RECORDING_TEXTS, *SOURCES.names()[len(SOURCES.built_in) :]]
    known.append("MODULE:CLASS")
    return InvalidInput(
        f"unknown source {text!r:.200}; known: {', '.join(known)}; `care-sim list sources` tells "
        "what each is"
    )


def source_lines() -> Iterator[str]:
    """A line per source and one per option, an empty line between sources; at the end why entries
    of packages are refused.
    """
    for name in SOURCES.names():
        yield from _source_lines(name)
        yield ""
    yield from (reason for _, reason in SOURCES.refusals())


def _source_lines(name: str) -> list[str]:
    """Return a source's text and its parameters, or why it cannot be loaded."""
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
            # The folder follows the name.
            if field.name != "folder"
        ),
    ]
