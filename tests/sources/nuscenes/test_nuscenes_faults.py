"""A fault of a database is reported in one line that names the file and the token."""

import json
import os

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.sources.nuscenes.recordings import split_scenes
from care_sim.sources.nuscenes.tables import Database
from tests.helpers.nuscenes_database import add_recorded_losses, change, pose
from tests.helpers.nuscenes_scene import CAR, SCENE, WORLD, database, first

NOWHERE = "no row with the token 'nowhere'"
LIDAR, CAMERA, INTRINSIC = "calibrated-LIDAR_TOP", "calibrated-CAM_FRONT", "camera_intrinsic"


def assert_named(root, message):
    with pytest.raises(InvalidInput, match=message) as caught:
        first(root)
    assert "\n" not in str(caught.value)
    assert str(root) in str(caught.value)


VALUES = [
    ("sample_annotation", "instance_token", "nowhere", f"instance.json: {NOWHERE}"),
    ("sample_annotation", "visibility_token", "nowhere", f"visibility.json: {NOWHERE}"),
    ("sample_annotation", "visibility_token", ["4"], r"visibility_token must be text, got \['4'\]"),
    ("sample_annotation", "sample_token", "nowhere", f"sample.json: {NOWHERE}"),
    ("sample_annotation", "num_lidar_pts", None, "num_lidar_pts must be a whole number, got None"),
    ("sample_annotation", "size", [1, 2], "annotation.json: 'scene-0103-0-0' has no size"),
    ("sample_annotation", "size", [1, 2, float("inf")], "has no size of 3 finite numbers"),
    ("sample_annotation", "size", [1, 0, 2], r"must lie in \[0.01, 200\], got 0"),
    ("sample_annotation", "rotation", [1, 0, 0], "has no rotation of 4 finite numbers"),
    ("sample_annotation", "rotation", [0, 0, 0, "1"], "has no rotation of 4 finite numbers"),
    ("sample_annotation", "rotation", [1e308, 0, 0, 0], "a quaternion that is not of length 1"),
    ("sample_annotation", "translation", [2e4, 0, 0], "lies 19993.2 m from the LiDAR, may lie"),
    ("instance", "category_token", "nowhere", f"category.json: {NOWHERE}"),
    ("category", "name", "vehicle.ship", "category.json: .*: unknown category 'vehicle.ship'"),
    ("scene", "first_sample_token", "nowhere", f"sample.json: {NOWHERE}"),
    ("scene", "first_sample_token", "", "sample.json: no row with the token ''"),
    ("scene", "last_sample_token", "nowhere", f"{SCENE} ends with '{SCENE}-0', and should with"),
    ("sample", "timestamp", "now", f"row {SCENE}-0: timestamp must be a whole number, got 'now'"),
    ("sample", "timestamp", -5, f"timestamp of '{SCENE}-0' must be a whole number >= 0"),
    ("sample", "next", f"{SCENE}-0", "is no later than the sample before it"),
    ("sample_data", "calibrated_sensor_token", "nowhere", f"calibrated_sensor.json: {NOWHERE}"),
    ("sample_data", "filename", "samples", "nuscenes/samples: no such file"),
    ("calibrated_sensor", "sensor_token", "nowhere", f"sensor.json: {NOWHERE}"),
    ("calibrated_sensor", "translation", [0, 0, 1e3], rf"of '{LIDAR}' must lie in \[-100, 100\]"),
    ("calibrated_sensor", "translation", [1, 0, -0.1], f"'{LIDAR}' lies below the road, at -0.1 m"),
    ("calibrated_sensor", "rotation", [1, 1, 0, 0], f"'{LIDAR}': a quaternion that is not of"),
    ("ego_pose", "rotation", [0, 0, 0, 0], f"rotation of 'pose-{SCENE}-0-LIDAR_TOP': a quat"),
    ("ego_pose", "rotation", [0.5**0.5, 0, 0.5**0.5, 0], "a pitch beyond 80 degrees"),
    ("ego_pose", "translation", [1, -1e308, 0], r"must lie in \[-1e\+08, 1e\+08\], got -1e\+308"),
]


@pytest.mark.parametrize(("table", "field", "value", "message"), VALUES)
def test_a_wrong_value_is_named(tmp_path, table, field, value, message):
    root = database(tmp_path)
    change(root, table, lambda rows: rows[0].update({field: value}))
    assert_named(root, message)


ROWS = [
    ("sensor", lambda rows: rows.insert(2, 7), "row 2 must be a map"),
    ("instance", lambda rows: rows[0].pop("category_token"), "row scene-0103-a lacks 'category_t"),
    ("ego_pose", lambda rows: rows.clear(), f"no row .* 'pose-{SCENE}-0-LIDAR_TOP'"),
    ("sample_data", lambda rows: rows.pop(0), f"no LIDAR_TOP of the sample '{SCENE}-0'"),
    ("sample_annotation", lambda rows: rows.append(rows[0]), f"2 rows with .* '{SCENE}-0-0'"),
    (
        "sample_annotation",
        lambda rows: rows.append(rows[0] | {"token": "other"}),
        f"the sample '{SCENE}-0' holds the instance '{SCENE}-a' 2 times",
    ),
]


