"""Writes small databases in the schema of nuScenes v1.0, with one of its published calibrations."""

import json

import numpy as np
from scipy.spatial.transform import Rotation

_CALIBRATION = """
LIDAR_TOP       0.943713 0.0 1.84023 0.7077955 -0.0064922 0.0106462 -0.7063073
CAM_FRONT       1.70079 0.01595 1.51096 0.4998015 -0.5030316 0.4997798 -0.4973708 1266.417 816.267 491.507
CAM_FRONT_LEFT  1.52388 0.49463 1.50933 0.6757265 -0.6736267 0.2121402 -0.2112283 1272.598 826.615 479.752
CAM_FRONT_RIGHT 1.55085 -0.4934 1.49575 0.2060348 -0.2026941 0.6824508 -0.6713611 1260.847 807.968 495.334
CAM_BACK_LEFT   1.03569 0.4848 1.59097 0.6924186 -0.7031619 -0.1164834 0.1120332 1256.741 792.113 492.776
CAM_BACK_RIGHT  1.01488 -0.48057 1.5624 0.1228098 -0.1324008 -0.7004306 0.690496 1259.514 807.253 501.196
CAM_BACK        0.02833 0.00345 1.5791 0.5037873 -0.4974025 -0.494185 0.5045496 809.221 829.22 481.778
"""  # noqa: E501
"""Every sensor has x, y, z and the quaternion w, x, y, z in the car's frame; cameras also have the
focal length and the principal point.
"""


def _mount(numbers):
    place, turn, camera = numbers[:3], numbers[3:7], numbers[7:]
    return place, turn, camera or None


SENSORS = {
    name: _mount(tuple(map(float, numbers)))
    for name, *numbers in map(str.split, _CALIBRATION.strip().splitlines())
}
LIDAR = SENSORS["LIDAR_TOP"]
CATEGORIES = (
    "vehicle.car",
    "human.pedestrian.adult",
    "vehicle.bicycle",
    "vehicle.trailer",
    "vehicle.bus.rigid",
    "vehicle.truck",
)
ATTRIBUTES = (
    "vehicle.parked",
    "vehicle.moving",
    "cycle.without_rider",
    "cycle.with_rider",
    "pedestrian.standing",
    "pedestrian.moving",
)
LEVELS = {"1": "v0-40", "2": "v40-60", "3": "v60-80", "4": "v80-100"}


START_US = 1_532_402_927_000_000
"""Time of the first sample, microseconds."""


def annotated(
    category,
    place,
    size=(1.9, 4.6, 1.7),
    yaw=0.0,
    instance=None,
    visible="4",
    points=10,
    attribute=None,
):
    """An annotation in the world; `size` is width, length, height as in the table."""
    attributes = [f"attribute-{attribute}"] if attribute else []
    return {
        "instance": instance or category,
        "category": category,
        "translation": list(place),
        "size": list(size),
        "rotation": [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)],
        "visibility_token": visible,
        "num_lidar_pts": points,
        "num_radar_pts": 0,
        "attribute_tokens": attributes,
    }


def add_recorded_losses(points):
    """Rows of a sweep file for points (n, 3) in the car's frame."""
    w, x, y, z = LIDAR[1]
    own = Rotation.from_quat([x, y, z, w]).inv().apply(np.asarray(points) - LIDAR[0])
    return np.column_stack([own, np.full(len(own), 7.0), np.zeros(len(own))])


def pose(x=0.0, y=0.0, yaw=0.0):
    return {
        "translation": [x, y, 0.0],
        "rotation": [float(np.cos(yaw / 2)), 0.0, 0.0, float(np.sin(yaw / 2))],
    }


def write(root, scenes, version="v1.0-trainval"):
    """`scenes` maps names to lists of samples: (annotations, pose, points of the sweep (n, 5))."""
    tables = {name: [] for name in TABLES}
    tables["sensor"] = [
        {"token": f"sensor-{c}", "channel": c, "modality": modality(c)} for c in SENSORS
    ]
    tables["calibrated_sensor"] = [
        calibration(channel, *values) for channel, values in SENSORS.items()
    ]
    for table, names in (("category", CATEGORIES), ("attribute", ATTRIBUTES)):
        tables[table] = [
            {"token": f"{table}-{name}", "name": name, "description": ""} for name in names
        ]
    tables["visibility"] = [
        {"token": token, "level": level, "description": ""} for token, level in LEVELS.items()
    ]
    nothing = dict.fromkeys(("logfile", "date_captured", "location"), "")
    tables["log"] = [{"token": "log", "vehicle": "n015"} | nothing]
    tables["map"] = [
        {"token": "map", "log_tokens": ["log"], "category": "semantic_prior", "filename": ""}
    ]
    for name, samples in scenes.items():
        add_scene(tables, root, name, samples)
    folder = root / version
    folder.mkdir(parents=True)
    for name, rows in tables.items():
        (folder / f"{name}.json").write_text(json.dumps(rows))
    return root


