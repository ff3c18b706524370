"""How long false boxes stay: the real detector's on drives, and the simulated ones' on the same."""

import numpy as np
import pytest
from scipy.stats import binomtest

from care_sim.sensors.kitti.numbers import measured
from tests.helpers.kitti_drives import DRIVES, NAMES, pictures_of_drives, played, stayed
from tests.helpers.kitti_object import FOLDER, kitti_pictures

LAGS = 1, 2, 3, 4
needs_drives = pytest.mark.skipif(
    not (FOLDER.is_dir() and DRIVES.is_dir()), reason=f"no {FOLDER} or no {DRIVES}"
)


def simulated_stays(confidence, seeds=(0, 1)):
    """(4, 2) of all drives together."""
    counts = np.zeros((len(LAGS), 2), int)
    for name in NAMES:
        for seed in seeds:
            told = played(name, measured(), seed)
            frames = {(name, frame): frame for frame in range(told.count)}
            counts += stayed(told, frames, LAGS, confidence)
    return counts


@needs_drives
@pytest.mark.parametrize("confidence", [0.25, 0.5])
def test_false_boxes_stay_as_long_as_the_real_detectors(confidence):
    """Within the 95% interval of the measured share, at each of four lags of 0.1 s."""
    real = stayed(kitti_pictures(), pictures_of_drives(), LAGS, confidence)
    kept, there = simulated_stays(confidence).T
    for (stays, boxes), share in zip(real, kept / there, strict=True):
        low, high = binomtest(int(stays), int(boxes)).proportion_ci(method="wilson")
        assert low <= share <= high, (real.tolist(), kept / there)
