"""nuScenes tables of any length, up to all of v1.0-trainval: one scene again and again, under other
names.
"""

import json

from tests.helpers.nuscenes_database import CATEGORIES, annotated, pose, write

TRAINVAL_SCENES = 855
"""With so many every table is at least as long as that of v1.0-trainval, which has 850: 34,200
samples, 2,633,400 recordings and poses, 1,197,000 boxes, 64,980 instances.
"""
SAMPLES = 40
BOXES = 35
INSTANCES = 76
RECORDINGS = 11
"""Recordings of each sensor per sample; the first is the keyframe."""
NAME = "scene-0001"
PLACE = (411.3039349319818, 1180.8903791765097)
BESIDE = (419.3039349319818, 1182.8903791765097, 0.95)
POINT = [[10.0, 2.0, 0.5, 7.0, 3.0]]


def write_tables(root, scenes):
    """A database of so many scenes, all alike; the keyframe sweeps of the first hold a point."""
    folder = write(root, {NAME: [_sample(n) for n in range(SAMPLES)]}) / "v1.0-trainval"
    for table in ("scene", "sample", "sample_data", "ego_pose", "sample_annotation", "instance"):
        path = folder / f"{table}.json"
        rows = json.loads(path.read_text())
        if table in ("sample_data", "ego_pose"):
            rows = [_again(row, turn) for row in rows for turn in range(RECORDINGS)]
        # One value a line, as in the files of nuScenes.
        text = json.dumps(rows, indent=0)[1:-1]
        with path.open("w") as file:
            file.write("[")
            for number in range(scenes):
                file.write("," * bool(number) + text.replace(NAME, f"scene-{number + 1:04}"))
            file.write("]")
    return root


def _sample(number):
    instances = [str((number + box) % INSTANCES) for box in range(BOXES)]
    boxes = [annotated(CATEGORIES[0], BESIDE, instance=one) for one in instances]
    return boxes, pose(*PLACE), POINT


def _again(row, turn):
    """A row of a recording or its pose, as that of a later turn of the sensor."""
    if not turn:
        return row
    later = {name: f"{row[name]}-{turn}" for name in ("token", "ego_pose_token") if name in row}
    if "filename" in row:
        later |= {"is_key_frame": False, "timestamp": row["timestamp"] + 45_000 * turn}
        later["filename"] = row["filename"].replace("samples", "sweeps")
    return row | later
