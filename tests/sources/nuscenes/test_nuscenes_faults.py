import json
import os

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.sources.nuscenes.recordings import split_scenes
from care_sim.sources.nuscenes.tables import Database
from tests.helpers.nuscenes_database import as_recorded, change, pose
from tests.helpers.nuscenes_scene import CAR, SCENE, WORLD, database, first


def dangling(field, table, value="nowhere"):
    return lambda root: change(root, table, lambda rows: rows[0].update({field: value}))


def without(table):
    return lambda root: (root / "v1.0-trainval" / f"{table}.json").unlink()


def drop(table):
    return lambda root: change(root, table, lambda rows: rows.clear())


BREAKS = {
    "no table": (without("ego_pose"), "ego_pose.json: no such file"),
    "truncated table": (
        lambda root: (root / "v1.0-trainval" / "sample_data.json").write_text('[{"token": "a", '),
        "sample_data.json: no readable JSON file",
    ),
    "no list": (
        lambda root: (root / "v1.0-trainval" / "sensor.json").write_text("{}"),
        "sensor.json: no readable JSON file .it holds no list",
    ),
    "no field": (
        lambda root: change(root, "instance", lambda rows: rows[0].pop("category_token")),
        "instance.json: row scene-0103-a lacks 'category_token'",
    ),
    "no pose": (
        drop("ego_pose"),
        f"ego_pose.json: no row with the token 'pose-{SCENE}-0-LIDAR_TOP'",
    ),
    "no instance": (
        dangling("instance_token", "sample_annotation"),
        "instance.json: no row with the token 'nowhere'",
    ),
    "no category": (
        dangling("category_token", "instance"),
        "category.json: no row with the token 'nowhere'",
    ),
    "no sample": (
        dangling("first_sample_token", "scene"),
        "sample.json: no row with the token 'nowhere'",
    ),
    "no sensor": (
        dangling("sensor_token", "calibrated_sensor"),
        "sensor.json: no row with the token 'nowhere'",
    ),
    "no calibration": (
        dangling("calibrated_sensor_token", "sample_data"),
        "calibrated_sensor.json: no row with the token 'nowhere'",
    ),
    "no visibility": (
        dangling("visibility_token", "sample_annotation"),
        "visibility.json: no row with the token",
    ),
    "odd visibility": (
        dangling("level", "visibility", "v9"),
        r"visibility.json: '4' has the unknown level 'v9'",
    ),
    "no recording": (
        lambda root: change(root, "sample_data", lambda rows: rows.pop(0)),
        f"sample_data.json: no LIDAR_TOP of the sample '{SCENE}-0'",
    ),
    "a folder for a sweep": (
        dangling("filename", "sample_data", "samples"),
        "nuscenes/samples: no such file",
    ),
    "short sweep": (
        lambda root: next(root.glob("samples/LIDAR_TOP/*")).write_bytes(b"0" * 47),
        "47 bytes are no whole number of points of 20 bytes",
    ),
    "no rotation": (
        dangling("rotation", "ego_pose", [0, 0, 0, 0]),
        f"rotation of 'pose-{SCENE}-0-LIDAR_TOP': a quat",
    ),
    "no size": (
        dangling("size", "sample_annotation", [1, 2]),
        "sample_annotation.json: 'scene-0103-0-0' has no size",
    ),
    "odd category": (
        dangling("name", "category", "vehicle.spaceship"),
        "category.json: 'category-vehicle.car': unknown category 'vehicle.spaceship'; "
        "the nearest is vehicle.ego; known: animal, ",
    ),
    "box of no sample": (
        dangling("sample_token", "sample_annotation"),
        "sample.json: no row with the token 'nowhere'",
    ),
    "two alike": (
        lambda root: change(root, "sample_annotation", lambda rows: rows.append(rows[0])),
        f"sample_annotation.json: 2 rows with the token '{SCENE}-0-0'",
    ),
    "an object twice": (
        lambda root: change(
            root, "sample_annotation", lambda rows: rows.append(rows[0] | {"token": "other"})
        ),
        f"sample_annotation.json: the sample '{SCENE}-0' holds the instance '{SCENE}-a' 2 times",
    ),
    "no first sample": (
        dangling("first_sample_token", "scene", ""),
        "sample.json: no row with the token ''",
    ),
    "other last sample": (
        dangling("last_sample_token", "scene"),
        f"sample.json: {SCENE} ends with '{SCENE}-0', and should with 'nowhere'",
    ),
    "no row": (
        lambda root: change(root, "sensor", lambda rows: rows.insert(2, 7)),
        "sensor.json: row 2 must be a map",
    ),
    "no time": (
        dangling("timestamp", "sample", "now"),
        f"row {SCENE}-0: timestamp must be a whole number, got 'now'",
    ),
    "a circle": (dangling("next", "sample", f"{SCENE}-0"), "is no later than the sample before it"),
    "no intrinsics": (
        lambda root: change(
            root, "calibrated_sensor", lambda rows: rows[1].update(camera_intrinsic=[])
        ),
        "calibrated_sensor.json: 'calibrated-CAM_FRONT' has no camera_intrinsic of 3 x 3 finite "
        "numbers",
    ),
}


