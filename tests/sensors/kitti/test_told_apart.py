"""False boxes of the profile `kitti` are told from true ones about as well as those of the real
detector, no better and no worse, by a gradient-boosted classifier on all that is shown of a box.
"""

import numpy as np
import pytest

from care_sim.sensors.kitti.numbers import measured
from tests.helpers.kitti_object import halves, kitti_pictures, matched, needs_kitti, simulated

# A dev tool.
pytest.importorskip("sklearn")

from tests.helpers.telling_false_boxes import (
    ALL_BUT_FOOT,
    area_under_the_curve,
    boxes_of_streets,
    on_a_flat_road,
)

CONFIDENCE = 0.25
REAL = 0.922
"""Area under the curve on the real detector's own boxes, held-out pictures; 0.917 to 0.934 by other
halves of whole groups.
"""
POINTS = 0.02
"""Two points, for real and simulated boxes on the same pictures."""
ON_FLAT_ROADS, FOOT_ON_FLAT_ROADS = 0.932, 0.776
"""The real boxes, moved as if roads were flat and objects of a type equally high: by all columns,
and by class, height and lower edge alone.
"""
STREETS, FOOT_ON_STREETS = 0.959, 0.849
"""The same of rendered streets, where roads are flat (`results/degraded-sensing.md`)."""


def boxes_of(told, reported, excused):
    """Boxes with at least the threshold, and which are false."""
    sure = reported[reported[:, 1] >= CONFIDENCE]
    behind = matched(told, sure, excused)
    return sure[behind != -2], behind[behind != -2] == -1


def by_pictures(rows, false, left_out=()):
    return area_under_the_curve(rows, false, halves()[rows[:, 6].astype(int)], left_out)


@needs_kitti
def test_on_kittis_pictures_they_are_told_as_well_as_the_real_ones():
    told = kitti_pictures()
    real, real_false = boxes_of(told, told.found, True)
    assert by_pictures(real, real_false) == pytest.approx(REAL, abs=0.005)
    made, false = boxes_of(told, simulated(told, measured().numbers, seed=0), False)
    assert by_pictures(made, false) == pytest.approx(REAL, abs=POINTS)

    # The flat roads of the simulator, brought to the real pictures.
    flat = on_a_flat_road(told, real)
    assert by_pictures(flat, real_false) == pytest.approx(ON_FLAT_ROADS, abs=0.005)
    foot = by_pictures(flat, real_false, ALL_BUT_FOOT)
    assert foot == pytest.approx(FOOT_ON_FLAT_ROADS, abs=0.01)
    flat = on_a_flat_road(told, made)
    assert by_pictures(flat, false) == pytest.approx(ON_FLAT_ROADS, abs=POINTS)
    assert by_pictures(flat, false, ALL_BUT_FOOT) < FOOT_ON_FLAT_ROADS + 0.05

    # Two faults that cameras have had turn this red: true boxes that are not rounded, and false
    # boxes drawn from true ones.
    rng = np.random.default_rng(0)
    rough = made.copy()
    rough[~false, 2:6] += rng.random((np.count_nonzero(~false), 4))
    assert by_pictures(rough, false) > REAL + POINTS
    true, count = made[~false], np.count_nonzero(false)
    lent = rng.choice(true, count)
    lent[:, 6] = rng.choice(made[:, 6], count)
    mixed, kinds = np.concatenate([true, lent]), np.repeat([False, True], [len(true), count])
    assert by_pictures(mixed, kinds) < REAL - POINTS


def test_on_rendered_streets_they_are_told_a_little_better_than_on_real_flat_roads():
    """Streets that the classifier has not seen. The goal, no better, is missed by 0.03, and by
    0.07 by the lower edge.
    """
    rows, false, streets = boxes_of_streets(range(3000, 3006), episodes=3)
    every, foot = (
        area_under_the_curve(rows, false, streets % 2, left_out) for left_out in ((), ALL_BUT_FOOT)
    )
    assert (every, foot) == pytest.approx((STREETS, FOOT_ON_STREETS), abs=0.005)
    assert every <= ON_FLAT_ROADS + 0.035
    assert foot <= FOOT_ON_FLAT_ROADS + 0.08
