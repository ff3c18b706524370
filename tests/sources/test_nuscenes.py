import json

import numpy as np
import pytest
from nuscenes_database import LIDAR, SENSORS, annotated, change, pose, write
from scipy.spatial.transform import Rotation

from care_sim.errors import InvalidInput
from care_sim.film import NOBODY, Annotations
from care_sim.frames import Frame
from care_sim.grid import AngularGrid
from care_sim.sources.nuscenes.categories import CATEGORIES, DETECTION_NAMES
from care_sim.sources.nuscenes.detections import DetectionFile
from care_sim.sources.nuscenes.films import film
from care_sim.sources.nuscenes.splits import VAL, scenes
from care_sim.sources.nuscenes.sweeps import owners, read_points
from care_sim.sources.nuscenes.tables import Database
from care_sim.types import CLASSES

SCENE = "scene-0103"
UPRIGHT = Frame(0.0, 0.0, 1.8, 0.0)
CAR = annotated("vehicle.car", (20.0, 2.0, 0.85), instance="a")
WORLD = np.array([[18.0, 2.0, 0.8], [18.1, 1.9, 0.5], [18.0, 2.0, 0.3], [30.0, -5.0, 0.1], [0.95, 0.2, 1.4]])
"""Points in the world, the car at its origin: three on the rear of CAR, one on the road, one on our own roof."""


def as_recorded(points):
    """Rows of a sweep file for points (n, 3) in the car's frame."""
    w, x, y, z = LIDAR[1]
    own = Rotation.from_quat([x, y, z, w]).inv().apply(np.asarray(points) - LIDAR[0])
    return np.column_stack([own, np.full(len(own), 7.0), np.zeros(len(own))])


def database(folder, samples=None):
    samples = samples or [([CAR], pose(), as_recorded(WORLD))]
    return write(folder / "nuscenes", {SCENE: samples})


def first(root, **options):
    tables = Database(root)
    (scene,) = scenes(tables)
    return film(tables, scene, **options)


def test_a_scene_becomes_a_film(tmp_path):
    movie = first(database(tmp_path))
    (shot,) = movie.shots
    assert (movie.name, movie.keyframe_s, shot.token) == (SCENE, 0.5, f"{SCENE}-0")
    assert movie.sensor_height_m == pytest.approx(1.84023)
    assert len(movie.cameras) == 6
    assert shot.sensor.yaw == pytest.approx(0.0, abs=0.01)
    assert CLASSES[shot.annotations.classes[0]] == "car"
    assert shot.annotations.boxes[0, 3:6] == pytest.approx([4.6, 1.9, 1.7]), "length first"
    world = shot.sensor.boxes_to_world(shot.annotations.boxes)[0]
    assert world[:3] == pytest.approx([20.0, 2.0, 0.85])


def test_the_cloud_holds_the_recorded_points_in_their_cells_on_their_objects(tmp_path):
    (shot,) = first(database(tmp_path)).shots
    cloud = shot.cloud
    assert len(cloud) == 4, "the point on our own roof is left out"
    assert np.array_equal(cloud.cells, AngularGrid().cells_of(cloud.points))
    assert np.all(np.diff(cloud.cells) >= 0)
    assert sorted(cloud.objects.tolist()) == [NOBODY, 0, 0, 0]
    world = shot.sensor.origin + shot.sensor.vectors_to_world(cloud.points)
    assert sorted(map(tuple, world.round(3).tolist())) == sorted(map(tuple, WORLD[:4].tolist()))
    assert len(cloud.within(cloud.cells[:1])) == np.sum(cloud.cells == cloud.cells[0])


def test_a_point_belongs_to_the_box_it_lies_in_as_the_box_is_turned():
    boxes = np.array([[10.0, 0.0, 0.0, 8.0, 1.0, 2.0, np.pi / 4]])
    on_the_diagonal, across_it = [12.0, 2.0, 0.0], [12.0, -2.0, 0.0]
    annotations = Annotations(np.array([5]), np.array([0]), boxes)
    assert owners(np.array([on_the_diagonal, across_it]), annotations, UPRIGHT).tolist() == [5, NOBODY]


