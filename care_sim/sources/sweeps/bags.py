"""ROS 2 bags and MCAP files as logs."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from care_sim.base.errors import InvalidInput, error_line
from care_sim.base.extras import import_rosbags
from care_sim.core.arrays import Floats
from care_sim.sources.sweeps.logs import Log
from care_sim.sources.sweeps.points import checked_points

BAG_SUFFIXES = (".mcap", ".db3", ".bag")
METADATA_FILE = "metadata.yaml"
POINTS = "sensor_msgs/msg/PointCloud2"
POSES = ("nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped")
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""The datatypes of sensor_msgs/PointField."""


def is_bag(path: Path) -> bool:
    """Return whether a path is a bag: a file by its suffix, or a folder with `metadata.yaml`."""
    return path.suffix in BAG_SUFFIXES or (path / METADATA_FILE).is_file()


def log_of_bag(path: Path, topics: Sequence[str]) -> Log:
    """Return the log in a bag: its points, and the poses of the car from odometry or stamped poses.
    Times are those of the messages' headers.

    Of several topics of a kind `topics` names the right one. Points are in the LiDAR's axes: no
    transform is applied to them.

    Raises InvalidInput for a bag that cannot be read, and for topics that are missing or ambiguous;
    then it lists them. Raises MissingExtra without the extra `rosbags`.
    """
    with _opened(path) as reader:
        points, posed = (_topic(path, reader, topics, kinds) for kinds in ([POINTS], POSES))
        clouds = sorted((_stamp(cloud), logged) for cloud, logged in _messages(reader, points))
        poses = [_pose(message) for message, _ in _messages(reader, posed)]

    def points_of(number: int) -> Floats:
        time_s, logged = clouds[number]
        with _opened(path) as opened:
            again = _topic(path, opened, topics, [POINTS])
            moment = _messages(opened, again, start=logged, stop=logged + 1)
            found = [_points(cloud) for cloud, _ in moment if _stamp(cloud) == time_s]
        return checked_points(f"{path}: {points.topic} at {time_s:.3f} s", found[0])

    return Log(
        path.stem,
        f"{path}: {points.topic}",
        np.array([time_s for time_s, _ in clouds]),
        points_of,
        np.array(sorted(poses), float).reshape(-1, 8),
        f"{path}: {posed.topic}",
    )


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a bag. The library's errors become one line."""
    highlevel, typesys = import_rosbags()
    # Older bags do not hold the definitions of their messages.
    usual = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    try:
        with highlevel.AnyReader([path], default_typestore=usual) as reader:
            yield reader
    except (KeyboardInterrupt, InvalidInput):
        raise
    # A damaged bag raises whatever its parser meets.
    except Exception as error:
        raise InvalidInput(f"{path}: no bag that can be read ({error_line(error)})") from error


def _topic(path: Path, reader: Any, topics: Sequence[str], kinds: Sequence[str]) -> Any:
    """Return the connection of the only topic of some kinds, or of the one that `topics` names."""
    found = [one for one in reader.connections if one.msgtype in kinds]
    named = [one for one in found if one.topic in topics] or found
    if len({one.topic for one in named}) != 1:
        known = ", ".join(f"{one.topic} ({one.msgtype})" for one in reader.connections)
        raise InvalidInput(
            f"{path}: {len(named)} topics of {' or '.join(kinds)}; name one with `topics`; the bag "
            f"has {known or 'none'}"
        )
    return named[0]


def _messages(reader: Any, connection: Any, **between: int) -> Iterator[tuple[Any, int]]:
    """Yield the messages of a connection, each with the time at which it was logged."""
    for own, logged, raw in reader.messages([connection], **between):
        yield reader.deserialize(raw, own.msgtype), logged


def _stamp(message: Any) -> float:
    stamp = message.header.stamp
    return float(stamp.sec + stamp.nanosec * 1e-9)


def _points(cloud: Any) -> Floats:
    """Return (n, 3) x, y and z of a point cloud."""
    fields = {field.name: field for field in cloud.fields}
    axes = [fields[axis] for axis in "xyz"]
    order = ">" if cloud.is_bigendian else "<"
    kind = np.dtype(
        {
            "names": ["x", "y", "z"],
            "formats": [order + _NUMBERS[axis.datatype] for axis in axes],
            "offsets": [axis.offset for axis in axes],
            "itemsize": cloud.point_step,
        }
    )
    rows = np.frombuffer(cloud.data, kind, cloud.width * cloud.height)
    return np.stack([rows[axis] for axis in "xyz"], axis=1).astype(float)


def _pose(message: Any) -> list[float]:
    """Return seconds, place and quaternion of odometry or of a stamped pose."""
    pose = getattr(message.pose, "pose", message.pose)
    place, turn = pose.position, pose.orientation
    return [_stamp(message), place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w]
