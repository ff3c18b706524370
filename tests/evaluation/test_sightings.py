"""Every rule of what is a first sighting, on scenes of one object, and on random streets."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.evaluation.sightings import ANNOTATED, VISIBLE, Sightings

SEEDS = st.integers(0, 2**32 - 1)


def events(sightings):
    """(keyframe, object) of every event."""
    found = sightings.frames.take(sightings.events)
    return list(zip(found.keyframes.tolist(), found.objects.tolist(), strict=True))


@pytest.fixture(scope="session")
def path(shown):
    """The scene of one pedestrian at these distances straight ahead; None where it is not
    annotated.
    """

    def make(*distances):
        return Sightings.of(
            "path", [shown() if x is None else shown((7, "pedestrian", x, 0.0)) for x in distances]
        )

    return make


@pytest.mark.parametrize(
    ("distances", "keyframe"),
    [
        pytest.param((10, 10, 10), None, id="present at start"),
        pytest.param((60, 60, 49), 2, id="annotated at start, enters by range"),
        pytest.param(
            (None, 60, 40), 2, id="annotated later and beyond range, then enters by range"
        ),
        pytest.param((None, None, 20), 2, id="out of an occlusion"),
        pytest.param((None, 20), 1, id="at the last keyframe"),
        pytest.param((None, 20, None, 20, None, 20), 1, id="annotation gaps after the event"),
        pytest.param((60, 40, 60, 40), 1, id="leaves by range and returns"),
        pytest.param((10, 60, 10), None, id="present at start, leaves by range and returns"),
        pytest.param((10, None, 10), None, id="present at start, occluded and back"),
        pytest.param((60, 70, None, 55), None, id="never within range"),
        pytest.param((60, 50.0), 1, id="at the range"),
        pytest.param((60, 50.01), None, id="just beyond the range"),
        pytest.param((50.0, 20), None, id="at the range at start"),
        pytest.param((50.01, 20), 1, id="just beyond the range at start"),
        pytest.param((20,), None, id="a scene of one keyframe"),
    ],
)
def test_when_an_object_is_first_sighted(path, distances, keyframe):
    assert events(path(*distances)) == ([] if keyframe is None else [(keyframe, 7)])


@pytest.mark.parametrize(
    ("hidden_at", "distances", "annotated", "visible", "emerging"),
    [
        pytest.param(20, (None, None, 15), None, 2, 1, id="behind a van from the start, walks out"),
        pytest.param(
            20,
            (None, 60, 15),
            None,
            2,
            1,
            id="hidden within range, shown beyond it, enters by range",
        ),
        pytest.param(50.0, (None, 40), None, 1, 1, id="hidden at the range at start"),
        pytest.param(50.01, (None, 40), 1, 1, 0, id="hidden just beyond the range at start"),
        pytest.param(60, (None, None, 40), 2, 2, 0, id="hidden and beyond range, enters by range"),
        pytest.param(20, (None, None, None), None, None, 0, id="hidden to the end"),
        pytest.param(
            20, (None, 70, 60), None, None, 0, id="hidden within range, shown beyond it alone"
        ),
    ],
)
def test_who_is_annotated_at_the_start_is_present_though_nothing_shows_it(
    shown, hidden_at, distances, annotated, visible, emerging
):
    keyframes = [shown() if x is None else shown((7, "pedestrian", x, 0.0)) for x in distances]
    hidden = shown((7, "pedestrian", hidden_at, 0.0))
    by_rule = Sightings.of("path", keyframes, hidden=hidden)
    by_sight = Sightings.of("path", keyframes, hidden=hidden, presence=VISIBLE)
    assert events(by_rule) == ([] if annotated is None else [(annotated, 7)])
    assert events(by_sight) == ([] if visible is None else [(visible, 7)])
    assert len(by_rule.emerging) == len(by_sight.emerging) == emerging
    assert by_rule.frames.keyframes.tolist() == by_sight.frames.keyframes.tolist(), (
        "what is scored is the same"
    )


def test_who_was_hidden_is_told_from_who_was_not(shown):
    keyframes = [
        shown((1, "car", 9, 0)),
        shown((3, "car", 5, 5), (1, "car", 8, 0), (2, "pedestrian", 6, 0)),
    ]
    scene = Sightings.of("two", keyframes, hidden=shown((2, "pedestrian", 7, 3)))
    assert events(scene) == [(1, 3)]
    assert scene.appearing(1).tolist() == [True, False, False]
    assert scene.frames.objects[scene.emerging].tolist() == [2]


def test_an_object_cannot_be_hidden_and_seen_at_once_nor_a_presence_made_up(shown):
    with pytest.raises(
        InvalidInput, match="scene both, keyframe 0: object 4 is annotated more than once"
    ):
        Sightings.of("both", [shown((4, "car", 9, 0))], hidden=shown((4, "car", 9, 0)))
    for other in ("seen", None, [ANNOTATED]):
        with pytest.raises(InvalidInput, match="presence must be 'annotated' or 'visible', got"):
            Sightings.of("any", [shown()], presence=other)


def test_range_is_planar_and_the_height_of_a_box_plays_no_part(shown):
    below = shown((1, "car", 30, 40))
    below.boxes[0, 2] = -20.0
    assert events(Sightings.of("ramp", [shown(), below])) == [(1, 1)]


def test_object_frames_are_those_in_range(path):
    scene = path(60, 40, None, 50, 50.01, 30)
    assert scene.frames.keyframes.tolist() == [1, 3, 5]
    assert scene.in_range.tolist() == [False, True, True, False, True]


def test_a_scene_may_be_empty_of_objects_but_not_of_keyframes(shown):
    assert len(Sightings.of("quiet", [shown(), shown()]).frames) == 0
    with pytest.raises(
        InvalidInput, match="scene nothing: a scene must have at least one keyframe"
    ):
        Sightings.of("nothing", [])


@pytest.mark.parametrize("centre", [(np.nan, 0.0), (0.0, np.inf)])
def test_an_object_that_is_nowhere_is_named(shown, centre):
    with pytest.raises(InvalidInput, match="scene lost, keyframe 1: object 5 has no finite centre"):
        Sightings.of("lost", [shown(), shown((3, "car", 1, 1), (5, "car", *centre))])


@given(SEEDS)
def test_a_first_sighting_is_the_earliest_of_an_object_that_was_not_there_at_start(street, seed):
    keyframes = street(seed)
    near = [
        {
            n
            for n, box in zip(a.objects.tolist(), a.boxes, strict=True)
            if np.hypot(box[0], box[1]) <= 50
        }
        for a in keyframes
    ]
    expected = [
        (k, n) for k in range(1, len(near)) for n in sorted(near[k] - set().union(*near[:k]))
    ]
    assert events(Sightings.of("any", keyframes)) == expected
