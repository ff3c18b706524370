"""The sweeps of the LiDAR between the keyframes, at 20 Hz, which nobody annotated."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.loops.film import Shot, Sweep
from care_sim.sensors.annotated import Cloud
from care_sim.sources.nuscenes.mounts import frame_of
from care_sim.sources.nuscenes.sweeps import owners, points_of_grid, read_points
from care_sim.sources.nuscenes.table_files import JsonRow
from care_sim.sources.nuscenes.tables import LIDAR, Database


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
    cells, points = points_of_grid(read_points(database.root / row["filename"]), grid)
    objects = owners(shot.sensor.points_of(own, points), shot.annotations, shot.sensor)
    time_s = shot.time_s - (sample["timestamp"] - row["timestamp"]) * 1e-6
    return Sweep(time_s, own, Cloud(cells, points, objects))
