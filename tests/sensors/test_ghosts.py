"""Ghosts: how many there are, how long they last, and that they follow an object of the pool."""

from itertools import pairwise

import numpy as np
import pytest

from care_sim.core.types import ImageDetections
from care_sim.sensors.annotated import IdentifiedDetections
from care_sim.sensors.camera_errors import Ghosts
from care_sim.sensors.camera_profiles import YOLOX
from care_sim.sensors.false_boxes import EMPTY_POOL, NO_ROWS, BoxPool
from care_sim.sensors.pictures import FRONT_CAMERA

KEYFRAME_S = 0.1
OBJECTS = 50


def row(place, shift=0.0):
    left = 5.0 + 6.0 * place + shift
    return [4, 0.5, left, 60.0, left + 4.0, 80.0, 0, 0.0, 0.0]


def pool(pictures=160, objects=OBJECTS, pixels_per_keyframe=0.0):
    """Objects side by side that move to the right together."""
    seen = [
        IdentifiedDetections(
            ImageDetections.from_rows(
                np.array([row(n, pixels_per_keyframe * k) for n in range(objects)])
            ),
            np.arange(objects),
        )
        for k in range(pictures)
    ]
    return BoxPool.of(seen, KEYFRAME_S * np.arange(pictures), [FRONT_CAMERA])


STILL = pool()


def shown(lent=STILL, rate=2.0, time_s=0.5, keyframes=100, seed=0, true=NO_ROWS):
    ghosts = Ghosts(lent, rate, time_s, KEYFRAME_S, 1, np.random.default_rng(seed))
    return [ghosts.draw(true, KEYFRAME_S * k) for k in range(keyframes)]


def test_there_are_as_many_as_stated_from_the_first_picture_on():
    lengths = np.array([list(map(len, shown(keyframes=12, seed=seed))) for seed in range(60)])
    assert lengths[:, 0].mean() == pytest.approx(2.0, abs=0.6)
    assert lengths.mean() == pytest.approx(2.0, abs=0.4)


@pytest.mark.parametrize(
    ("time_s", "pictures"),
    # 1 / (1 - exp(-keyframe / time)) pictures; 1.95 were measured on the detections of YOLOX.
    [(YOLOX.ghost_time_s, 1.95), (0.5, 5.52)],
)
def test_they_last_as_many_pictures_as_stated(time_s, pictures):
    there = stay = 0
    for seed in range(16):
        # Each keeps its left edge in a pool that stands still.
        edges = [set(boxes[:, 2].tolist()) for boxes in shown(time_s=time_s, seed=seed)]
        there += sum(map(len, edges[:-1]))
        stay += sum(len(now & before) for before, now in pairwise(edges))
    assert 1 / (1 - stay / there) == pytest.approx(pictures, rel=0.1)


def test_a_ghost_moves_as_the_object_that_it_follows():
    moving = pool(pictures=60, objects=1, pixels_per_keyframe=3.0)
    steps = []
    for seed in range(6):
        # One ghost is shown at most. It ends with the pool's last picture, and another may follow.
        lefts = [boxes[0, 2] for boxes in shown(moving, 1.0, 1e6, 10, seed) if len(boxes) == 1]
        steps += np.diff(lefts).tolist()
    # Near the pool's edges its variation is made the other way round: that step is another.
    assert len(steps) > 12
    assert np.median(steps) == pytest.approx(3.0, abs=0.3)
    assert np.mean(np.abs(np.array(steps) - 3.0) < 1.1) > 0.7


def test_it_ends_where_its_object_leaves_the_pictures():
    lives_on = shown(pool(pictures=30, objects=OBJECTS), 3.0, 1e6, 31)
    assert len(lives_on[0]) > 0
    assert len(lives_on[-1]) == 0


def test_it_is_hidden_by_a_box_of_its_class_and_comes_back():
    one = pool(objects=1)
    free = [len(boxes) for boxes in shown(one, 3.0, 1e6, 10)]
    assert max(free) == 1
    assert not any(len(boxes) for boxes in shown(one, 3.0, 1e6, 10, true=np.array([row(0)])))
    other_class = np.array([[0, *row(0)[1:]]])
    assert [len(boxes) for boxes in shown(one, 3.0, 1e6, 10, true=other_class)] == free


def test_what_is_there_does_not_move_the_draws():
    everything = np.array([row(n) for n in range(0, OBJECTS, 2)])
    ours, theirs = shown(keyframes=60), shown(keyframes=60, true=everything)
    for free, beside in zip(ours, theirs, strict=True):
        assert {*beside[:, 2].tolist()} <= {*free[:, 2].tolist()}
    assert sum(map(len, theirs)) < sum(map(len, ours))


def test_an_empty_pool_has_none():
    assert not any(map(len, shown(EMPTY_POOL, keyframes=5)))