def other_form(count, number=60):
    """A sweep around the car with so many values per point, none below 0 beside the place."""
    angles = np.linspace(0, 6, number)
    rows = np.full((number, count), 0.25)
    rows[:, :3] = np.stack([20 * np.cos(angles), 20 * np.sin(angles), np.sin(7 * angles)], axis=1)
    return rows.astype("<f4").tobytes()


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (other_form(4), "; it looks like 4 values per point: x, y, z and intensity .KITTI"),
        (other_form(6), "; it looks like 6 values per point: .*Waymo"),
        (other_form(4, 61), "976 bytes are no whole number .*; it looks like 4 values"),
        (np.full((3, 5), 7.5, "<f4").tobytes(), "a whole ring from 0 to 255 per point$"),
        (np.array([[900, 0, 0, 0, 0]], "<f4").tobytes(), "x, y, z within 500 m"),
    ],
)
def test_a_sweep_of_another_form_is_refused_with_what_it_looks_like(tmp_path, content, told):
    root = database(tmp_path)
    (sweep,) = root.glob("samples/LIDAR_TOP/*")
    sweep.write_bytes(content)
    with pytest.raises(InvalidInput, match=f"{sweep.name}: .*{told}"):
        first(root)


@pytest.mark.parametrize("name", BREAKS)
def test_what_is_wrong_with_a_database_is_said_in_one_line(tmp_path, name):
    breaks, message = BREAKS[name]
    root = database(tmp_path)
    if name == "odd visibility":
        change(root, "visibility", lambda rows: rows.reverse())
    breaks(root)
    with pytest.raises(InvalidInput, match=message) as caught:
        first(root)
    assert "\n" not in str(caught.value)
    assert str(root) in str(caught.value)


@pytest.mark.parametrize(
    ("field", "value", "reason"),
    [
        ("rotation", [0, 0, 0, "1"], "has no rotation of 4 finite numbers"),
        ("rotation", [1, 0, 0], "has no rotation of 4 finite numbers"),
        ("translation", [1, 2, float("nan")], "has no translation of 3 finite numbers"),
        ("size", [1, 2, float("inf")], "has no size of 3 finite numbers"),
        ("num_lidar_pts", None, "num_lidar_pts must be a whole number, got None"),
        ("visibility_token", ["4"], r"visibility_token must be text, got \['4'\]"),
        ("instance_token", 7, "instance_token must be text, got 7"),
    ],
)
def test_a_wrong_box_is_named(tmp_path, field, value, reason):
    root = database(tmp_path)
    change(root, "sample_annotation", lambda rows: rows[0].update({field: value}))
    with pytest.raises(InvalidInput, match=rf"sample_annotation.json: .*{SCENE}-0-0'?:? {reason}"):
        first(root)


