"""Folders of logs without labels; ROS 2 bags and MCAP files as logs."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from care_sim.base.checks import check_known
from care_sim.base.errors import InvalidInput, error_line, shown
from care_sim.base.extras import import_extra
from care_sim.core.arrays import Floats
from care_sim.core.sensor_setup import SensorSetup
from care_sim.loops.film import Film
from care_sim.perception.detectors import CLUSTER
from care_sim.sensors.setups import DEFAULT_SETUP, Sensor, sensor_setup
from care_sim.sources.recordings import Recordings
from care_sim.sources.sweeps.films import BOXES_FILE, check_reference, film_of_log
from care_sim.sources.sweeps.logs import POSES_FILE, SWEEPS_FOLDER, TIMES_FILE, Log, log_of_folder
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

    If a bag has several topics of a kind, `topics` names the right one. Points are in the LiDAR's
    axes: no transform is applied to them. A message that was logged twice counts once.

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
    highlevel = import_extra("rosbags.highlevel", "A bag", "rosbags")
    typesys = import_extra("rosbags.typesys", "A bag", "rosbags")
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


SETUP_FILE = "sensor.toml"


@dataclass(frozen=True)
class Sweeps(Recordings):
    """LiDAR sweeps and poses of the car that nobody annotated: folders, MCAP files or ROS 2 bags.

    A scene is a bag (`care_sim.sources.sweeps.recordings`), or a folder:

    - `sweeps/`: one file per sweep, all PCD, NPY, CSV or BIN
      (`care_sim.sources.sweeps.points.read_sweep`). A name is a time: nanoseconds, microseconds or
      milliseconds since 1970, or seconds with a decimal point. Otherwise `times.csv` has the
      columns file and time.
    - `poses.csv`: the pose of the car (the point on the road below its middle, x ahead, y left, z
      up) in a fixed world. Columns: time, x, y, z (metres), and yaw (radians) or qx, qy, qz, qw.
      Times use the clock of the sweeps. A single row is a car that stands.
    - `camera_boxes.json`, optional: the boxes of a 2D detector (`care_sim.sources.sweeps.films`);
      beside `drive.mcap` it is `drive.camera_boxes.json`. Without it CARE has no residual: it fires
      as history does.

    The folder is a scene, or its sub-folders and MCAP files are scenes. The option `sensor`, else
    `sensor.toml` in the folder or beside it, is the set-up: rows and reach of the LiDAR, its height
    (`position_m`) and the cameras. The default is `hdl-32e`. Points are in the LiDAR's axes, x
    ahead, y left, z up. If x is to the right and y ahead, turn them, or give the set-up `yaw_deg =
    -90`; learned weights do not fit that grid.

    Keyframes are 0.5 s apart. The detector `reference` gets all points of a keyframe. Its tracked
    detections become the annotations, and a cluster that appears within range is a first sighting,
    as in the paper's vehicle study (Sec. 5.5). Limitations: a reference is no truth. A false
    cluster that lasts is an event, an object that the full scan misses is none, and a track that
    breaks becomes two objects. Classes are guesses by size.
    """

    kind = "sweeps"
    suffixes = BAG_SUFFIXES
    sensor: Sensor | None = None
    reference: str = CLUSTER
    topics: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not (isinstance(self.topics, tuple | list) and {*map(type, self.topics)} <= {str}):
            raise InvalidInput(f"topics must be a list of names, got {shown(self.topics)}")
        object.__setattr__(self, "topics", tuple(self.topics))
        check_reference(self.reference)
        sensor_setup(self.setup)

    def scenes(self) -> list[str]:
        """The names of the folders."""
        return list(self._folders())

    def film(self, scene: str) -> Film:
        """See `care_sim.sources.sweeps.films.film_of_log`."""
        folders = self._folders()
        check_known(f"scene in {self.folder}", scene, folders)
        place = folders[scene]
        boxes = self._boxes_of(place)
        return film_of_log(
            log_of_bag(place, self.topics) if is_bag(place) else log_of_folder(place),
            sensor_setup(self.setup),
            self.reference,
            boxes if boxes.exists() else None,
        )

    def files(self, scene: str) -> list[Path]:
        """The bag, or the scene's own files."""
        folder = self._folders().get(scene, self.folder / scene)
        if is_bag(folder):
            return [folder, self._boxes_of(folder)]
        sweeps = sorted((folder / SWEEPS_FOLDER).glob("*"))
        return [*sweeps, folder / POSES_FILE, folder / TIMES_FILE, self._boxes_of(folder)]

    @property
    def setup(self) -> str | SensorSetup:
        """The option, else the file in the folder, else the default."""
        # In the folder that is named, or beside it where that is a scene.
        folder = Path(os.path.abspath(self.folder))
        own = [place / SETUP_FILE for place in (folder, folder.parent)]
        usual = next((str(path) for path in own if path.exists()), DEFAULT_SETUP)
        given = self.sensor if self.sensor is not None else usual
        return given if isinstance(given, SensorSetup) else os.fspath(given)

    def columns(self) -> dict[str, Any]:
        """The reference where it is not the usual one, and the topics where they are named."""
        told = {} if self.reference == CLUSTER else {"reference": self.reference}
        return told | ({"topics": " ".join(self.topics)} if self.topics else {})

    @staticmethod
    def _boxes_of(place: Path) -> Path:
        """Return the file of camera boxes: in the folder, or beside a file."""
        return place.with_suffix(f".{BOXES_FILE}") if place.is_file() else place / BOXES_FILE

    def _folders(self) -> dict[str, Path]:
        """Return the folder of every scene."""
        # Absolute, since a scene is called by its folder: `.` has no name.
        folder = Path(os.path.abspath(self.folder))
        for found in ([folder], sorted(folder.glob("*"))):
            scenes = {
                path.name: path for path in found if is_bag(path) or (path / SWEEPS_FOLDER).is_dir()
            }
            if scenes:
                return scenes
        raise InvalidInput(
            f"{folder}: no scene, a bag or a folder with {SWEEPS_FOLDER}/ (one file per sweep) and "
            f"{POSES_FILE} (time, x, y, z, yaw of the car)"
        )