def test_boxes_stand_upright_however_the_sensor_leans():
    """The sensor's front is 3 degrees down: 6 m off a bus's middle that makes 0.3 m."""
    sensor = Frame(3.0, 1.0, 1.8, 0.4, pitch=np.deg2rad(3.0))
    bus = np.array([[20.0, 2.0, 1.7, 12.0, 2.9, 3.4, 0.4]])
    ends = bus[0, :3] + [[5.9 * np.cos(0.4), 5.9 * np.sin(0.4), h] for h in (1.6, -1.6, 1.8, -1.8)]
    annotations = Annotations(np.array([7]), np.array([2]), sensor.boxes_to_local(bus))
    found = owners(sensor.vectors_to_local(ends - sensor.origin), annotations, sensor)
    assert found.tolist() == [7, 7, NOBODY, NOBODY]


def test_a_point_in_two_boxes_belongs_to_the_smaller():
    boxes = np.array([[10.0, 0, 0, 2, 2, 2, 0], [10.0, 0, 0, 9, 9, 9, 0], [10.0, 0, 0, 4, 4, 4, 0]])
    annotations = Annotations(np.array([3, 4, 5]), np.zeros(3, np.int64), boxes)
    points = np.array([[10.5, 0.0, 0.0], [11.5, 0.0, 0.0], [13.0, 0.0, 0.0]])
    assert owners(points, annotations, UPRIGHT).tolist() == [3, 5, 4]


def test_recordings_between_keyframes_are_no_keyframes(tmp_path):
    root = database(tmp_path)
    between = {"token": "between", "is_key_frame": False, "filename": "sweeps/gone.pcd.bin"}
    change(root, "sample_data", lambda rows: rows.append(rows[0] | between))
    change(root, "ego_pose", lambda rows: rows.append(rows[0] | {"token": "between"}))
    assert len(first(root).shots[0].cloud) == 4
    tables = Database(root)
    assert "between" not in {*tables.rows("sample_data"), *tables.rows("ego_pose")}, "they would fill the memory"


def test_a_keyframe_without_annotations_plays(tmp_path):
    (shot,) = first(database(tmp_path, [([], pose(), as_recorded(WORLD))])).shots
    assert (len(shot.annotations), len(shot.sights.objects), len(shot.cloud)) == (0, 0, 4)


def test_the_car_turns_and_drives_and_the_object_stays(tmp_path):
    far = annotated("vehicle.car", (20.0, 2.0, 0.85), instance="a", yaw=0.3)
    samples = [([far], pose(4.0 * n, 0.5 * n, 0.1 * n), as_recorded(WORLD)) for n in range(4)]
    shots = first(database(tmp_path, samples)).shots
    for shot in shots:
        world = shot.sensor.boxes_to_world(shot.annotations.boxes)[0]
        assert world[:3] == pytest.approx([20.0, 2.0, 0.85])
        assert world[6] == pytest.approx(0.3, abs=1e-3)
    assert [shot.time_s for shot in shots] == pytest.approx([0, 0.5, 1, 1.5])
    assert shots[1].ego.yaw_rate == pytest.approx(0.2)
    assert shots[1].ego.speed == pytest.approx(8 * np.cos(0.1) + 1 * np.sin(0.1))


def test_boxes_come_from_visibility_where_no_detector_was_run(tmp_path):
    near = (12.0, 0.0, 0.9)
    size = (0.7, 0.7, 1.8)
    boxes = [
        annotated("human.pedestrian.adult", (near[0], y, near[2]), size, instance=name, visible=level)
        for name, y, level in [("a", 3.0, "4"), ("b", 1.0, "2"), ("c", -1.0, "1"), ("d", -3.0, "")]
    ]
    (shot,) = first(database(tmp_path, [(boxes, pose(), as_recorded(WORLD))])).shots
    assert shot.annotations.objects.tolist() == [0, 1, 2, 3]
    assert shot.sights.objects.tolist() == [0, 1, 3]
    surest = shot.sights.detections.confidences
    assert surest[1] < surest[0] < surest[2]
    assert set(shot.sights.detections.cameras.tolist()) == {0}


