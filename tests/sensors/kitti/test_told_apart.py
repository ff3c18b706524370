"""False boxes of the profile `kitti` are told from true ones about as well as those of the real
detector, no better and no worse, by a gradient-boosted classifier on all that is shown of a box.
"""

import numpy as np
import pytest

from care_sim.core.types import ImageDetections
from care_sim.envs.open_loop import FilmEnv
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.sensors.kitti.numbers import measured
from care_sim.sources.street_films import record
from care_sim.streets.street import make_street
from tests.helpers.kitti_object import kitti_pictures, matched, needs_kitti, simulated

CONFIDENCE = 0.25
REAL = 0.943
"""Area under the curve on the real detector's own boxes, held-out pictures; 0.003 by a bootstrap of
pictures, 0.02 between splits.
"""
POINTS = 0.03
"""Three points, for real and simulated boxes on the same pictures."""
STREETS = 0.974
"""On rendered streets. Their roads are flat: without the upper and lower edges it is 0.945 there,
and 0.940 on the real boxes (`docs/camera.md`).
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


def shown_boxes(seed, episodes):
    """All boxes (n, 7) that observations of a street show, and which are false."""
    env = FilmEnv(record(make_street(seed)), budget=0.01, camera_profile="kitti")
    rows, false = [], []
    for episode in range(episodes):
        observation, _ = env.reset(seed=episode)
        over = False
        while not over:
            shown = observation["detections"][observation["detections"][:, 0] >= 0].astype(float)
            behind = env.unwrapped.loop.true_detected_objects()
            pictures = shown[:, ImageDetections.CAMERA] + 6 * len(rows)
            rows.append(np.column_stack([shown[:, :6], pictures]))
            false.append(behind == NO_OBJECT)
            observation, _, ended, cut, _ = env.step(np.zeros(env.action_space.shape, np.float32))
            over = ended or cut
    return np.concatenate(rows), np.concatenate(false)


def test_on_rendered_streets_they_are_told_as_published(area):
    """Streets that the classifier has not seen."""
    parts = [shown_boxes(seed, episodes=3) for seed in range(3000, 3006)]
    streets = np.repeat(np.arange(len(parts)), [len(rows) for rows, _ in parts])
    pictures = np.cumsum([0, *(rows[:, 6].max() + 1 for rows, _ in parts)])
    rows = np.concatenate([rows for rows, _ in parts])
    rows[:, 6] += pictures[streets]
    found = area(rows, np.concatenate([false for _, false in parts]), streets % 2)
    assert found == pytest.approx(STREETS, abs=0.01)
