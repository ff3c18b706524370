import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import Sensing
from care_sim.perception.proxy import ReturnsRule, count_hits

LABELS = {4: 0, 9: 4}


def boxes_of(bodies):
    return np.array([[body, 0, 0, 1, 1, 1, 0] for body in bodies.tolist()], dtype=float).reshape(
        -1, 7
    )


def detect(hits, **rules):
    return ReturnsRule(LABELS, **rules).detections(np.array(hits, dtype=np.int64), boxes_of)


@pytest.mark.parametrize(("min_returns", "found"), [(1, [4, 9]), (2, [4, 9]), (3, [4]), (4, [])])
def test_the_threshold_is_exact(min_returns, found):
    _, bodies = detect([4, 9, 4, 9, 4, -1, -1, -1, -1], min_returns=min_returns)
    assert bodies.tolist() == found


def test_three_returns_by_default_with_class_true_box_and_count():
    detections, bodies = detect([9, 4, 9, 4, 9, 9])
    assert bodies.tolist() == [9]
    assert (detections.classes.tolist(), detections.returns.tolist()) == ([4], [4])
    assert detections.boxes.tolist() == boxes_of(np.array([9])).tolist()


def test_what_is_not_reported_is_not_detected():
    detections, bodies = detect([7] * 50 + [-1] * 50 + [0] * 50)
    assert len(detections) == len(bodies) == 0
    assert detections.boxes.shape == (0, 7)


def test_no_returns_no_detections():
    assert len(detect([])[0]) == 0


@pytest.mark.parametrize("min_returns", [0, -1, 2.5])
def test_an_impossible_threshold_is_refused_by_name(min_returns):
    with pytest.raises(InvalidInput, match="min_returns"):
        Sensing(min_returns=min_returns)


@pytest.mark.parametrize("apart", [1, 3, 10**12])
def test_bodies_are_counted_however_far_their_numbers_lie_apart(apart):
    hits = np.random.default_rng(0).integers(-1, 9, 500) * apart
    bodies = np.array([0, 2, 3, 7]) * apart
    counts = count_hits(bodies, hits)
    assert counts.tolist() == [np.count_nonzero(hits == body) for body in bodies]
