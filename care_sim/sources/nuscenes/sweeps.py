"""Recorded LiDAR sweeps as clouds of the angular grid."""

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Frame, turned
from care_sim.core.grid import AngularGrid, Cells
from care_sim.sensors.annotated import NO_OBJECT, Annotations, Cloud
from care_sim.sources.plausible import REACH_M

VALUES_PER_POINT = 5
"""float32 x, y, z, intensity and ring."""
MOST_SWEEP_BYTES = 2**28
"""Bytes of a file: 13 million points, some hundred times a sweep of any LiDAR."""
RINGS = 256
"""More than any LiDAR has. nuScenes' has 32."""
_OTHERS = {
    4: "x, y, z and intensity (KITTI)",
    6: "x, y, z, intensity, elongation and another (Waymo)",
}
"""Contents of files with another number of values per point."""
OWN_CAR_M = 1.0
"""Points nearer than this lie on the recording car (the radius within which the devkit drops them
from sweeps).
"""


def read_points(path: Path) -> Floats:
    """(n, 3) points of a `.pcd.bin` file in the sensor frame: x forward, y left. In the file x is
    right, y forward.

    Raises InvalidInput for a file that is missing, truncated or larger than `MOST_SWEEP_BYTES`, for
    a place that is not finite, and for a file of another form.
    """
    if not os.path.isfile(path):
        raise InvalidInput(f"{path}: no such file")
    if path.stat().st_size > MOST_SWEEP_BYTES:
        raise InvalidInput(
            f"{path}: {path.stat().st_size} bytes, a sweep may hold {MOST_SWEEP_BYTES}"
        )
    try:
        values = np.fromfile(path, np.uint8)
    except OSError as error:
        raise InvalidInput(f"{path}: cannot be read ({error})") from error
    if values.size % (4 * VALUES_PER_POINT) or not values.size:
        raise InvalidInput(
            f"{path}: {values.size} bytes are no whole number of points of {4 * VALUES_PER_POINT} "
            f"bytes{_other_form(values)}"
        )
    rows = values.view("<f4").reshape(-1, VALUES_PER_POINT)
    places, rings = rows[:, :3], rows[:, 4]
    # Before they are cast: the cast warns of a signalling NaN.
    finite = np.isfinite(places).all(axis=1)
    if not finite.all():
        point = f"point {finite.argmin()} has a place that is not finite"
        raise InvalidInput(f"{path}: {point}{_other_form(values)}")
    with np.errstate(invalid="ignore"):
        whole = (rings >= 0) & (rings < RINGS) & (rings == np.rint(rings))
    if not (whole.all() and (np.abs(places) <= REACH_M[1]).all()):
        raise InvalidInput(
            f"{path}: must hold float32 x, y, z within {REACH_M[1]:g} m, intensity, and a whole "
            f"ring from 0 to {RINGS - 1} per point{_other_form(values)}"
        )
    points = places.astype(float)
    return np.column_stack([points[:, 1], -points[:, 0], points[:, 2]])


def _other_form(content: NDArray[np.uint8]) -> str:
    """Return which other form the content of a file seems to have, to end a complaint."""
    for count, names in _OTHERS.items():
        if content.size and content.size % (4 * count) == 0:
            rows = content.view("<f4").reshape(-1, count)
            # Intensity and elongation are never negative, places on one side of the car are.
            with np.errstate(invalid="ignore"):
                fits = (np.abs(rows[:, :3]) <= REACH_M[1]).all() and (rows[:, 3:5] >= 0).all()
            if fits:
                return f"; it looks like {count} values per point: {names}"
    return ""


def recorded_cloud(
    points: Floats, grid: AngularGrid, annotations: Annotations, sensor: Frame
) -> Cloud:
    """The points (n, 3) that a ray of `grid` could have returned, each with the annotated box that
    it lies in.
    """
    cells, kept = points_of_grid(points, grid)
    return Cloud(cells, kept, owners(kept, annotations, sensor))


def points_of_grid(points: Floats, grid: AngularGrid) -> tuple[Cells, Floats]:
    """Those of points (n, 3) that a ray of `grid` could have returned, in the order of their cells,
    and the cells first.
    """
    ranges = np.linalg.norm(points, axis=1)
    cells = grid.cells_of(points)
    (kept,) = np.nonzero((cells >= 0) & (ranges > OWN_CAR_M) & (ranges <= grid.range_m))
    # Of several points in a cell all stay.
    order = kept[np.argsort(cells[kept], kind="stable")]
    return cells[order], points[order]


def owners(points: Floats, annotations: Annotations, sensor: Frame) -> Integers:
    """(n,) the annotated object whose box holds each point (n, 3), the smallest of several,
    NO_OBJECT where there is none.

    Boxes stand upright in the world, however the frame `sensor` of points and annotations leans.
    """
    # A ball round each box finds the few points that may lie in it. From the largest box down, so
    # that the smallest one that holds a point has the last word.
    found = np.full(len(points), NO_OBJECT, np.int64)
    boxes = sensor.boxes_to_world(annotations.boxes)
    places = KDTree(sensor.origin + sensor.vectors_to_world(points))
    near = places.query_ball_point(boxes[:, :3], np.linalg.norm(boxes[:, 3:6], axis=1) / 2)
    for row in np.argsort(-boxes[:, 3:6].prod(axis=1), kind="stable").tolist():
        box = boxes[row]
        rows = np.array(near[row], dtype=np.int64)
        inside = np.all(
            np.abs(turned(places.data[rows] - box[:3], -box[6])) <= box[3:6] / 2, axis=1
        )
        found[rows[inside]] = annotations.objects[row]
    return found
