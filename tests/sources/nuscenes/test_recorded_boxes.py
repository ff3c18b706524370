"""Reports of CenterPoint on two real scenes, played back by the detector `recorded`."""

import csv
import json
from collections import defaultdict

import numpy as np
import pytest

from care_sim.sources.named import source_of
from care_sim.study.play_config import play_grid
from care_sim.study.rows.parameters import parameters
from care_sim.study.scene_play import play_scene

FIRST_SIGHTINGS = {
    ("history", 0.05): 22.3, ("history", 0.1): 37.7,
    ("all-camera", 0.05): 31.6, ("all-camera", 0.1): 52.9,
    ("care", 0.05): 41.2, ("care", 0.1): 54.4,
    ("full", 1.0): 55.9,
}  # fmt: skip
"""Percent, as published in `results/recorded-drives.md`."""


def official(csv_file, source):
    """The boxes of a CSV file in the official form: there they are in the frame of the LiDAR, x
    right and y ahead.
    """
    shots = {shot.token: shot for scene in source.scenes() for shot in source.film(scene).shots}
    results = {token: [] for token in shots}
    with csv_file.open() as file:
        for row in csv.DictReader(file):
            names = ("x_m", "y_m", "z_m", "length_m", "width_m", "height_m", "yaw_rad", "score")
            right, ahead, up, *size, yaw, score = (float(row[name]) for name in names)
            box = np.array([[ahead, -right, up, *size, yaw - np.pi / 2]])
            *centre, length, width, height, yaw = (
                shots[row["sample_token"]].sensor.boxes_to_world(box)[0].tolist()
            )
            results[row["sample_token"]].append(
                {
                    "translation": centre,
                    "size": [width, length, height],
                    "rotation": [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)],
                    "detection_name": row["class"],
                    "detection_score": score,
                }
            )
    return {"meta": {}, "results": results}


def test_first_sightings_with_centerpoint_are_those_of_the_page(tmp_path, recorded):
    folder = recorded / "nuscenes-mini"
    if not folder.is_dir():
        pytest.skip("no nuscenes-mini in shared/data")
    source = source_of(f"nuscenes:{folder}", split="mini_val")
    path = tmp_path / "results.json"
    file = folder / "detections" / "centerpoint.csv"
    path.write_text(json.dumps(official(file, source)))
    own = parameters([f"file={path}", "track_score=0.3"])
    plays = play_grid(
        source,
        source.scenes(),
        ("history", "all-camera", "care", "full"),
        (0.05, 0.1),
        range(3),
        detector="recorded",
        detector_parameters=own,
    )
    found = defaultdict(lambda: np.zeros(2))
    for scene in source.scenes():
        for row in play_scene([play for play in plays if play.scene == scene]):
            found[row["policy"], row["budget"]] += row["sighted"], row["events"]
    shares = {key: round(100 * sighted / events, 1) for key, (sighted, events) in found.items()}
    assert shares == FIRST_SIGHTINGS
