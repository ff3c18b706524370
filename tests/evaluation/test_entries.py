"""How an object came within range, on scenes of one object, and on random streets."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.evaluation.sightings import VISIBLE, Sightings
from care_sim.evaluation.strata import AT_START, BEYOND, EMERGENCE, ENTRIES, RING, strata


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


@pytest.mark.parametrize(
    ("first", "entry"), [(14, EMERGENCE), (14.99, EMERGENCE), (15, RING), (16, RING), (21, BEYOND)]
)
def test_entries_are_told_by_the_range_that_is_scored(keyframes, first, entry):
    seen = keyframes(None, first, 13)
    assert entry_of(Sightings.of("near", seen, range_m=20.0)) == entry
    assert entry_of(Sightings.of("far", seen)) == EMERGENCE


def test_objects_of_one_scene_are_told_apart_and_all_their_frames_go_with_them(shown):
    near, far, on_ring, first = (
        (1, "car", 9, 0), (2, "car", 0, 40), (3, "bus", 46, 0), (4, "truck", 5, 5)
    )  # fmt: skip
    scene = Sightings.of(
        "four",
        [
            shown((2, "car", 0, 51), first),
            shown(near, on_ring, first, (2, "car", 0, 50.5)),
            shown(far, near, (3, "bus", 30, 0)),
        ],
    )
    objects = {label: scene.frames.objects[rows] for label, rows in strata(scene)["entry"].items()}
    assert {label: found.tolist() for label, found in objects.items()} == {
        EMERGENCE: [1, 1],
        RING: [3, 3],
        BEYOND: [2],
        AT_START: [4, 4],
    }


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