def test_an_object_too_small_for_a_picture_has_no_box(tmp_path):
    boxes = [annotated("human.pedestrian.adult", (d, 0.0, 0.9), (0.7, 0.7, 1.8), instance=f"{d}") for d in (20, 130)]
    (shot,) = first(database(tmp_path, [(boxes, pose(), as_recorded(WORLD))])).shots
    assert len(shot.annotations) == 2
    assert len(shot.sights.objects) == 1


@pytest.mark.parametrize("channel", [name for name in SENSORS if name.startswith("CAM")])
def test_cameras_see_what_the_recorded_calibration_projects(tmp_path, channel):
    """Mount, roll and principal point: pixels of the recorded picture come back to a tenth of a pixel."""
    movie = first(database(tmp_path))
    camera = movie.cameras[list(SENSORS)[1:].index(channel)]
    translation, (w, x, y, z), (focal, u, v) = SENSORS[channel]
    pixels = np.array([[80.0, 100.0], [800.0, 450.0], [1500.0, 850.0]])
    rays = np.column_stack([(pixels - (u, v)) / focal, np.ones(3)])
    points = np.add(translation, Rotation.from_quat([x, y, z, w]).apply(rays) * 30)
    sensor = movie.shots[0].sensor
    shown, depth = camera.project(sensor.vectors_to_local(points - sensor.origin))
    assert np.all(depth > 0)
    assert shown - (np.array([800.0, 450.0]) - (u, v)) == pytest.approx(pixels, abs=0.1)


def picture(channel):
    return f"{SCENE}-0-{channel}"


def whole_box(root):
    """The projected box of CAR in the front picture, in recorded pixels, and its film."""
    shot = first(root).shots[0]
    _, _, (_, u, v) = SENSORS["CAM_FRONT"]
    shift = np.tile(np.array([800.0, 450.0]) - (u, v), 2)
    return (shot.sights.detections.boxes[0] - shift).tolist(), shot


def forms(box):
    left, top, right, bottom = box
    token, file = picture("CAM_FRONT"), f"samples/CAM_FRONT/{SCENE}-0.jpg"
    coco = {"bbox": [left, top, right - left, bottom - top], "category_id": 3, "score": 0.6}
    own = {"bbox_corners": box, "category_name": "vehicle.car", "score": 0.6}
    named = {"bbox_corners": box, "detection_name": "car", "detection_score": 0.6}
    return {
        "rows": [own | {"sample_data_token": token}],
        "results": {"meta": {}, "results": {token: [named]}},
        "coco": [coco | {"image_id": token}, coco | {"image_id": token, "category_id": 4}],
        "coco by file": [coco | {"image_id": file}],
    }  # fmt: skip


@pytest.mark.parametrize("form", ["rows", "results", "coco", "coco by file"])
def test_detections_come_from_a_file_in_either_form(tmp_path, form):
    root = database(tmp_path)
    box, shot = whole_box(root)
    path = tmp_path / "found.json"
    path.write_text(json.dumps(forms(box)[form]))
    (detected,) = first(root, detections=DetectionFile(path)).shots
    found = detected.sights.detections
    assert found.confidences.tolist() == [0.6]
    assert found.boxes[0] == pytest.approx(shot.sights.detections.boxes[0])
    assert detected.sights.objects.tolist() == [0]


def test_a_detection_elsewhere_or_of_another_class_lies_on_nobody(tmp_path):
    root = database(tmp_path)
    (left, top, right, bottom), _ = whole_box(root)
    token = picture("CAM_FRONT")
    beside, here = [left + 300, top, right + 300, bottom], [left, top, right, bottom]
    rows = [
        {"sample_data_token": token, "bbox_corners": box, "category_name": name, "score": 1}
        for box, name in [(beside, "car"), (here, "truck")]
    ]
    path = tmp_path / "found.json"
    path.write_text(json.dumps(rows))
    (shot,) = first(root, detections=DetectionFile(path)).shots
    assert shot.sights.objects.tolist() == [NOBODY, NOBODY]