@pytest.mark.parametrize(("table", "edit", "message"), ROWS)
def test_a_wrong_row_is_named(tmp_path, table, edit, message):
    root = database(tmp_path)
    change(root, table, edit)
    assert_named(root, f"{table}.json: .*{message}")


def test_an_unknown_level_of_visibility_is_named(tmp_path):
    root = database(tmp_path)
    change(root, "visibility", lambda rows: [row.update(level="v9") for row in rows])
    assert_named(root, "visibility.json: '4' has the unknown level 'v9'")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no such file"),
        ('[{"token": "a", ', "no readable JSON file"),
        ("{}", "no readable JSON file .it holds no list"),
    ],
)
def test_a_table_that_cannot_be_read_is_named(tmp_path, content, message):
    root = database(tmp_path)
    path = root / "v1.0-trainval" / "ego_pose.json"
    path.unlink() if content is None else path.write_text(content)
    assert_named(root, f"ego_pose.json: {message}")


def sweep_of(*row, count=3):
    return np.tile(np.array(row, "<f4"), (count, 1)).tobytes()


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"0" * 47, "47 bytes are no whole number of points of 20 bytes"),
        (sweep_of(7.5, 7.5, 7.5, 7.5, 7.5), "a whole ring from 0 to 255 per point"),
        (sweep_of(900, 0, 0, 0, 0), "x, y, z within 500 m"),
        (sweep_of(1, np.nan, 0, 0, 0), "point 0 has a place that is not finite"),
    ],
)
def test_a_sweep_of_another_form_is_named(tmp_path, content, told):
    root = database(tmp_path)
    (sweep,) = root.glob("samples/LIDAR_TOP/*")
    sweep.write_bytes(content)
    assert_named(root, f"{sweep.name}: .*{told}")
    os.truncate(sweep, 20 * 2**30)
    assert_named(root, "21474836480 bytes, a sweep may hold 268435456")


@pytest.mark.filterwarnings("error")
def test_a_camera_may_look_straight_down(tmp_path):
    root = database(tmp_path)
    down = [0.5**0.5, 0, 0, -(0.5**0.5)], [0, 1, 0, 0]

    def turn(rows):
        for row, rotation in zip(rows, down, strict=False):
            row["rotation"] = rotation

    change(root, "calibrated_sensor", turn)
    (camera, *_) = first(root).cameras
    assert camera.axes[0] == pytest.approx([0, 0, -1], abs=1e-7)


@pytest.mark.parametrize(
    ("stamp", "reason"),
    [
        (10**22, rf"timestamp of '{SCENE}-1' must be a whole number >= 0 and <= 4611686018427387"),
        (10**15, r"its times span 1e\+\d+ s, and a drive may last 86400 s"),
    ],
)
def test_times_are_those_of_a_drive(tmp_path, stamp, reason):
    root = database(tmp_path, [([CAR], pose(), add_recorded_losses(WORLD))] * 2)
    change(root, "sample", lambda rows: rows[0].update(timestamp=0))
    change(root, "sample", lambda rows: rows[1].update(timestamp=stamp))
    assert_named(root, f"sample.json: {reason}")


@pytest.mark.parametrize(
    "intrinsic",
    [
        [],
        [["a"] * 3] * 3,
        [[0.0] * 3] * 3,
        [[1e308, 0, 800], [0, 1e3, 450], [0, 0, 1]],
        [[1e3, 0, 800], [0, 1e3, -1], [0, 0, 1]],
    ],
    ids=str,
)
def test_wrong_intrinsics_are_named(tmp_path, intrinsic):
    root = database(tmp_path)
    change(root, "calibrated_sensor", lambda rows: rows[1].update({INTRINSIC: intrinsic}))
    assert_named(root, f"calibrated_sensor.json: '{CAMERA}' has .*{INTRINSIC}")


def test_the_version_must_be_clear(tmp_path):
    with pytest.raises(InvalidInput, match=r"must hold one folder v1\.0-\*, .* found: none"):
        Database(tmp_path)
    database(tmp_path)
    (tmp_path / "nuscenes" / "v1.0-mini").mkdir()
    with pytest.raises(InvalidInput, match=r"found: v1\.0-mini, v1\.0-trainval"):
        Database(tmp_path / "nuscenes")
    assert len(split_scenes(Database(tmp_path / "nuscenes", "v1.0-trainval"))) == 1


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ([SCENE], "must map names of splits to lists of names of scenes"),
        ({"mine": [["a"]]}, "the split 'mine' must be a list of names of scenes"),
        ({"mine": [SCENE, SCENE]}, "the split 'mine' names a scene twice"),
    ],
)
def test_a_wrong_file_of_splits_is_named(tmp_path, content, message):
    root = database(tmp_path)
    (root / "v1.0-trainval" / "splits.json").write_text(json.dumps(content))
    with pytest.raises(InvalidInput, match=f"splits.json: {message}"):
        split_scenes(Database(root), "mine")
