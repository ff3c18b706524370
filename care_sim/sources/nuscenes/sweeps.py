"""Recorded LiDAR sweeps as clouds of the angular grid. And the sweeps between the keyframes, at 20
Hz, which nobody annotated.
"""

import os
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Frame, turned
from care_sim.core.grid import AngularGrid, Cells
from care_sim.loops.film import Shot, Sweep
from care_sim.sensors.annotated import NO_OBJECT, Annotations, Cloud
from care_sim.sources.film_checks import REACH_M
from care_sim.sources.nuscenes.cameras import frame_of
from care_sim.sources.nuscenes.table_files import JsonRow
from care_sim.sources.nuscenes.tables import LIDAR, Database

VALUES_PER_POINT = 5
"""float32 x, y, z, intensity and ring."""
MOST_SWEEP_BYTES = 2**28
"""Bytes of a file: 13 million points, some hundred times a sweep of any LiDAR."""
FULL_INTENSITY = 255.0
RINGS = 256
"""More than any LiDAR has. nuScenes' has 32."""
OWN_CAR_M = 1.0
"""Points nearer than this lie on the recording car (the radius within which the devkit drops them
from sweeps).
"""


def read_points(path: Path) -> Floats:
    """(n, 5) points of a `.pcd.bin` file: places in the sensor frame (x forward, y left), intensity
    from 0 to 1, and ring. In the file x is right, y forward, and intensities go to 255.

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
            f"bytes"
        )
    rows = values.view("<f4").reshape(-1, VALUES_PER_POINT)
    places, rings = rows[:, :3], rows[:, 4]
    # Before they are cast: the cast warns of a signalling NaN.
    finite = np.isfinite(places).all(axis=1)
    if not finite.all():
        point = f"point {finite.argmin()} has a place that is not finite"
        raise InvalidInput(f"{path}: {point}")
    with np.errstate(invalid="ignore"):
        whole = (rings >= 0) & (rings < RINGS) & (rings == np.rint(rings))
    if not (whole.all() and (np.abs(places) <= REACH_M[1]).all()):
        raise InvalidInput(
            f"{path}: must hold float32 x, y, z within {REACH_M[1]:g} m, intensity, and a whole "
            f"ring from 0 to {RINGS - 1} per point"
        )
    with np.errstate(invalid="ignore"):
        x, y, z, intensity, ring = rows.astype(float).T
    return np.column_stack([y, -x, z, intensity / FULL_INTENSITY, ring])


def recorded_cloud(
    points: Floats, grid: AngularGrid, annotations: Annotations, sensor: Frame
) -> Cloud:
    """Return the points that a ray of `grid` could have returned, each with the annotated box that
    it lies in. Points are (n, 3), or (n, 5) with intensities and rings. Points beyond the reach are
    far.
    """
    near, far = (
        cloud_of_points(*points_of_grid(points, grid, beyond), annotations, sensor)
        for beyond in (False, True)
    )
    return replace(near, far=far)


def cloud_of_points(cells: Cells, points: Floats, annotations: Annotations, sensor: Frame) -> Cloud:
    """Points (n, 3 or 5) of ascending cells as a cloud. NaN is what nobody recorded."""
    columns = points[:, 3:].T if points.shape[1] > 3 else np.full((2, len(points)), np.nan)
    known = [None if np.isnan(column).any() else column for column in columns]
    intensities, rings = known
    return Cloud(
        cells,
        points[:, :3],
        owners(points[:, :3], annotations, sensor),
        intensities,
        rings=None if rings is None else rings.astype(np.int64),
    )


def points_of_grid(points: Floats, grid: AngularGrid, beyond: bool = False) -> tuple[Cells, Floats]:
    """Return cells and points (n, 3 or more) that a ray of `grid` could have returned, in the order
    of cells; or those `beyond` its reach.
    """
    ranges = np.linalg.norm(points[:, :3], axis=1)
    cells = grid.cells_of(points[:, :3])
    reached = ranges > grid.range_m if beyond else ranges <= grid.range_m
    (kept,) = np.nonzero((cells >= 0) & (ranges > OWN_CAR_M) & reached)
    # All points of a cell stay.
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


def with_earlier_sweeps(
    database: Database,
    samples: Sequence[JsonRow],
    shots: tuple[Shot, ...],
    lidar: Frame,
    grid: AngularGrid,
    most: int,
) -> tuple[Shot, ...]:
    """The shots of the samples, each but the first with the last sweeps since the one before it, at
    most so many. `lidar` is the sensor frame in the car's.

    Raises InvalidInput where there are none in the whole scene, and as `read_points` does.
    """
    between = earlier(database, samples, most)
    if len(samples) > 1 and not any(between):
        path = database.path("sample_data")
        raise InvalidInput(
            f"{path}: no {LIDAR} between {samples[0]['token']!r} and "
            f"{samples[-1]['token']!r}: a film of it has one sweep a keyframe"
        )
    return tuple(
        replace(
            shot, sweeps=tuple(_sweep(database, row, sample, shot, lidar, grid) for row in rows)
        )
        for shot, sample, rows in zip(shots, samples, ([], *between), strict=True)
    )


def earlier(database: Database, samples: Sequence[JsonRow], most: int) -> list[list[JsonRow]]:
    """Return the last recordings of the LiDAR between each two samples, at most so many, in order
    of time.
    """
    # By their times: which of two samples a sweep is filed under does not matter.
    rows = [row for sample in samples for row in database.recordings(sample["token"])]
    sweeps = sorted(
        (row for row in rows if not row["is_key_frame"]), key=lambda row: int(row["timestamp"])
    )
    taken = [row["timestamp"] for row in sweeps]
    edges = np.searchsorted(taken, [sample["timestamp"] for sample in samples])
    return [sweeps[start:end][-most:] for start, end in pairwise(edges.tolist())]


def _sweep(
    database: Database,
    row: JsonRow,
    sample: JsonRow,
    shot: Shot,
    lidar: Frame,
    grid: AngularGrid,
) -> Sweep:
    car = frame_of(database, "ego_pose", database.pose_of(row))
    own = car.holding(lidar.origin, lidar.rotation)
    # Nobody annotated the moment: points belong to the boxes of the keyframe, seen from here.
    boxes = own.boxes_of(shot.sensor, shot.annotations.boxes)
    points = read_points(database.root / row["filename"])
    cloud = recorded_cloud(points, grid, replace(shot.annotations, boxes=boxes), own)
    time_s = shot.time_s - (sample["timestamp"] - row["timestamp"]) * 1e-6
    return Sweep(time_s, own, cloud)
