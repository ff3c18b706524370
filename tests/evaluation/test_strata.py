"""Strata by hand, and that nothing is counted twice or left out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.types import CLASSES
from care_sim.evaluation.recall import Tally
from care_sim.evaluation.sightings import VISIBLE, Sightings
from care_sim.evaluation.strata import (
    AT_START,
    BEYOND,
    EMERGENCE,
    ENTRIES,
    RING,
    strata,
    thirds,
)


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


def test_by_class(shown):
    for name in CLASSES:
        assert labels(shown, "class", name, 1.0, 1.0) == [name]


@given(st.integers(0, 2**32 - 1))
def test_the_strata_of_a_kind_add_up_to_the_scene(street, detector, score_scene, seed):
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


def entry_of(scene):
    """The stratum of the only object; it holds all its rows."""
    (label,) = (label for label, rows in strata(scene)["entry"].items() if rows.any())
    assert strata(scene)["entry"][label].all()
    return label


@pytest.fixture(scope="session")
def keyframes(shown):
    """One pedestrian at these distances straight ahead; None where it is not annotated."""

    def make(*distances):
        return [shown() if x is None else shown((7, "pedestrian", x, 0.0)) for x in distances]

    return make


@pytest.mark.parametrize(
    ("distances", "entry"),
    [
        pytest.param((None, 20, 18), EMERGENCE, id="out from behind a body"),
        pytest.param((None, 44.99), EMERGENCE, id="just nearer than the ring"),
        pytest.param((None, 45.0), RING, id="where the ring begins"),
        pytest.param((None, 50.0, 20), RING, id="at the range, then near"),
        pytest.param((None, 50.01, 49), BEYOND, id="just beyond the range, then over it"),
        pytest.param((60, 49), BEYOND, id="beyond the range at start"),
        pytest.param((None, 60, None, 15), BEYOND, id="shown beyond, hidden, and out near the car"),
        pytest.param((None, 20, 60, 49), EMERGENCE, id="out from behind a body, away and back"),
        pytest.param((20, 60, 49), AT_START, id="present at start"),
        pytest.param((50.0, None, 20), AT_START, id="present at start at the range, and hidden"),
    ],
)
def test_how_an_object_came_within_range(keyframes, distances, entry):
    assert entry_of(Sightings.of("one", keyframes(*distances))) == entry


@pytest.mark.parametrize(
    ("hidden_at", "distances", "by_rule", "by_sight"),
    [
        pytest.param(10, (None, None, 12), AT_START, EMERGENCE, id="behind a van from the start"),
        pytest.param(10, (None, 60, 40), AT_START, BEYOND, id="hidden within, shown beyond"),
        pytest.param(60, (None, 30), EMERGENCE, EMERGENCE, id="hidden beyond the range"),
    ],
)
def test_what_nothing_shows_yet_is_not_seen_beyond(
    shown, keyframes, hidden_at, distances, by_rule, by_sight
):
    hidden = shown((7, "pedestrian", hidden_at, 0.0))
    made = [
        Sightings.of("one", keyframes(*distances), hidden=hidden, **more)
        for more in ({}, {"presence": VISIBLE})
    ]
    assert [entry_of(scene) for scene in made] == [by_rule, by_sight]


@given(st.integers(0, 2**32 - 1))
def test_every_event_has_one_entry_and_who_has_none_was_there_at_start(street, seed):
    """Told again from the annotations alone, object by object."""
    scene = Sightings.of("any", street(seed))
    entries = strata(scene)["entry"]
    assert tuple(entries) == ENTRIES
    assert np.all(np.sum([rows[scene.events] for rows in list(entries.values())[:3]], axis=0) == 1)
    for label, rows in entries.items():
        for number in np.unique(scene.frames.objects[rows]):
            first = next(
                np.hypot(*annotations.boxes[annotations.objects == number][0, :2])
                for annotations in scene.keyframes
                if number in annotations.objects
            )
            event = number in scene.frames.objects[scene.events]
            told = EMERGENCE if first < 45 else BEYOND if first > 50 else RING
            assert label == (told if event else AT_START)
