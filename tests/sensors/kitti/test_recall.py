"""Recall and scores of the profile `kitti`: the formula, and KITTI's labels beside it."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.types import CLASSES
from care_sim.sensors.kitti import recall
from care_sim.sensors.kitti.numbers import KIND_OF, measured
from care_sim.sensors.kitti.recall import features, score_logits, score_of
from tests.helpers.kitti_object import as_labels, kitti_pictures, matched, needs_kitti

KNOT_PX, AT_KNOT = 35.0, -0.1856 + 5.9234
"""A height of the cars' fit, and the logit at confidence 0.25 that `measured.json` has for it."""


def test_a_usual_car_that_nothing_hides_has_the_chance_of_the_file():
    assert recall("car", KNOT_PX) == pytest.approx(1 / (1 + np.exp(-AT_KNOT)))
    partly = recall("car", KNOT_PX, 1)
    logit = AT_KNOT - 1.2003 + 0.9634 * np.log(KNOT_PX / 40)
    assert partly == pytest.approx(1 / (1 + np.exp(-logit)))


LOOKS = {
    "height_px": st.floats(5, 400),
    "occlusion": st.integers(0, 3),
    "truncation": st.floats(0, 1),
    "distance_m": st.floats(1, 100),
    "width_px": st.floats(3, 800),
    "cover": st.floats(0, 1),
}


@given(label=st.sampled_from(CLASSES), look=st.fixed_dictionaries(LOOKS), luck=st.floats(-9, 9))
def test_the_score_of_a_luck_is_the_highest_that_its_chance_reaches(label, look, luck):
    kind = KIND_OF[label]
    numbers = measured().numbers
    metres = look["distance_m"] if label == "car" else 0.0
    order = "height_px", "width_px", "occlusion", "truncation"
    told = (kind, *(look[name] for name in order), metres, look["cover"], numbers.knots[kind])
    logits = score_logits(numbers.recall[kind], features(*told))
    score = score_of(luck, logits, numbers.thresholds)
    chances = [recall(label, **look, confidence=t) for t in (0.05, 0.25, 0.6, 0.9, 0.999)]
    assert all(0 <= more <= less <= 1 for less, more in pairwise(chances))
    share = 1 / (1 + np.exp(-luck))
    if score == 0:
        assert share >= chances[0] - 1e-9
    elif 0.05 < score < 0.9997:
        reached = recall(label, **look, confidence=score)
        steep = recall(label, **look, confidence=score * (1 - 1e-6))
        assert reached - 1e-6 <= share <= steep + 1e-6


@pytest.mark.parametrize("label", ["truck", "bus"])
def test_trucks_and_buses_are_found_as_a_usual_car_of_their_height(label):
    assert recall(label, 80.0, 1, distance_m=60.0) == recall("car", 80.0, 1)


@pytest.mark.parametrize(
    ("look", "message"),
    [
        (("lorry", 40.0), "label must be one of car, truck, bus, bicycle, pedestrian, got 'lorry'"),
        (("car", 40.0, 4), "occlusion must be 0, 1, 2 or 3, got 4"),
        (("car", 40.0, 0, 0.0, 20.0, 25.0), "confidence must be between 0 and 1, got 25.0"),
    ],
)
def test_what_was_not_measured_is_named(look, message):
    places, confidence = look[:5], dict(zip(("confidence",), look[5:], strict=False))
    with pytest.raises(InvalidInput, match=message):
        recall(*places, **confidence)


HEIGHTS = {
    "car": (0, 20, 25, 30, 40, 60, 80, 120, 180, 400),
    "pedestrian": (0, 40, 60, 80, 110, 160, 400),
    "bicycle": (0, 25, 40, 60, 400),
}
METRES = (0, 10, 15, 20, 25, 30, 40, 50, 60, 90)
BEYOND = (-1.0, 0.001, 0.15, 0.3, 0.5, 1.01)
CONFIDENCE = 0.25


def bins(label, told):
    """Masks of labels (n,), by level, height, both, distance and truncation."""
    height, (beyond, levels, metres) = told.boxes[:, 3] - told.boxes[:, 1], told.told.T
    by_height = [(height >= low) & (height < high) for low, high in pairwise(HEIGHTS[label])]
    by_level = [levels == level for level in range(4)]
    yield from by_level
    yield from by_height
    yield from (own & level for own in by_height for level in by_level)
    yield from ((metres >= low) & (metres < high) for low, high in pairwise(METRES))
    yield from ((beyond > low) & (beyond <= high) for low, high in pairwise(BEYOND))


@needs_kitti
def test_recall_is_predicted_as_well_as_one_half_of_the_pictures_predicts_the_other():
    """In bins of more than 100 labels. Two points in every bin cannot be met: with these numbers of
    labels chance alone breaks a third of them.
    """
    told = kitti_pictures()
    labels, rows = as_labels(told)
    sure = told.found[told.found[:, 1] >= CONFIDENCE]
    found = np.isin(rows, matched(told, sure))
    half = labels.cameras % 2
    own = told._replace(boxes=labels.boxes, told=told.told[rows])
    errors, halves = [], []
    for label in ("car", "pedestrian", "bicycle"):
        is_own = labels.classes == CLASSES.index(label)
        size = labels.boxes[:, 2:] - labels.boxes[:, :2]
        predicted = recall(
            label,
            size[:, 1],
            labels.levels,
            labels.beyond,
            own.told[:, 2],
            width_px=size[:, 0],
            cover=labels.cover,
        )
        assert predicted[is_own].mean() == pytest.approx(found[is_own].mean(), abs=0.005)
        for members in bins(label, own):
            sides = [is_own & members & (half == side) for side in (0, 1)]
            for side, other in (sides, sides[::-1]):
                if side.sum() > 100 and other.any():
                    errors.append(predicted[side].mean() - found[side].mean())
                    halves.append(found[other].mean() - found[side].mean())
    assert len(errors) > 80
    rms_error, rms_halves = (np.sqrt(np.mean(np.square(own))) for own in (errors, halves))
    assert rms_error <= rms_halves
