"""Reports of PointRCNN in the drives of KITTI in shared/data, object by object."""

import math
from dataclasses import replace
from functools import cache

import numpy as np

from care_sim.core.sensor_setup import SensorSetup
from care_sim.core.types import CLASSES, Detections
from care_sim.evaluation.sightings import RANGE_M
from care_sim.perception.matching import served_by
from care_sim.sensors.setups import sensor_setup
from care_sim.sources.kitti import FRAMES_PER_KEYFRAME, KITTI_CATEGORIES, Kitti
from tests.helpers.nuscenes_reports import OBJECT

COLUMNS = 540
"""The columns before the car, of the 2,083 of a whole turn: the picture is 81 degrees wide."""


@cache
def objects_of(folder):
    """Rows of OBJECT of every fifth frame: the number of the drive as scene, rays of an HDL-64 that
    stop at the box as `returns`, and raw scores, -inf where nothing was reported.
    """
    source = Kitti(folder, sensor=_front())
    rows = []
    for drive in source.scenes():
        reports = _reports(folder, drive)
        for keyframe, shot in enumerate(source.film(drive).shots):
            here = shot.annotations
            found = reports.get(keyframe * FRAMES_PER_KEYFRAME, _NONE)
            scores = np.append(found.scores, -np.inf)[served_by(here, found)]
            near = np.hypot(*here.boxes[:, :2].T) <= RANGE_M
            for row in np.flatnonzero(near):
                number, label = here.objects[row], here.classes[row]
                hits = (shot.cloud.objects == number).sum()
                rows.append((int(drive), keyframe, number, label, hits, hits, 0, scores[row]))
    return np.array(rows, OBJECT)


def _front():
    whole = sensor_setup("hdl-64e")
    grid = replace(
        whole.grid, columns=COLUMNS, field_of_view=2 * math.pi * COLUMNS / whole.grid.columns
    )
    return SensorSetup("hdl-64e-front", grid, whole.position)


def _detections(rows):
    """The detections of rows (n, 14): class, then the numbers of a line of the file."""
    rows = np.array(rows, float).reshape(-1, 14)
    boxes = np.zeros((len(rows), 7))
    # From the camera (x right, z ahead) to the LiDAR, 0.27 m behind it.
    boxes[:, 0], boxes[:, 1] = rows[:, 11] + 0.27, -rows[:, 9]
    return Detections(rows[:, 0].astype(int), boxes, np.zeros(len(rows), int), rows[:, 5])


_NONE = _detections([])


def _reports(folder, drive):
    """By frame, what was reported."""
    frames = {}
    for kind in ("Car", "Pedestrian", "Cyclist"):
        path = folder / "pointrcnn" / kind / f"{drive}.txt"
        for line in path.read_text().split():
            frame, _, *numbers = map(float, line.split(","))
            label = CLASSES.index(KITTI_CATEGORIES[kind])
            frames.setdefault(int(frame), []).append((label, *numbers))
    return {frame: _detections(rows) for frame, rows in frames.items()}
