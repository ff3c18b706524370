"""Reports of a real detector in the two scenes of nuScenes in shared/data, object by object."""

import csv
import json
from collections import defaultdict
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from care_sim.core.types import CLASSES, Detections
from care_sim.evaluation.sightings import RANGE_M
from care_sim.perception.matching import UNSERVED, served_by
from care_sim.sensors.annotated import Annotations

KINDS = {
    "vehicle.car": "car",
    "human.pedestrian": "pedestrian",
    "vehicle.truck": "truck",
    "vehicle.bicycle": "bicycle",
}
OBJECT = [
    ("scene", "i4"), ("keyframe", "i4"), ("object", "i4"), ("label", "i4"), ("returns", "f8"),
    ("previous", "f8"), ("age", "i4"), ("score", "f8"),
]  # fmt: skip
"""A row per object of `KINDS` within 50 m at every keyframe but the first of its scene: `previous`
returns are 0 for a newcomer, and the `score` is 0 where nothing was reported."""


@cache
def objects_of(folder, detector):
    """Rows of OBJECT."""

    def table(name):
        return json.loads((folder / "v1.0-mini" / f"{name}.json").read_text())

    categories = {one["token"]: one["name"] for one in table("category")}
    kinds = {one["token"]: categories[one["category_token"]] for one in table("instance")}
    numbers = {token: number for number, token in enumerate(kinds)}
    sensors = _sensors(table)
    annotations, reports = defaultdict(list), defaultdict(list)
    for one in table("sample_annotation"):
        annotations[one["sample_token"]].append(one)
    with (folder / "detections" / f"{detector}.csv").open() as file:
        for row in csv.DictReader(file):
            if row["class"] in CLASSES:
                reports[row["sample_token"]].append(row)
    samples = {one["token"]: one for one in table("sample")}
    rows = []
    for scene, first in enumerate(one["first_sample_token"] for one in table("scene")):
        before, begun, token, keyframe = {}, {}, first, 0
        while token:
            here = _present(annotations[token], numbers, kinds, sensors[token])
            scores = _scores(here, reports[token])
            returns = [one["num_lidar_pts"] for one in annotations[token]]
            near = np.hypot(*here.boxes[:, :2].T) <= RANGE_M
            for row in np.flatnonzero(near & (here.classes >= 0) & (keyframe > 0)):
                number, label = here.objects[row], here.classes[row]
                past = before.get(number, 0), keyframe - begun.get(number, keyframe)
                rows.append((scene, keyframe, number, label, returns[row], *past, scores[row]))
            before = dict(zip(here.objects, returns, strict=True))
            begun = dict.fromkeys(here.objects, keyframe) | begun
            keyframe, token = keyframe + 1, samples[token]["next"]
    return np.array(rows, OBJECT)


def _present(annotations, numbers, kinds, sensor):
    """The annotations of a keyframe; -1 is any other class."""
    turn, origin = sensor
    places = (np.array([one["translation"] for one in annotations]) - origin) @ turn
    tokens = [one["instance_token"] for one in annotations]
    return Annotations(
        np.array([numbers[token] for token in tokens]),
        np.array([_label(kinds[token]) for token in tokens]),
        np.column_stack([places, np.ones((len(tokens), 4))]),
    )


def _scores(present, rows):
    """(n,) the score of the box that serves each object, 0 where none does."""
    found = _reported(rows)
    servers = served_by(present, found)
    return np.where(servers == UNSERVED, 0.0, np.append(found.scores, 0.0)[servers])


def _label(kind):
    return next((CLASSES.index(own) for name, own in KINDS.items() if kind.startswith(name)), -1)


def _sensors(table):
    """By keyframe, the rotation and the place of the LiDAR in the world."""
    poses, mounts = (
        {one["token"]: one for one in table(n)} for n in ("ego_pose", "calibrated_sensor")
    )
    sensors = {}
    for one in table("sample_data"):
        if one["fileformat"] == "pcd":
            pose, mount = poses[one["ego_pose_token"]], mounts[one["calibrated_sensor_token"]]
            car, own = (_matrix(each["rotation"]) for each in (pose, mount))
            origin = car @ np.array(mount["translation"]) + np.array(pose["translation"])
            sensors[one["sample_token"]] = car @ own, origin
    return sensors


def _matrix(wxyz):
    w, x, y, z = wxyz
    return Rotation.from_quat([x, y, z, w]).as_matrix()


def _reported(rows):
    names = ("x_m", "y_m", "z_m", "length_m", "width_m", "height_m", "yaw_rad")
    boxes = np.array([[float(row[name]) for name in names] for row in rows]).reshape(-1, 7)
    labels = np.array([CLASSES.index(row["class"]) for row in rows], np.int64)
    scores = np.array([float(row["score"]) for row in rows])
    return Detections(labels, boxes, np.zeros(len(rows), np.int64), scores)
