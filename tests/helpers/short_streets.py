"""A few streets of a few keyframes, for tests that meet streets but neither their number nor their
length.
"""

from contextlib import contextmanager
from dataclasses import replace
from functools import cache, partial
from unittest import mock

from care_sim.sources import street_films
from care_sim.sources.street_films import record
from care_sim.streets.layouts import LAYOUTS
from care_sim.streets.street import make_street

KEYFRAMES = 10
_films = {}


def part_of(street, keyframes):
    """A street for some of its keyframes, a slice."""
    return replace(
        street,
        poses=street.poses[keyframes],
        ego=street.ego[keyframes],
        motion=street.motion[keyframes],
    )


@contextmanager
def few_and_short(keyframes=KEYFRAMES):
    """While it lasts, a seed gives an environment one of four streets, one of each layout, which
    ends after 10 keyframes, or as many as are asked for, in the place of 40. A whole film takes
    three seconds, and the checkers of Gymnasium and Stable-Baselines3 ask for ten to thirty of
    them.
    """
    make_street = partial(_short_street, keyframes=keyframes)
    with mock.patch.multiple(street_films, make_street=make_street, record=_filmed):
        street_films._street_film.cache_clear()
        yield
    street_films._street_film.cache_clear()


@cache
def _short_street(seed, clutter=False, *, keyframes):
    # Layouts take turns by seed, so this one has the layout of the street that it stands for.
    return part_of(make_street(seed % len(LAYOUTS), clutter), slice(keyframes))


def _filmed(street, *taken):
    key = street.name, len(street.ego), *taken
    if key not in _films:
        _films[key] = record(street, *taken)
    return _films[key]
