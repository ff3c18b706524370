"""Sweeps per keyframe that a detector gets by default: its own number."""

from dataclasses import fields, replace
from typing import Any

from care_sim.perception.detectors import sweeps_wanted
from care_sim.sources.film_checks import report_once
from care_sim.sources.installed import SOURCES, Installed
from care_sim.sources.scenes import Recorded, Source

_OPTION = "sweeps"
"""The option of sources that serve the sweeps between keyframes."""


def source_for(source: Source, detector: str, parameters: Any, sweeps: int | None = None) -> Source:
    """Return the source with the number of sweeps per keyframe of a detector with `parameters`. A
    number of `sweeps` from the user leaves the source as it is. Prints a line if the source has no
    sweeps between its keyframes.

    Raises as `care_sim.perception.detectors.make_detector` does.
    """
    wanted = 1 if sweeps else sweeps_wanted(detector, dict(parameters))
    if wanted == 1:
        return source
    fed = with_sweeps(source, wanted)
    if fed is not None and _has_more(fed, source):
        return fed
    report_once(
        f"{source.kind} holds no sweeps between its keyframes: detector {detector} gets 1 per "
        f"keyframe, and wants {wanted}"
    )
    return source


def with_sweeps(source: Source, sweeps: int) -> Source | None:
    """Return the source with so many sweeps per keyframe, None for a kind without the option."""
    if isinstance(source, Recorded) and _has_option(type(source.recordings)):
        fed: dict[str, Any] = {_OPTION: sweeps}
        return Recorded(replace(source.recordings, **fed))
    if isinstance(source, Installed) and _has_option(SOURCES.maker(source.name)):
        others = tuple(pair for pair in source.options if pair[0] != _OPTION)
        return replace(source, options=(*others, (_OPTION, sweeps)))
    return None


def _has_option(kind: Any) -> bool:
    return any(field.name == _OPTION for field in fields(kind))


def _has_more(fed: Source, source: Source) -> bool:
    """Whether a film of `fed` would read a file that is there, and that one of `source` would not
    read.
    """
    # Whether a kind of somebody else has sweeps shows when its film is made.
    return isinstance(fed, Installed) or any(
        path.exists()
        for scene in source.scenes()
        for path in {*fed.files(scene)} - {*source.files(scene)}
    )
