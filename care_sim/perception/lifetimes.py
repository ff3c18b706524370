"""Lifetimes of detectors. A stateless one serves all plays of its process, so a network is loaded
once. Any other detector is made anew for every play, so no play depends on another.
"""

import os
from collections.abc import Callable, Hashable, Iterable, Mapping
from pathlib import Path
from threading import RLock

from care_sim.base.digests import file_digest, paths_in
from care_sim.perception.points_only import PointDetector, files_of, is_stateless

MOST_KEPT = 8
"""Number of stateless detectors that a process keeps, the most recent ones."""
_KEPT: dict[Hashable, tuple[PointDetector, list[str | None]]] = {}
"""Each with the hashes of the files that it read."""
_LOCK = RLock()


def _forget() -> None:
    """Forget the parent's detectors and lock in a forked child. A parent's session or device does
    not work there, and a parent's thread that held the lock is gone.
    """
    global _LOCK
    _LOCK = RLock()
    _KEPT.clear()


os.register_at_fork(after_in_child=_forget)


def get_or_make(
    make: Callable[..., object],
    parameters: Mapping[str, object],
    made: Callable[[], PointDetector],
    declared: Iterable[Path] = (),
) -> PointDetector:
    """Return the kept stateless detector of equal `parameters`, or a new one, kept if it is
    stateless.

    A detector is made again after one of its files has changed: files that a parameter names, that
    its entry point `declared`, or that the detector lists in `files`.
    """
    key = _key(make, parameters, declared)
    # Two threads that need one network load it once.
    with _LOCK:
        detector, read = _KEPT.pop(key, (None, []))
        if detector is None or read != _hashes(files_of(detector)):
            detector = made()
        read = _hashes(files_of(detector))
        if key is not None and None not in read and is_stateless(detector):
            _KEPT[key] = detector, read
        while len(_KEPT) > MOST_KEPT:
            del _KEPT[next(iter(_KEPT))]
    return detector


def _hashes(files: Iterable[Path]) -> list[str | None]:
    return [file_digest(file) for file in files]


def _key(
    make: Callable[..., object], parameters: Mapping[str, object], declared: Iterable[Path]
) -> Hashable:
    """A key of a detector, None where a parameter cannot be compared, or a folder not be read."""
    told: list[Hashable] = [make]
    hashes = _hashes(declared)
    for name, given in sorted(parameters.items()):
        value = tuple(given) if isinstance(given, list) else given
        # Both: 1 equals True, and an array writes itself in part.
        told += [name, repr(value), value]
        hashes += _hashes(paths_in(value))
    try:
        hash(key := (*told, *hashes))
    except TypeError:
        return None
    return None if None in hashes else key