COCO = {"image_id": "t", "bbox": [0, 0, 5, 5], "category_id": 3, "score": 1}
OWN = {"sample_data_token": "t", "bbox_corners": [0, 0, 5, 5], "category_name": "car", "score": 1}


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ({"sample_data_token": "t"}, "it lacks 'bbox_corners'"),
        (COCO | {"bbox": [0, 0, 1]}, r"no box of four numbers: \[0, 0, 1\]"),
        (COCO | {"bbox": [0, 0, -5, 5]}, "a box without width or height"),
        (COCO | {"bbox": "0055"}, "no box of four numbers: '0055'"),
        (COCO | {"category_id": 0}, "category_id must be a whole number >= 1, got 0"),
        (COCO | {"category_id": 91}, "category_id must be at most 90, got 91"),
        (OWN | {"bbox_corners": [0, 0, 5, float("nan")]}, "no box of four numbers"),
        (OWN | {"category_name": "vehicle.carr"}, "unknown category 'vehicle.carr'; known: animal, "),
        (OWN | {"score": 87}, r"score must lie in \[0, 1\], got 87"),
        (OWN | {"score": "0.5"}, r"score must lie in \[0, 1\], got '0.5'"),
        (OWN | {"sample_data_token": None}, "no token of a picture: None"),
        (3, "no map of fields: 3"),
    ],
)
def test_a_detection_that_cannot_be_read_is_named(tmp_path, row, reason):
    path = tmp_path / "found.json"
    path.write_text(json.dumps([OWN, row]))
    with pytest.raises(InvalidInput, match=rf"found.json: detection 1 cannot be read \({reason}"):
        DetectionFile(path)


@pytest.mark.parametrize("content", [{"annotations": 3}, {"results": 3}, {"results": {"t": 3}}, None, "x"])
def test_a_file_without_detections_is_named(tmp_path, content):
    path = tmp_path / "found.json"
    path.write_text(json.dumps(content))
    with pytest.raises(InvalidInput, match=r"found.json: must hold a list of detections, or a map `results`"):
        DetectionFile(path)


def test_a_detection_on_no_picture_of_the_database_is_named(tmp_path):
    path = tmp_path / "found.json"
    path.write_text(json.dumps([OWN | {"sample_data_token": "nowhere"}]))
    with pytest.raises(
        InvalidInput, match=r"found.json: a detection on 'nowhere', which is no keyframe of .*sample_data.json"
    ):
        first(database(tmp_path), detections=DetectionFile(path))


def test_every_category_of_the_taxonomy_has_its_place():
    assert len(CATEGORIES) == 23 + 9, "the 23 of the annotations, and 9 more of the lidarseg extension"
    assert {*CATEGORIES.values(), *DETECTION_NAMES.values()} == {*CLASSES, None}
    assert len(DETECTION_NAMES) == 10


def test_what_lies_outside_the_classes_or_holds_no_point_is_left_out(tmp_path):
    boxes = [CAR, annotated("vehicle.trailer", (30, 0, 2)), annotated("vehicle.bicycle", (9, 3, 0.6), points=0)]
    (shot,) = first(database(tmp_path, [(boxes, pose(), as_recorded(WORLD))])).shots
    assert len(shot.annotations) == 1


def test_the_validation_split_holds_the_150_scenes_of_the_devkit():
    assert len(VAL) == len(set(VAL)) == 150
    assert {VAL[0], VAL[-1], "scene-0103", "scene-0916"} <= set(VAL)
    assert {"scene-0061", "scene-0553"} - set(VAL) == {"scene-0061"}, "train, and val"
    assert {"scene-0037", "scene-0628", "scene-0918", "scene-0970", "scene-1074"}.isdisjoint(VAL)


