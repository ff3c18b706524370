"""Class confusion: the long run is the matrix."""

import numpy as np
import pytest

from care_sim.core.types import CLASSES
from care_sim.sensors.camera_errors import confused
from care_sim.sensors.camera_profiles import YOLOX

MATRIX = YOLOX.confusion_matrix()
BICYCLE, PEDESTRIAN = CLASSES.index("bicycle"), CLASSES.index("pedestrian")


def test_rows_of_the_matrix_are_chances():
    assert MATRIX.sum(axis=1) == pytest.approx(1.0)
    assert np.all(MATRIX >= 0)
    assert MATRIX[BICYCLE, PEDESTRIAN] == 0.20
    assert MATRIX[PEDESTRIAN, BICYCLE] == 0.0


@pytest.mark.parametrize("true", range(len(CLASSES)))
def test_classes_are_reported_as_often_as_the_matrix_says(true):
    draws = (np.arange(1000) + 0.5) / 1000
    reported = confused(np.full(1000, true), draws, MATRIX)
    assert np.bincount(reported, minlength=5) / 1000 == pytest.approx(MATRIX[true])


def test_a_draw_below_one_always_has_a_class():
    thirds = np.full((3, 3), 1 / 3)
    assert confused(np.array([0]), np.array([np.nextafter(1.0, 0.0)]), thirds).tolist() == [2]
