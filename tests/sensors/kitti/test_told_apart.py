"""False boxes of the profile `kitti` are told from true ones about as well as those of the real
detector, no better and no worse, by a gradient-boosted classifier on all that is shown of a box.
"""

import numpy as np
import pytest

from care_sim.sensors.kitti.numbers import measured
from tests.helpers.kitti_object import kitti_pictures, matched, needs_kitti, simulated

CONFIDENCE = 0.25
REAL = 0.943
"""Area under the curve on the real detector's own boxes, held-out pictures; 0.003 by a bootstrap of
pictures, 0.02 between splits.
"""
POINTS = 0.03
"""Three points, for real and simulated boxes on the same pictures."""
STREETS = 0.973
"""On rendered streets. Their roads are flat: without upper and lower edges it is 0.940, as it is on
the real boxes (`docs/camera.md`).
"""


@pytest.fixture(scope="module")
def area():
    # A dev tool: without it nothing else here needs to be skipped.
    pytest.importorskip("sklearn")
    from tests.helpers.telling_false_boxes import area_under_the_curve

    return area_under_the_curve


def boxes_of(told, reported, excused):
    """Boxes with at least the threshold, and which are false."""
    sure = reported[reported[:, 1] >= CONFIDENCE]
    behind = matched(told, sure, excused)
    return sure[behind != -2], behind[behind != -2] == -1


def by_pictures(area, rows, false):
    return area(rows, false, rows[:, 6].astype(int) % 2)


@needs_kitti
def test_on_kittis_pictures_they_are_told_as_well_as_the_real_ones(area):
    told = kitti_pictures()
    real, real_false = boxes_of(told, told.found, True)
    assert by_pictures(area, real, real_false) == pytest.approx(REAL, abs=0.005)
    made, false = boxes_of(told, simulated(told, measured().numbers, seed=0), False)
    assert by_pictures(area, made, false) == pytest.approx(REAL, abs=POINTS)

    # Two faults that cameras have had turn this red: true boxes that are not rounded, and false
    # boxes drawn from true ones.
    rng = np.random.default_rng(0)
    rough = made.copy()
    rough[~false, 2:6] += rng.random((np.count_nonzero(~false), 4))
    assert by_pictures(area, rough, false) > REAL + POINTS
    true, count = made[~false], np.count_nonzero(false)
    lent = rng.choice(true, count)
    lent[:, 6] = rng.choice(made[:, 6], count)
    mixed, kinds = np.concatenate([true, lent]), np.repeat([False, True], [len(true), count])
    assert by_pictures(area, mixed, kinds) < REAL - POINTS


def test_on_rendered_streets_they_are_told_as_published(area):
    """Streets that the classifier has not seen."""
    from tests.helpers.telling_false_boxes import boxes_of_streets

    rows, false, streets = boxes_of_streets(range(3000, 3004), episodes=3)
    assert area(rows, false, streets % 2) == pytest.approx(STREETS, abs=0.012)
