"""ROS 2 bags and MCAP files hold the same log as a folder."""

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.sources.kinds import recordings
from tests.helpers.sweeps_log import SPEED_MPS, START_NS, stamps, sweep, write_log

rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

STORE = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
SECONDS = 1.5
ODOMETRY, POSE, TRANSFORM = (
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseStamped",
    "tf2_msgs/msg/TFMessage",
)


def make(kind, /, **values):
    return STORE.types[kind](**values)


def header(stamp, frame):
    time = make("builtin_interfaces/msg/Time", sec=stamp // 10**9, nanosec=stamp % 10**9)
    return make("std_msgs/msg/Header", stamp=time, frame_id=frame)


def cloud(stamp):
    points = sweep((stamp - START_NS) * 1e-9)
    rows = np.zeros(len(points) + 1, [("pad", "<u4"), ("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
    rows["x"], rows["y"], rows["z"] = np.concatenate([np.full((1, 3), np.nan), points]).T
    fields = [
        make("sensor_msgs/msg/PointField", name=axis, offset=4 + 4 * n, datatype=7, count=1)
        for n, axis in enumerate("xyz")
    ]
    return make(
        "sensor_msgs/msg/PointCloud2",
        header=header(stamp, "lidar"),
        height=1,
        width=len(rows),
        fields=fields,
        is_bigendian=False,
        point_step=16,
        row_step=16 * len(rows),
        data=rows.view(np.uint8).ravel(),
        is_dense=False,
    )


def posed(kind, stamp):
    x = (stamp - START_NS) * 1e-9 * SPEED_MPS
    turn = make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    if kind == TRANSFORM:
        place = make("geometry_msgs/msg/Vector3", x=x, y=0.0, z=0.0)
        each = make(
            "geometry_msgs/msg/TransformStamped",
            header=header(stamp, "odom"),
            child_frame_id="base_link",
            transform=make("geometry_msgs/msg/Transform", translation=place, rotation=turn),
        )
        return make(kind, transforms=[each])
    place = make("geometry_msgs/msg/Point", x=x, y=0.0, z=0.0)
    pose = make("geometry_msgs/msg/Pose", position=place, orientation=turn)
    if kind == POSE:
        return make(kind, header=header(stamp, "map"), pose=pose)
    zero = make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
    twist = make("geometry_msgs/msg/Twist", linear=zero, angular=zero)
    return make(
        kind,
        header=header(stamp, "odom"),
        child_frame_id="base_link",
        pose=make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36)),
        twist=make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)),
    )


def write_bag(path, kind=ODOMETRY, storage="MCAP", more=()):
    """A bag whose messages were logged 20 ms after their stamp; `more` are topics of clouds."""
    with rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin[storage]) as bag:
        points = "sensor_msgs/msg/PointCloud2"
        topics = [("/points", points), *((name, points) for name in more)]
        connections = [(bag.add_connection(name, of, typestore=STORE), of) for name, of in topics]
        pose = bag.add_connection("/pose", kind, typestore=STORE) if kind else None
        for stamp in stamps(SECONDS).tolist():
            for connection, of in connections:
                bag.write(connection, stamp + 20_000_000, STORE.serialize_cdr(cloud(stamp), of))
            if pose:
                raw = STORE.serialize_cdr(posed(kind, stamp), kind)
                bag.write(pose, stamp + 20_000_000, raw)
    return path


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    folder = write_log(tmp_path_factory.mktemp("log") / "drive", seconds=SECONDS)
    return recordings(f"sweeps:{folder}").film("drive")


@pytest.mark.parametrize("kind", [ODOMETRY, POSE, TRANSFORM])
@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
def test_a_bag_makes_the_film_that_its_folder_makes(tmp_path, film, kind, storage):
    write_bag(tmp_path / "drive", kind, storage)
    source = recordings(f"sweeps:{tmp_path / 'drive'}")
    (name,) = source.scenes()
    other = source.film(name)
    assert len(other.shots) == len(film.shots) == 4
    for one, two in zip(film.shots, other.shots, strict=True):
        assert two.time_s == pytest.approx(one.time_s, abs=1e-6)
        assert two.ego.speed == pytest.approx(one.ego.speed, abs=1e-4)
        assert two.annotations.boxes == pytest.approx(one.annotations.boxes, abs=1e-3)
    assert source.files(name) == [tmp_path / "drive"]


def test_a_single_mcap_file_and_topics_by_name(tmp_path, film):
    bag = write_bag(tmp_path / "drive", more=["/front/points"])
    (file,) = bag.glob("*.mcap")
    source = recordings(f"sweeps:{file}", {"topics": ("/front/points", "/pose")})
    (name,) = source.scenes()
    assert len(source.film(name).shots) == len(film.shots)
    assert recordings(f"sweeps:{file}").scenes() == [name]


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (
            {"more": ["/front/points"]},
            r"2 topics of sensor_msgs/msg/PointCloud2; name one with `topics`; the bag has "
            r"/points \(sensor_msgs/msg/PointCloud2\), /front/points",
        ),
        ({"kind": ""}, "0 topics of nav_msgs/msg/Odometry or geometry_msgs/msg/PoseStamped or tf2"),
    ],
)
def test_topics_that_are_missing_or_ambiguous_are_listed(tmp_path, given, told):
    source = recordings(f"sweeps:{write_bag(tmp_path / 'drive', **given)}")
    with pytest.raises(InvalidInput, match=told):
        source.film(source.scenes()[0])


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
def test_a_damaged_bag_is_told_in_a_line(tmp_path, storage):
    bag = write_bag(tmp_path / "drive", storage=storage)
    (file,) = (path for path in bag.iterdir() if path.suffix in (".mcap", ".db3"))
    whole = file.read_bytes()
    source = recordings(f"sweeps:{bag}")
    for content in (b"", whole[: len(whole) // 2], b"\0" * 100, whole[:50] + whole[90:]):
        file.write_bytes(content)
        with pytest.raises(InvalidInput, match="no bag that can be read") as caught:
            source.film(source.scenes()[0])
        assert "\n" not in str(caught.value)