def test_splits_choose_scenes(tmp_path):
    sample = [([CAR], pose(), as_recorded(WORLD))]
    root = write(tmp_path, {"scene-0061": sample, "scene-0103": sample, "scene-0916": sample})
    tables = Database(root)
    assert [row["name"] for row in scenes(tables)] == ["scene-0103", "scene-0916"]
    assert len(scenes(tables, "all")) == 3
    (root / "v1.0-trainval" / "splits.json").write_text(json.dumps({"mine": ["scene-0061"], "gone": ["scene-9"]}))
    assert [row["name"] for row in scenes(tables, "mine")] == ["scene-0061"]
    with pytest.raises(InvalidInput, match=r"splits.json: the split 'gone' names 'scene-9'"):
        scenes(tables, "gone")
    with pytest.raises(InvalidInput, match="unknown split 'x'; known: all, gone, mine, val"):
        scenes(tables, "x")


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
        scenes(Database(root), "mine")


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
        lambda root: (root / "v1.0-trainval" / "sensor.json").write_text("{}"), "sensor.json: must hold a list"
    ),
    "no field": (
        lambda root: change(root, "instance", lambda rows: rows[0].pop("category_token")),
        "instance.json: row scene-0103-a lacks 'category_token'",
    ),
    "no pose": (drop("ego_pose"), f"ego_pose.json: no row with the token 'pose-{SCENE}-0-LIDAR_TOP'"),
    "no instance": (dangling("instance_token", "sample_annotation"), "instance.json: no row with the token 'nowhere'"),
    "no category": (dangling("category_token", "instance"), "category.json: no row with the token 'nowhere'"),
    "no sample": (dangling("first_sample_token", "scene"), "sample.json: no row with the token 'nowhere'"),
    "no sensor": (dangling("sensor_token", "calibrated_sensor"), "sensor.json: no row with the token 'nowhere'"),
    "no calibration": (
        dangling("calibrated_sensor_token", "sample_data"), "calibrated_sensor.json: no row with the token 'nowhere'"
    ),
    "no visibility": (dangling("visibility_token", "sample_annotation"), "visibility.json: no row with the token"),
    "odd visibility": (dangling("level", "visibility", "v9"), r"visibility.json: '4' has the unknown level 'v9'"),
    "no recording": (
        lambda root: change(root, "sample_data", lambda rows: rows.pop(0)),
        f"sample_data.json: no LIDAR_TOP of the sample '{SCENE}-0'",
    ),
    "no sweep": (dangling("filename", "sample_data", "samples/gone.bin"), "samples/gone.bin: no such file"),
    "short sweep": (
        lambda root: next(root.glob("samples/LIDAR_TOP/*")).write_bytes(b"0" * 47),
        "47 bytes are no whole number of points of 20 bytes",
    ),
    "no rotation": (
        dangling("rotation", "ego_pose", [0, 0, 0, 0]), f"'pose-{SCENE}-0-LIDAR_TOP' has a rotation of length"
    ),
    "no size": (dangling("size", "sample_annotation", [1, 2]), "sample_annotation.json: 'scene-0103-0-0' has no size"),
    "odd category": (
        dangling("name", "category", "vehicle.spaceship"),
        "category.json: 'category-vehicle.car': unknown category 'vehicle.spaceship'; known: animal, ",
    ),
    "box of no sample": (dangling("sample_token", "sample_annotation"), "sample.json: no row with the token 'nowhere'"),
    "two alike": (
        lambda root: change(root, "sample_annotation", lambda rows: rows.append(rows[0])),
        f"sample_annotation.json: 2 rows with the token '{SCENE}-0-0'",
    ),
    "an object twice": (
        lambda root: change(root, "sample_annotation", lambda rows: rows.append(rows[0] | {"token": "other"})),
        f"sample_annotation.json: the sample '{SCENE}-0' holds the instance '{SCENE}-a' 2 times",
    ),
    "no first sample": (dangling("first_sample_token", "scene", ""), "sample.json: no row with the token ''"),
    "other last sample": (
        dangling("last_sample_token", "scene"),
        f"sample.json: {SCENE} ends with '{SCENE}-0', and should with 'nowhere'",
    ),
    "no row": (lambda root: change(root, "sensor", lambda rows: rows.insert(2, 7)), "sensor.json: row 2 must be a map"),
    "no time": (dangling("timestamp", "sample", "now"), f"row {SCENE}-0: timestamp must be a whole number, got 'now'"),
    "a circle": (dangling("next", "sample", f"{SCENE}-0"), "is no later than the sample before it"),
    "no intrinsics": (
        lambda root: change(root, "calibrated_sensor", lambda rows: rows[1].update(camera_intrinsic=[])),
        "calibrated_sensor.json: 'calibrated-CAM_FRONT' has no camera_intrinsic of 3 x 3 finite numbers",
    ),
}  # fmt: skip


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
        ("size", [1, 0, 2], "has a size without width, length or height"),
        ("size", [1, -3, 2], "has a size without width, length or height"),
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
    "intrinsic", [[[1, 2], [3]], [["a"] * 3] * 3, [[float("nan")] * 3] * 3, [[0.0] * 3] * 3], ids=str
)
def test_wrong_intrinsics_are_named(tmp_path, intrinsic):
    root = database(tmp_path)
    change(root, "calibrated_sensor", lambda rows: rows[1].update(camera_intrinsic=intrinsic))
    with pytest.raises(InvalidInput, match=r"calibrated_sensor.json: 'calibrated-CAM_FRONT' has .*camera_intrinsic"):
        first(root)


