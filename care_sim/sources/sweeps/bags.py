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

BAG_SUFFIXES = (".mcap", ".db3")
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
    transform is applied to them. A message that was logged twice counts once.

    Raises InvalidInput for a bag that cannot be read, and for topics that are missing or ambiguous;
    then it lists them. Raises MissingExtra without the extra `rosbags`.
    """
    with _opened(path) as reader:
        _check_topics(path, reader, topics)
        points, posed = (_topic(path, reader, topics, kinds) for kinds in ([POINTS], POSES))
        logged = {_stamp(cloud): moment for cloud, moment in _messages(reader, points)}
        poses = {_stamp(message): _pose(message) for message, _ in _messages(reader, posed)}
    times = sorted(logged)

    def points_of(number: int) -> Floats:
        time_s = times[number]
        with _opened(path) as opened:
            again = _topic(path, opened, topics, [POINTS])
            moment = _messages(opened, again, start=logged[time_s], stop=logged[time_s] + 1)
            found = [points_of_cloud(cloud) for cloud, _ in moment if _stamp(cloud) == time_s]
        return checked_points(f"{path}: {points[0].topic} at {time_s:.3f} s", found[0])

    return Log(
        path.stem,
        f"{path}: {points[0].topic}",
        np.array(times),
        points_of,
        np.array([(time_s, *poses[time_s]) for time_s in sorted(poses)], float).reshape(-1, 8),
        f"{path}: {posed[0].topic}",
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


def _check_topics(path: Path, reader: Any, topics: Sequence[str]) -> None:
    """Raise InvalidInput for a topic that the bag lacks, or that holds neither points nor poses."""
    known = {one.topic for one in reader.connections if one.msgtype in (POINTS, *POSES)}
    for topic in topics:
        if topic not in known:
            raise InvalidInput(
                f"{path}: {topic} is no topic of points or poses; the bag has {_listed(reader)}"
            )


def _topic(path: Path, reader: Any, topics: Sequence[str], kinds: Sequence[str]) -> list[Any]:
    """Return the connections of the only topic of some kinds, or of the one that `topics` names.
    A topic has one for each publisher.
    """
    found = [one for one in reader.connections if one.msgtype in kinds]
    named = [one for one in found if one.topic in topics] or found
    own = {one.topic for one in named}
    if len(own) != 1:
        told = "several topics" if own else "no topic"
        wanted = "; name one with --topics" if own else ""
        raise InvalidInput(
            f"{path}: {told} of {' or '.join(kinds)}{wanted}; the bag has {_listed(reader)}"
        )
    return named


def _listed(reader: Any) -> str:
    told = dict.fromkeys(f"{one.topic} ({one.msgtype})" for one in reader.connections)
    return ", ".join(told) or "none"


def _messages(reader: Any, connections: Sequence[Any], **between: int) -> Iterator[tuple[Any, int]]:
    """Yield the messages of connections, each with the time at which it was logged."""
    for own, logged, raw in reader.messages(connections, **between):
        yield reader.deserialize(raw, own.msgtype), logged


def _stamp(message: Any) -> float:
    stamp = message.header.stamp
    return float(stamp.sec + stamp.nanosec * 1e-9)


def points_of_cloud(cloud: Any) -> Floats:
    """Return (n, 3) x, y and z of a point cloud. Its rows may be padded."""
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
    bytes_of = np.asarray(cloud.data, np.uint8).reshape(cloud.height, cloud.row_step)
    filled = np.ascontiguousarray(bytes_of[:, : cloud.width * cloud.point_step])
    rows = filled.view(kind).ravel()
    return np.stack([rows[axis] for axis in "xyz"], axis=1).astype(float)


def _pose(message: Any) -> list[float]:
    """Return place and quaternion of odometry or of a stamped pose."""
    pose = getattr(message.pose, "pose", message.pose)
    place, turn = pose.position, pose.orientation
    return [place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w]
