"""Strata by hand, and that nothing is counted twice or left out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.evaluation.recall import Tally, score_scene
from care_sim.evaluation.sightings import Sightings
from care_sim.evaluation.strata import strata, thirds


def labels(shown, kind, name, x, y):
    """The strata in which an object at (x, y) lies."""
    scene = Sightings.of("one", [shown((1, name, x, y))])
    return [label for label, rows in strata(scene)[kind].items() if rows[0]]


@pytest.mark.parametrize(
    ("distance", "label"),
    [(0, "below 20 m"), (19.9, "below 20 m"), (20, "20 to 35 m"), (34.9, "20 to 35 m"),
     (35, "from 35 m"), (50, "from 35 m")],
)  # fmt: skip
def test_by_range(shown, distance, label):
    assert labels(shown, "range", "car", 0.0, distance) == [label]


@pytest.mark.parametrize(
    ("degrees", "label"),
    [(0, "front"), (44.9, "front"), (-44.9, "front"), (45.1, "side"), (-90, "side"),
     (134.9, "side"), (135.1, "rear"), (-135.1, "rear"), (179.9, "rear"), (-179.9, "rear"),
     (180, "rear"), (-180, "rear")],
)  # fmt: skip
def test_by_sector_with_the_seam_in_the_rear(shown, degrees, label):
    angle = np.deg2rad(degrees)
    assert labels(shown, "azimuth", "car", 10 * np.cos(angle), 10 * np.sin(angle)) == [label]


@pytest.mark.parametrize("name", ["car", "truck", "bus", "bicycle", "pedestrian"])
def test_by_class(shown, name):
    assert labels(shown, "class", name, 1.0, 1.0) == [name]


@given(st.integers(0, 2**32 - 1))
def test_the_strata_of_a_kind_add_up_to_the_scene(street, detector, seed):
    keyframes = street(seed)
    result = score_scene(Sightings.of("any", keyframes), detector(keyframes, seed))
    for parts in strata(result.sightings).values():
        assert np.all(np.sum(list(parts.values()), axis=0) == 1)
        assert sum((result.tally(rows) for rows in parts.values()), Tally()) == result.tally()


def test_thirds_are_ranked_by_count_then_name():
    counts = {"f": 3, "e": 1, "d": 9, "c": 4, "b": 3, "a": 7}
    assert thirds(counts) == {"sparse": ["e", "b"], "middle": ["f", "c"], "dense": ["a", "d"]}


@pytest.mark.parametrize(
    ("scenes", "sizes"), [(150, [50, 50, 50]), (151, [50, 51, 50]), (2, [1, 0, 1]), (0, [0, 0, 0])]
)
def test_thirds_differ_by_a_scene_at_most(scenes, sizes):
    parts = thirds({str(n): n % 7 for n in range(scenes)})
    assert [len(part) for part in parts.values()] == sizes
    assert len({scene for part in parts.values() for scene in part}) == scenes
