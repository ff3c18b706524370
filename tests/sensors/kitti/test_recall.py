"""Recall and scores of the profile `kitti`: the formula, and KITTI's labels beside it."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.types import CLASSES
from care_sim.sensors.kitti import numbers, recall
from care_sim.sensors.kitti.numbers import KIND_OF, measured
from care_sim.sensors.kitti.recall import features, score_logits, score_of
from tests.helpers.kitti_object import kitti_pictures, needs_kitti

KNOT_PX = 35.0
"""A height of the cars' fit."""


def test_a_usual_car_that_nothing_hides_has_the_chance_of_the_file():
    cars = json.loads(Path(numbers.__file__).with_name("measured.json").read_text())["recall"][0]
    at_a_quarter = dict(zip(cars["features"], cars["coefficients"][1], strict=True))
    logit = at_a_quarter["one"] + at_a_quarter["height3"]
    assert cars["knots"][3] == KNOT_PX
    assert recall("car", KNOT_PX) == pytest.approx(1 / (1 + np.exp(-logit)))
    logit += at_a_quarter["occ1"] + at_a_quarter["occ1*log(h/40)"] * np.log(KNOT_PX / 40)
    assert recall("car", KNOT_PX, 1) == pytest.approx(1 / (1 + np.exp(-logit)))


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
    fitted = measured().numbers
    metres = look["distance_m"] if label == "car" else 0.0
    order = "height_px", "width_px", "occlusion", "truncation"
    told = (kind, *(look[name] for name in order), metres, look["cover"], fitted.knots[kind])
    logits = score_logits(fitted.recall[kind], features(*told))
    score = score_of(luck, logits, fitted.thresholds)
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
    ],
)
def test_what_was_not_measured_is_named(look, message):
    with pytest.raises(InvalidInput, match=message):
        recall(*look)


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("height_px", 0.0, "above 0"),
        ("height_px", [40.0, -5.0], "above 0"),
        ("height_px", np.nan, "above 0"),
        ("width_px", 0.0, "above 0"),
        ("distance_m", -1.0, "above 0"),
        ("truncation", 7.0, "from 0 to 1"),
        ("cover", np.nan, "from 0 to 1"),
        ("confidence", 25.0, "between 0 and 1"),
    ],
)
def test_values_out_of_bounds_are_named(name, value, allowed):
    look = {"height_px": 40.0, name: value}
    with pytest.raises(InvalidInput, match=f"{name} must be {allowed}, got "):
        recall("car", **look)


@needs_kitti
def test_one_half_of_the_pictures_predicts_the_other():
    """In bins of more than 100 labels, by a formula fitted without the half. Drives differ: halves
    of whole groups of pictures are off by nearly twice as much as if every label had a luck of its
    own (6.2 points, 3.4).
    """
    pytest.importorskip("sklearn")
    from tests.sensors.kitti.halves import held_out, held_out_by_luck

    told = kitti_pictures()
    errors = np.array([one.error for one in held_out(told)])
    by_luck = np.array([[one.error for one in bins] for bins in held_out_by_luck(told, 10)])
    assert len(errors) > 80
    assert rms(errors) < 2 * rms(by_luck)
    assert np.abs(errors).max() < 1.5 * np.abs(by_luck).max()


def rms(errors):
    return np.sqrt(np.mean(np.square(errors)))
