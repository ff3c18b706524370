"""A log without labels as a ROS 2 bag."""

import numpy as np
from rosbags import rosbag2, typesys

from tests.helpers.sweeps_log import SPEED_MPS, START_NS, stamps, sweep

STORE = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
SECONDS = 1.5
ODOMETRY, POSE = "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped"


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
