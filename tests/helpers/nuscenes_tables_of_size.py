"""nuScenes tables of any length, up to that of all of v1.0-trainval, laid out as its files are: one
value a line.
"""

import json
from itertools import chain

import numpy as np

from tests.helpers.nuscenes_database import (
    CATEGORIES,
    LEVELS,
    SENSORS,
    START_US,
    calibration,
    modality,
)

TRAINVAL_SCENES = 855
"""With so many every table is at least as long as that of v1.0-trainval, which has 850: 34,200
samples, 2,633,400 recordings and poses, 1,197,000 boxes, 64,980 instances.
"""
SAMPLES = 40
BOXES = 35
INSTANCES = 76
RADARS = tuple(f"RADAR_{place}" for place in ("FRONT", "LEFT", "RIGHT", "BACK_LEFT", "BACK_RIGHT"))
COUNTS = dict.fromkeys((*SENSORS, *RADARS), 6) | {"LIDAR_TOP": 11}
RECORDED = [(channel, n) for channel, count in COUNTS.items() for n in range(count)]
"""Channel and number of every recording of a sample; number 0 is the keyframe."""
UNQUOTED = "%r"
STEP_US = 500_000
POINT = np.array([[10.0, 2.0, 0.5, 7.0, 3.0]], "<f4")
PLACE = [411.3039349319818, 1180.8903791765097, 0.0]
BESIDE = [419.3039349319818, 1182.8903791765097, 0.95]
TURN = [0.5720320396729045, -0.0016977771610471074, 0.011798001930183783, -0.8201446642457809]
UPRIGHT = [0.9831098797903927, 0.0, 0.0, -0.18301629506281616]


def write_tables(root, scenes, version="v1.0-trainval"):
    """A database of so many scenes, all alike; the keyframe sweeps of the first hold a point."""
    folder = root / version
    folder.mkdir(parents=True)
    samples = range(scenes * SAMPLES)
    tables = {
        "scene": map(scene, range(scenes)),
        "sample": map(sample, samples),
        "sample_data": chain.from_iterable(map(recordings, samples)),
        "ego_pose": chain.from_iterable(map(poses, samples)),
        "sample_annotation": chain.from_iterable(map(boxes, samples)),
        "instance": map(instance, range(scenes * INSTANCES)),
    }
    for name, rows in tables.items():
        write_rows(folder / f"{name}.json", ROWS[name], rows)
    for name, rows in short_tables().items():
        (folder / f"{name}.json").write_text(json.dumps(rows, indent=0))
    for number in range(SAMPLES):
        sweep = root / filename(number, "LIDAR_TOP", 0)
        sweep.parent.mkdir(parents=True, exist_ok=True)
        POINT.tofile(sweep)
    return root


def write_rows(path, row, values):
    """A list of rows like `row`, whose fields %s, and %r without quotes, hold the `values`."""
    text = json.dumps(row, indent=0).replace(f'"{UNQUOTED}"', "%s")
    with path.open("w") as file:
        file.write("[\n")
        file.writelines((",\n" if n else "") + text % each for n, each in enumerate(values))
        file.write("\n]")


ROWS = {
    "scene": {
        "token": "%s",
        "log_token": "log",
        "nbr_samples": SAMPLES,
        "first_sample_token": "%s",
        "last_sample_token": "%s",
        "name": "%s",
        "description": "Wait, turn left, parked cars",
    },
    "sample": {
        "token": "%s",
        "timestamp": UNQUOTED,
        "prev": "%s",
        "next": "%s",
        "scene_token": "%s",
    },
    "sample_data": {
        "token": "%s",
        "sample_token": "%s",
        "ego_pose_token": "%s",
        "calibrated_sensor_token": "%s",
        "timestamp": UNQUOTED,
        "fileformat": "pcd",
        "is_key_frame": UNQUOTED,
        "height": 900,
        "width": 1600,
        "filename": "%s",
        "prev": "%s",
        "next": "%s",
    },
    "ego_pose": {"token": "%s", "timestamp": START_US, "rotation": TURN, "translation": PLACE},
    "sample_annotation": {
        "token": "%s",
        "sample_token": "%s",
        "instance_token": "%s",
        "visibility_token": "4",
        "attribute_tokens": [f"{0:032x}"],
        "translation": BESIDE,
        "size": [2.877, 10.201, 3.595],
        "rotation": UPRIGHT,
        "prev": "%s",
        "next": "%s",
        "num_lidar_pts": 495,
        "num_radar_pts": 13,
    },
    "instance": {
        "token": "%s",
        "category_token": f"category-{CATEGORIES[0]}",
        "nbr_annotations": 18,
        "first_annotation_token": f"{0:032x}",
        "last_annotation_token": f"{1:032x}",
    },
}


def token(table, number):
    """32 characters, as those of nuScenes."""
    return f"{table}{number:031x}"


def scene(n):
    first = n * SAMPLES
    return token("a", n), token("b", first), token("b", first + SAMPLES - 1), f"scene-{n + 1:04}"


def sample(n):
    after = "" if (n + 1) % SAMPLES == 0 else token("b", n + 1)
    before = token("b", n - 1) if n % SAMPLES else ""
    return token("b", n), START_US + n * STEP_US, before, after, token("a", n // SAMPLES)


def recordings(n):
    for number, (channel, turn) in enumerate(RECORDED):
        own = n * len(RECORDED) + number
        yield (
            token("c", own),
            token("b", n),
            token("d", own),
            f"calibrated-{channel}",
            START_US + n * STEP_US + turn * STEP_US // COUNTS[channel],
            "false" if turn else "true",
            filename(n, channel, turn),
            token("c", own - 1),
            token("c", own + 1),
        )


def filename(n, channel, turn):
    stamp = START_US + n * STEP_US + turn
    folder = "sweeps" if turn else "samples"
    return f"{folder}/{channel}/n015-2018-07-24-11-22-45+0800__{channel}__{stamp}.pcd.bin"


def poses(n):
    return ((token("d", n * len(RECORDED) + number),) for number in range(len(RECORDED)))


def boxes(n):
    for number in range(BOXES):
        own = n * BOXES + number
        of_scene = n // SAMPLES * INSTANCES + (n % SAMPLES + number) % INSTANCES
        yield (
            token("e", own),
            token("b", n),
            token("f", of_scene),
            token("e", own - 1),
            token("e", own + 1),
        )


def instance(n):
    return (token("f", n),)


def short_tables():
    radar = ((0.0, 0.0, 0.5), (1.0, 0.0, 0.0, 0.0), None)
    mounts = dict(SENSORS) | dict.fromkeys(RADARS, radar)
    return {
        "sensor": [
            {"token": f"sensor-{name}", "channel": name, "modality": modality(name)}
            for name in mounts
        ],
        "calibrated_sensor": [calibration(name, *mount) for name, mount in mounts.items()],
        "category": [{"token": f"category-{name}", "name": name} for name in CATEGORIES],
        "visibility": [{"token": key, "level": level} for key, level in LEVELS.items()],
    }
