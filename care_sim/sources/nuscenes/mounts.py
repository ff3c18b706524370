"""Where cars, sensors and boxes stand, as the tables of nuScenes tell it."""

import numpy as np
from scipy.spatial.transform import Rotation

from care_sim.base.errors import InvalidInput
from care_sim.core.frames import Frame
from care_sim.sources.nuscenes.cameras import PICTURE, RecordedCamera, recorded_camera
from care_sim.sources.nuscenes.table_files import JsonRow
from care_sim.sources.nuscenes.tables import Database
from care_sim.sources.plausible import MAP_M, MOUNT_M, quaternion_fault

FOCALS = (10.0, 1e5)
"""Pixels: of a picture 1600 wide, views of 179 degrees and of one."""
_FORWARD_FROM_RIGHT = Rotation.from_euler("z", np.pi / 2)
"""In LIDAR_TOP's own frame x points right and y forward."""


def frame_of(database: Database, table: str, row: JsonRow) -> Frame:
    """The frame that a row of `ego_pose`, `calibrated_sensor` or `sample_annotation` tells."""
    # The tables write w first, SciPy writes it last.
    w, x, y, z = database.numbers(table, row, "rotation", 4).tolist()
    mounted = table == "calibrated_sensor"
    fault = quaternion_fault(np.array([[x, y, z, w]]), has_heading=not mounted)
    if fault is not None:
        raise InvalidInput(f"{database.path(table)}: rotation of {row['token']!r}: {fault[1]}")
    origin = database.numbers(table, row, "translation", 3, within=MOUNT_M if mounted else MAP_M)
    return Frame.turned_by(Rotation.from_quat([x, y, z, w]), origin)


def lidar_mount(database: Database, data: JsonRow) -> Frame:
    """The sensor frame of the recording `data` in the car's: x forward where LIDAR_TOP has y
    forward.
    """
    token = data["calibrated_sensor_token"]
    own = frame_of(database, "calibrated_sensor", database.row("calibrated_sensor", token))
    # The car's frame stands on the road.
    if own.z < 0:
        path = database.path("calibrated_sensor")
        raise InvalidInput(f"{path}: {token!r} lies below the road, at {own.z:g} m")
    return Frame.turned_by(own.rotation * _FORWARD_FROM_RIGHT, own.origin)


def camera_of(database: Database, data: JsonRow, lidar: Frame) -> RecordedCamera:
    """The camera that made the recording `data`, in the sensor frame of the LiDAR."""
    token = data["calibrated_sensor_token"]
    row = database.row("calibrated_sensor", token)
    intrinsic = database.numbers("calibrated_sensor", row, "camera_intrinsic", 3, 3)
    if not FOCALS[0] <= intrinsic[0, 0] <= FOCALS[1]:
        raise InvalidInput(
            f"{database.path('calibrated_sensor')}: {token!r} has a camera_intrinsic whose focal "
            "length is not within "
            f"{FOCALS[0]:g} and {FOCALS[1]:g} pixels"
        )
    if not all(0 <= middle <= size for middle, size in zip(intrinsic[:2, 2], PICTURE, strict=True)):
        raise InvalidInput(
            f"{database.path('calibrated_sensor')}: {token!r} has a camera_intrinsic whose "
            "principal point lies "
            f"outside the picture of {PICTURE[0]} x {PICTURE[1]}"
        )
    return recorded_camera(frame_of(database, "calibrated_sensor", row), intrinsic, lidar)