TABLES = (
    *("attribute", "calibrated_sensor", "category", "ego_pose", "instance", "log", "map"),
    *("sample", "sample_annotation", "sample_data", "scene", "sensor", "visibility"),
)


def modality(channel):
    return "lidar" if channel == "LIDAR_TOP" else "camera"


def calibration(channel, translation, rotation, intrinsic):
    focal, u, v = intrinsic or (0, 0, 0)
    matrix = [[focal, 0.0, u], [0.0, focal, v], [0.0, 0.0, 1.0]] if intrinsic else []
    return {
        "token": f"calibrated-{channel}",
        "sensor_token": f"sensor-{channel}",
        "translation": list(translation),
        "rotation": list(rotation),
        "camera_intrinsic": matrix,
    }


def add_scene(tables, root, name, samples):
    tokens = [f"{name}-{n}" for n in range(len(samples))]
    tables["scene"].append(
        {
            "token": f"scene-{name}",
            "log_token": "log",
            "nbr_samples": len(samples),
            "name": name,
            "description": "",
            "first_sample_token": tokens[0],
            "last_sample_token": tokens[-1],
        }
    )
    for n, (boxes, car, points) in enumerate(samples):
        stamp = START_US + n * 500_000
        tables["sample"].append(
            {"token": tokens[n], "timestamp": stamp, "scene_token": f"scene-{name}"}
            | {"prev": tokens[n - 1] if n else "", "next": "".join(tokens[n + 1 : n + 2])}
        )
        for channel in SENSORS:
            add_data(tables, root, tokens[n], channel, car, points, stamp)
        for m, box in enumerate(boxes):
            add_box(tables, f"{tokens[n]}-{m}", tokens[n], name, box)


def add_data(tables, root, sample, channel, car, points, stamp):
    token = f"{sample}-{channel}"
    tables["ego_pose"].append({"token": f"pose-{token}", "timestamp": 0} | car)
    suffix = "pcd.bin" if channel == "LIDAR_TOP" else "jpg"
    filename = f"samples/{channel}/{sample}.{suffix}"
    camera = channel != "LIDAR_TOP"
    tables["sample_data"].append(
        {
            "token": token,
            "sample_token": sample,
            "ego_pose_token": f"pose-{token}",
            "is_key_frame": True,
            "calibrated_sensor_token": f"calibrated-{channel}",
            "filename": filename,
            "fileformat": suffix,
            "width": 1600 * camera,
            "height": 900 * camera,
            "timestamp": stamp,
            "prev": "",
            "next": "",
        }
    )
    if not camera:
        (root / filename).parent.mkdir(parents=True, exist_ok=True)
        np.asarray(points, "<f4").tofile(root / filename)


def add_box(tables, token, sample, scene, box):
    box = dict(box)
    instance, category = f"{scene}-{box.pop('instance')}", box.pop("category")
    if instance not in [row["token"] for row in tables["instance"]]:
        tables["instance"].append(
            {
                "token": instance,
                "category_token": f"category-{category}",
                "nbr_annotations": 0,
                "first_annotation_token": token,
                "last_annotation_token": "",
            }
        )
    prev = link(tables, instance, token)
    places = {"token": token, "sample_token": sample, "instance_token": instance}
    tables["sample_annotation"].append(places | {"prev": prev, "next": ""} | box)


def link(tables, instance, token):
    """Make an annotation the last of its instance; the token of the one before it."""
    (row,) = (row for row in tables["instance"] if row["token"] == instance)
    prev = row["last_annotation_token"]
    row.update(last_annotation_token=token, nbr_annotations=row["nbr_annotations"] + 1)
    for box in tables["sample_annotation"]:
        if box["token"] == prev:
            box["next"] = token
    return prev


def change(root, table, edit, version="v1.0-trainval"):
    """Edit the rows of a table in place."""
    path = root / version / f"{table}.json"
    rows = json.loads(path.read_text())
    edit(rows)
    path.write_text(json.dumps(rows))
