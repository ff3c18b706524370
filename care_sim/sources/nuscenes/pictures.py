"""When the pictures of a keyframe were taken, and where the LiDAR was then.

The cameras take turns, each when the sweep passes its view, and the car drives on: at 9 m/s the
first picture is 0.4 m behind the sweep. Each picture is that of the LiDAR's frame at its own time.
Its detections have an age and a yaw change, so that wedges are turned back as those of late
cameras are. Two things are neglected: boxes are those of the sweep's time, however objects move
within 50 ms, and a wedge has no depth, so it cannot be moved by the way that the car has driven.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats
from care_sim.core.frames import Frame
from care_sim.sources.nuscenes.mounts import frame_of
from care_sim.sources.nuscenes.table_files import JsonRow
from care_sim.sources.nuscenes.tables import Database

OWN, SWEEP = CAMERA_TIMES = ("own", "sweep")
"""Each camera at its own time, or all at that of the sweep."""
MOST_APART_S = 0.5
"""A keyframe: ten times as far as a picture of nuScenes is from its sweep."""


class Pictures(NamedTuple):
    """The pictures of a keyframe, one per camera: the frame of the LiDAR when each was taken, and
    `timing` (k, 2), its age in seconds and by how much the car has turned since.
    """

    moments: list[Frame]
    timing: Floats


def pictures_of(
    database: Database,
    sample: JsonRow,
    recordings: Sequence[JsonRow],
    lidar: Frame,
    sensor: Frame,
    camera_times: str = OWN,
) -> Pictures:
    """The pictures in the `recordings` of a sample. `lidar` is the LiDAR's frame in the car,
    `sensor` that in the world at the sweep.

    Raises InvalidInput for a picture without a pose, or far from its sample in time.
    """
    if camera_times == SWEEP:
        return Pictures([sensor] * len(recordings), np.zeros((len(recordings), 2)))
    cars = [frame_of(database, "ego_pose", database.pose_of(row)) for row in recordings]
    moments = [car.holding(lidar.origin, lidar.rotation) for car in cars]
    ages = np.array([sample["timestamp"] - row["timestamp"] for row in recordings]) * 1e-6
    for row, age in zip(recordings, ages.tolist(), strict=True):
        if abs(age) > MOST_APART_S:
            raise InvalidInput(
                f"{database.path('sample_data')}: {row['token']!r} was taken {abs(age):g} s from "
                f"its sample, may be {MOST_APART_S:g} s (timestamps are microseconds)"
            )
    turns = sensor.yaw - np.array([moment.yaw for moment in moments])
    turns = (turns + np.pi) % (2 * np.pi) - np.pi
    # The last picture of a keyframe may be taken a millisecond after the sweep.
    return Pictures(moments, np.column_stack([np.maximum(ages, 0.0), turns]))