@pytest.mark.parametrize(
    ("field", "value", "reason"),
    [
        ("size", [1, 0, 2], r"must lie in \[0.01, 200\], got 0"),
        ("size", [1, 2, 2**62], r"must lie in \[0.01, 200\], got 4.61169e\+18"),
        ("translation", [1, -1e308, 0], r"must lie in \[-1e\+08, 1e\+08\], got -1e\+308"),
        ("rotation", [1e308, 0, 0, 0], "a quaternion that is not of length 1"),
        ("rotation", [5e-324, 0, 0, 0], "a quaternion that is not of length 1"),
        ("rotation", [0.5**0.5, 0, 0.5**0.5, 0], "a pitch beyond 80 degrees"),
    ],
)
@pytest.mark.parametrize("table", ["sample_annotation", "ego_pose"])
def test_what_no_drive_holds_is_named(tmp_path, table, field, value, reason):
    if (table, field) == ("ego_pose", "size"):
        return
    root = database(tmp_path)
    change(root, table, lambda rows: rows[0].update({field: value}))
    with pytest.raises(
        InvalidInput, match=rf"{table}.json: {field} of '.*{SCENE}-0-[^']*':? {reason}"
    ):
        first(root)


def test_a_box_far_from_the_car_is_named(tmp_path):
    root = database(tmp_path)
    change(root, "sample_annotation", lambda rows: rows[0].update(translation=[2e4, 0, 0]))
    with pytest.raises(
        InvalidInput,
        match=f"annotation.json: '{SCENE}-0-0' lies 19993.2 m from the LiDAR, may lie 10000 m",
    ):
        first(root)


@pytest.mark.parametrize(
    ("translation", "rotation", "reason"),
    [
        (
            [0, 0, 1e3],
            [1, 0, 0, 0],
            r"translation of 'calibrated-.*' must lie in \[-100, 100\], got 1000",
        ),
        (
            [0, 0, 1],
            [1, 1, 0, 0],
            "rotation of 'calibrated-.*': a quaternion that is not of length 1",
        ),
    ],
)
@pytest.mark.parametrize("row", [0, 1])
def test_a_sensor_elsewhere_than_on_a_car_is_named(tmp_path, row, translation, rotation, reason):
    root = database(tmp_path)
    change(
        root,
        "calibrated_sensor",
        lambda rows: rows[row].update(translation=translation, rotation=rotation),
    )
    with pytest.raises(InvalidInput, match=f"calibrated_sensor.json: {reason}"):
        first(root)


def test_a_lidar_below_the_road_is_named(tmp_path):
    root = database(tmp_path)
    change(root, "calibrated_sensor", lambda rows: rows[0].update(translation=[1, 0, -0.1]))
    with pytest.raises(
        InvalidInput,
        match=r"calibrated_sensor.json: 'calibrated-LIDAR_TOP' lies below the road, at -0.1 m",
    ):
        first(root)


@pytest.mark.filterwarnings("error")
def test_a_camera_may_look_straight_down(tmp_path):
    root = database(tmp_path)
    change(
        root,
        "calibrated_sensor",
        lambda rows: rows[0].update(rotation=[0.5**0.5, 0, 0, -(0.5**0.5)]),
    )
    change(root, "calibrated_sensor", lambda rows: rows[1].update(rotation=[0, 1, 0, 0]))
    (camera, *_) = first(root).cameras
    assert camera.axes[0] == pytest.approx([0, 0, -1], abs=1e-7)


@pytest.mark.parametrize(
    ("stamps", "reason"),
    [
        (
            (0, 10**22),
            rf"timestamp of '{SCENE}-1' must be a whole number >= 0 and <= 4611686018427387, got "
            rf"10000",
        ),
        ((-5, 0), f"timestamp of '{SCENE}-0' must be a whole number >= 0"),
        ((0, 10**12), r"its times span 1e\+06 s, and a drive may last 86400 s"),
    ],
)
def test_times_are_those_of_a_drive(tmp_path, stamps, reason):
    root = database(tmp_path, [([CAR], pose(), as_recorded(WORLD))] * 2)
    change(
        root,
        "sample",
        lambda rows: [row.update(timestamp=t) for row, t in zip(rows, stamps, strict=True)],
    )
    with pytest.raises(InvalidInput, match=f"sample.json: {reason}"):
        first(root)


