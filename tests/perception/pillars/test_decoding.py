"""The targets of boxes, read as an answer, are these boxes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import logit

from care_sim.core.types import CLASSES
from care_sim.perception.pillars.decoding import drop_overlaps, peaks_of, points_within, score
from care_sim.perception.pillars.network import CELLS, REACH_M
from care_sim.perception.points_only import inside
from care_sim.training.supervised.detector_data import Example, targets_of

HEIGHT = 1.84
PLAIN = np.tile([1.0, 0.0], (len(CLASSES), 1))
BOXES = st.tuples(
    st.integers(0, len(CLASSES) - 1),
    st.floats(-REACH_M + 0.1, REACH_M - 0.1),
    st.floats(-REACH_M + 0.1, REACH_M - 0.1),
    st.floats(-1.5, 1.0),
    st.floats(0.5, 12.0),
    st.floats(0.5, 3.0),
    st.floats(0.5, 3.5),
    st.floats(-3.1, 3.1),
)


def answer_to(classes, boxes):
    """The answer that is not off at all."""
    example = Example(np.empty((0, 3)), HEIGHT, np.array(classes), np.array(boxes, float))
    wanted = targets_of([example])
    sure = logit(np.clip(wanted.sure[0], 1e-4, 1 - 1e-4))
    return np.concatenate([sure, wanted.boxes[0]]).astype(np.float32)


@settings(max_examples=60, deadline=None)
@given(BOXES)
def test_the_answer_that_was_wanted_tells_of_the_box(drawn):
    label, *box = drawn
    found = peaks_of(answer_to([label], [box]), HEIGHT, PLAIN, 0.5)
    assert found.classes.tolist() == [label]
    assert found.boxes[0, :6] == pytest.approx(box[:6], abs=1e-3)
    turn = found.boxes[0, 6] - box[6]
    assert abs(np.arctan2(np.sin(turn), np.cos(turn))) < 1e-3


def test_cars_side_by_side_stay_two_and_the_surest_comes_first():
    boxes = [[10, y, -1, 4.6, 1.9, 1.7, 0.1] for y in (3.0, 5.5)]
    answer = answer_to([0, 0], boxes)
    answer[0, 62, 57] = 15.0
    found = peaks_of(answer, HEIGHT, PLAIN, 0.5)
    assert found.boxes[:, 1] == pytest.approx([5.5, 3.0], abs=1e-3)


def test_of_two_in_one_place_the_surer_stays():
    car, person = [10.0, 3, -1, 4.6, 1.9, 1.7, 0.1], [11.2, 3.3, -1, 0.6, 0.6, 1.8, 0.0]
    away = [13.2, 3.3, -1, 0.6, 0.6, 1.8, 0.0]
    for boxes in ([car, person, away], [person, car, away]):
        assert drop_overlaps(np.array(boxes, float)).tolist() == [True, False, True]


def test_what_is_less_sure_is_left_out_by_the_calibrated_score():
    answer = answer_to([4], [[5, 5, -1, 0.6, 0.6, 1.8, 0.0]])
    answer[4, answer[4] == answer[4].max()] = 1.0
    half = PLAIN * [[0.5], [0.5], [0.5], [0.5], [0.5]]
    least = 1 / (1 + np.exp(-0.7))
    assert len(peaks_of(answer, HEIGHT, PLAIN, least).classes) == 1
    assert len(peaks_of(answer, HEIGHT, half, least).classes) == 0


def test_scores_of_any_logit_are_chances():
    logits = np.array([-1e6, -1.0, 0.0, 1.0, 1e6])
    told = score(PLAIN, np.zeros(5, np.int64), logits)
    assert told == pytest.approx([0, 0.2689, 0.5, 0.7311, 1], abs=1e-4)


def test_sizes_of_a_wild_answer_are_those_of_bodies():
    answer = np.full((15, CELLS, CELLS), -9.0, np.float32)
    answer[0, 50, 50] = 3
    answer[8:11, 50, 50] = 1e5, -1e5, 0
    (box,) = peaks_of(answer, HEIGHT, PLAIN, 0.5).boxes
    assert box[3:6] == pytest.approx([25.0, 0.2, 1.0])


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=30)
def test_returns_are_counted_as_the_slow_way_does(seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-5, 5, (200, 3))
    boxes = np.column_stack(
        [rng.uniform(-4, 4, (6, 3)), rng.uniform(0.3, 6, (6, 3)), rng.uniform(-4, 4, 6)]
    )
    assert points_within(points, boxes).tolist() == inside(points, boxes).sum(axis=1).tolist()
