"""Columns by sample hold what the JSON tables hold."""

import json
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.sources.nuscenes.tables import Database
from tests.helpers.nuscenes_database import change
from tests.helpers.nuscenes_scene import SCENE, database, first

SAMPLES = ["one", "two", "", "drei ü"]
NUMBERS = st.floats(allow_nan=False, allow_infinity=False) | st.integers(-(2**60), 2**60)
NAMES = st.text(st.characters(exclude_categories=["Cs"]), max_size=5)


def rows_of(fields, most=12):
    """Rows whose tokens all differ."""
    rows = st.fixed_dictionaries({"token": NAMES, **fields})
    return st.lists(rows, max_size=most, unique_by=lambda row: row["token"])


BOXES = rows_of(
    {
        "sample_token": st.sampled_from(SAMPLES),
        "visibility_token": st.sampled_from(["", "4"]),
        "translation": st.lists(NUMBERS, min_size=3, max_size=3),
        "size": st.lists(NUMBERS, min_size=3, max_size=3),
        "rotation": st.lists(NUMBERS, min_size=4, max_size=4),
        "num_lidar_pts": st.integers(0, 2),
        "num_radar_pts": st.integers(0, 2),
        "prev": NAMES,
    }
)
POSES = rows_of(
    {
        "translation": st.lists(NUMBERS, min_size=3, max_size=3),
        "rotation": st.lists(NUMBERS, min_size=4, max_size=4),
    }
)
RECORDINGS = rows_of(
    {
        "sample_token": st.sampled_from([*SAMPLES, "of no sample"]),
        "ego_pose_token": NAMES,
        "calibrated_sensor_token": st.sampled_from(["lidar", "camera"]),
        "filename": NAMES,
        "is_key_frame": st.booleans(),
        "timestamp": st.integers(0, 2**62),
    }
)


def written(folder, **tables):
    sensors = {"lidar": "LIDAR_TOP", "camera": "CAM_FRONT"}
    empty = {"translation": [], "rotation": [], "camera_intrinsic": []}
    rows = {
        "sample": [{"token": t, "timestamp": 0, "next": ""} for t in SAMPLES],
        "sensor": [{"token": t, "channel": name} for t, name in sensors.items()],
        "calibrated_sensor": [{"token": t, "sensor_token": t, **empty} for t in sensors],
        **tables,
    }
    (folder / "v1.0-x").mkdir()
    for name, table in rows.items():
        (folder / "v1.0-x" / f"{name}.json").write_text(json.dumps(table))
    return folder


@given(BOXES)
def test_boxes_come_as_their_table_holds_them(boxes):
    boxes = [row | {"instance_token": row["token"]} for row in boxes]
    with tempfile.TemporaryDirectory() as folder:
        root = written(Path(folder), sample_annotation=boxes)
        for _ in ("made", "mapped"):
            tables = Database(root)
            for sample in SAMPLES:
                wanted = [
                    {name: row[name] for name in ("token", "instance_token", "visibility_token")}
                    | {
                        name: [*map(float, row[name])]
                        for name in ("translation", "size", "rotation")
                    }
                    | {"has_points": row["num_lidar_pts"] + row["num_radar_pts"] > 0}
                    for row in boxes
                    if row["sample_token"] == sample
                ]
                assert tables.annotations(sample) == wanted


@given(RECORDINGS, POSES, st.randoms(use_true_random=False))
def test_recordings_come_with_the_poses_that_their_tables_hold(recordings, poses, chance):
    places = {row["token"]: row for row in poses}
    for row in recordings:
        if places and chance.random() < 0.7:
            row["ego_pose_token"] = chance.choice([*places])
    with tempfile.TemporaryDirectory() as folder:
        root = written(Path(folder), sample_data=recordings, ego_pose=poses)
        for _ in ("made", "mapped"):
            tables = Database(root)
            for sample in SAMPLES:
                wanted = [
                    {name: value for name, value in row.items() if name != "sample_token"}
                    | {"pose": placed(row, places)}
                    for row in recordings
                    if row["sample_token"] == sample
                    and (row["is_key_frame"] or row["calibrated_sensor_token"] == "lidar")
                ]
                assert tables.recordings(sample) == wanted


def placed(row, places):
    pose = places.get(row["ego_pose_token"])
    if pose is None:
        return None
    return {name: [*map(float, pose[name])] for name in ("translation", "rotation")}


def test_odd_numbers_are_refused_where_they_are_needed_alone(tmp_path):
    root = database(tmp_path)
    odd = {"token": "odd", "translation": [1, "2", 3], "rotation": [1, 0, 0]}
    change(root, "ego_pose", lambda rows: rows.append(rows[0] | odd))
    between = {"token": "between", "is_key_frame": False, "ego_pose_token": "odd"}
    change(root, "sample_data", lambda rows: rows.append(rows[0] | between))
    assert len(first(root).shots) == 1
    (row,) = (row for row in Database(root).recordings(f"{SCENE}-0") if row["token"] == "between")
    pose = Database(root).pose_of(row)
    with pytest.raises(InvalidInput, match="'odd' has no translation of 3 finite numbers"):
        Database(root).numbers("ego_pose", pose, "translation", 3)


@pytest.mark.parametrize(
    ("table", "edit"),
    [
        ("sample_data", {"timestamp": 10**22}),
        ("sample_data", {"filename": "\ud800"}),
        ("sample_annotation", {"instance_token": "\ud800"}),
        ("sample", {"token": "\ud800"}),
    ],
)
def test_what_no_column_holds_is_named(tmp_path, table, edit):
    root = database(tmp_path)
    change(root, table, lambda rows: rows.append(rows[0] | edit))
    with pytest.raises(InvalidInput, match=f"{table}.json: half a character or too large a number"):
        first(root)