@pytest.mark.parametrize(
    "intrinsic",
    [
        [[1, 2], [3]],
        [["a"] * 3] * 3,
        [[float("nan")] * 3] * 3,
        [[0.0] * 3] * 3,
        [[5e-324, 0, 800], [0, 1e3, 450], [0, 0, 1]],
        [[1e308, 0, 800], [0, 1e3, 450], [0, 0, 1]],
        [[1e3, 0, 1e300], [0, 1e3, 450], [0, 0, 1]],
        [[1e3, 0, 800], [0, 1e3, -1], [0, 0, 1]],
    ],
    ids=str,
)
def test_wrong_intrinsics_are_named(tmp_path, intrinsic):
    root = database(tmp_path)
    change(root, "calibrated_sensor", lambda rows: rows[1].update(camera_intrinsic=intrinsic))
    with pytest.raises(
        InvalidInput, match=r"calibrated_sensor.json: 'calibrated-CAM_FRONT' has .*camera_intrinsic"
    ):
        first(root)


def test_a_place_that_is_not_finite_is_named(tmp_path):
    root = database(tmp_path)
    (sweep,) = root.glob("samples/LIDAR_TOP/*")
    points = np.fromfile(sweep, "<f4").reshape(-1, 5)
    points[2, 1] = np.nan
    points.tofile(sweep)
    with pytest.raises(InvalidInput, match=r"pcd.bin: point 2 has a place that is not finite"):
        first(root)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("column", range(5))
def test_a_nan_that_signals_is_a_nan(tmp_path, column):
    """A cast of one warns; intensity is not read."""
    root = database(tmp_path)
    (sweep,) = root.glob("samples/LIDAR_TOP/*")
    points = np.fromfile(sweep, "<u4").reshape(-1, 5)
    points[2, column] = 0x7F800001
    points.tofile(sweep)
    if column == 3:
        assert len(first(root).shots) == 1
        return
    told = "a whole ring" if column == 4 else "point 2 has a place that is not finite"
    with pytest.raises(InvalidInput, match=f"pcd.bin: .*{told}"):
        first(root)


def test_a_sweep_of_gigabytes_is_named(tmp_path):
    root = database(tmp_path)
    (sweep,) = root.glob("samples/LIDAR_TOP/*")
    os.truncate(sweep, 20 * 2**30)
    with pytest.raises(
        InvalidInput, match=r"pcd.bin: 21474836480 bytes, a sweep may hold 268435456"
    ):
        first(root)


def test_samples_run_forward_in_time(tmp_path):
    root = database(tmp_path, [([CAR], pose(), as_recorded(WORLD))] * 2)
    change(root, "sample", lambda rows: rows[1].update(timestamp=rows[0]["timestamp"]))
    with pytest.raises(
        InvalidInput, match=rf"sample.json: '{SCENE}-1' is no later than the sample before it"
    ):
        first(root)


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
        (None, "must map names of splits to lists of names of scenes"),
        ({"mine": SCENE}, "the split 'mine' must be a list of names of scenes"),
        ({"mine": [["a"]]}, "the split 'mine' must be a list of names of scenes"),
        ({"mine": [SCENE, SCENE]}, "the split 'mine' names a scene twice"),
    ],
)
def test_a_wrong_file_of_splits_is_named(tmp_path, content, message):
    root = database(tmp_path)
    (root / "v1.0-trainval" / "splits.json").write_text(json.dumps(content))
    with pytest.raises(InvalidInput, match=f"splits.json: {message}"):
        split_scenes(Database(root), "mine")
