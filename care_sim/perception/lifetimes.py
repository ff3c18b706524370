"""How long a detector lives. A stateless one serves all plays of its process, so a network is
loaded once. Any other detector is made anew for every play, so no play depends on another.
"""

import os
from collections.abc import Callable, Hashable, Mapping
from threading import RLock

from care_sim.base.digests import file_stamp, paths_in
from care_sim.perception.points_only import PointDetector, is_stateless

MOST_KEPT = 8
"""Stateless detectors that a process keeps: the last ones that it asked for."""
_KEPT: dict[Hashable, PointDetector] = {}
_LOCK = RLock()
# A session or a device of a parent does not work in a forked child, which opens its own.
os.register_at_fork(after_in_child=_KEPT.clear)


def kept_or_made(
    make: Callable[..., object],
    parameters: Mapping[str, object],
    made: Callable[[], PointDetector],
) -> PointDetector:
    """Return the stateless detector that `make` made of equal `parameters`, or else what `made`
    returns, and keep it if it is stateless.

    A detector is made again after a file that a parameter names has changed.
    """
    key = _key(make, parameters)
    # Two threads that ask for one network load it once.
    with _LOCK:
        detector = _KEPT.pop(key) if key in _KEPT else made()
        if key is not None and is_stateless(detector):
            _KEPT[key] = detector
        while len(_KEPT) > MOST_KEPT:
            del _KEPT[next(iter(_KEPT))]
    return detector


def _key(make: Callable[..., object], parameters: Mapping[str, object]) -> Hashable:
    """A key of a detector, None where a parameter cannot be compared."""
    told: list[Hashable] = [make]
    for name, given in sorted(parameters.items()):
        value = tuple(given) if isinstance(given, list) else given
        # Both: 1 equals True, and an array writes itself in part.
        told += [name, repr(value), value, *map(file_stamp, paths_in(value))]
    try:
        hash(key := tuple(told))
    except TypeError:
        return None
    return key