def test_a_place_that_is_not_finite_is_named(tmp_path):
    root = database(tmp_path)
    (sweep,) = root.glob("samples/LIDAR_TOP/*")
    points = np.fromfile(sweep, "<f4").reshape(-1, 5)
    points[2, 1] = np.nan
    points.tofile(sweep)
    with pytest.raises(InvalidInput, match=r"pcd.bin: point 2 has a place that is not finite"):
        first(root)


def test_samples_run_forward_in_time(tmp_path):
    root = database(tmp_path, [([CAR], pose(), as_recorded(WORLD))] * 2)
    change(root, "sample", lambda rows: rows[1].update(timestamp=rows[0]["timestamp"]))
    with pytest.raises(InvalidInput, match=rf"sample.json: '{SCENE}-1' is no later than the sample before it"):
        first(root)


def test_the_version_must_be_clear(tmp_path):
    with pytest.raises(InvalidInput, match=r"must hold one folder v1\.0-\*, .* found: none"):
        Database(tmp_path)
    database(tmp_path)
    (tmp_path / "nuscenes" / "v1.0-mini").mkdir()
    with pytest.raises(InvalidInput, match=r"found: v1\.0-mini, v1\.0-trainval"):
        Database(tmp_path / "nuscenes")
    assert len(scenes(Database(tmp_path / "nuscenes", "v1.0-trainval"))) == 1


@pytest.fixture
def sweep(recorded):
    (path,) = (recorded / "nuscenes").glob("*.pcd.bin")
    rings = np.fromfile(path, "<f4").reshape(-1, 5)[:, 4].astype(int)
    return read_points(path), rings


def test_every_real_point_off_our_own_car_falls_inside_the_grid(sweep):
    points, _ = sweep
    ranges = np.linalg.norm(points, axis=1)
    inside = AngularGrid().cells_of(points) >= 0
    assert inside.mean() == pytest.approx(0.945, abs=0.001)
    assert inside[ranges > 1.0].all()
    assert ranges[~inside].max() < 1.0


def test_real_rings_are_rows_one_to_one(sweep):
    """Ring 0 is the lowest. Near the sensor points stray by a row: lasers stand at different places in their head."""
    points, rings = sweep
    ranges = np.linalg.norm(points, axis=1)
    rows = AngularGrid().cells_of(points) // AngularGrid().columns
    medians = [np.median(rows[(ranges > 1.0) & (rings == ring)]) for ring in range(32)]
    assert medians == [31 - ring for ring in range(32)]
    own_row = rows == 31 - rings
    assert own_row[ranges > 8.0].all()
    assert own_row[ranges > 1.0].mean() == pytest.approx(0.875, abs=0.001)


def test_the_real_sweep_plays_in_a_scene(tmp_path, sweep):
    points, rings = sweep
    rows = np.column_stack([-points[:, 1], points[:, 0], points[:, 2], np.zeros(len(points)), rings])
    (shot,) = first(database(tmp_path, [([CAR], pose(), rows)])).shots
    ranges = np.linalg.norm(points, axis=1)
    assert len(shot.cloud) == np.sum((ranges > 1.0) & (ranges <= 50.0))
