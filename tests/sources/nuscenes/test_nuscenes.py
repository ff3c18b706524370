"""Tables without recorded sweeps: boxes become bodies, and rays are cast at them."""

import json
import shutil

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from care_sim.base.errors import InvalidInput
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.types import CLASSES
from care_sim.evaluation.sightings import Sightings
from care_sim.sensors.annotated import NO_OBJECT, Annotations
from care_sim.sources.film_checks import report_once
from care_sim.sources.named import source_of
from care_sim.sources.nuscenes.recordings import OFFICIAL, NuScenes, split_scenes
from care_sim.sources.nuscenes.sweeps import owners, read_points
from care_sim.sources.nuscenes.tables import Database
from care_sim.sources.scenes import film_of
from care_sim.study.scene_play import film_hash
from tests.helpers.nuscenes_database import (
    SENSORS,
    add_recorded_losses,
    annotated,
    change,
    pose,
    write,
)
from tests.helpers.nuscenes_drive import write_drive
from tests.helpers.nuscenes_scene import CAR, SCENE, WORLD, database, first

UPRIGHT = Frame(0.0, 0.0, 1.8, 0.0)


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
    assert sorted(cloud.objects.tolist()) == [NO_OBJECT, 0, 0, 0]
    world = shot.sensor.origin + shot.sensor.vectors_to_world(cloud.points)
    assert sorted(map(tuple, world.round(3).tolist())) == sorted(map(tuple, WORLD[:4].tolist()))


def test_a_point_belongs_to_the_box_it_lies_in_as_the_box_is_turned():
    boxes = np.array([[10.0, 0.0, 0.0, 8.0, 1.0, 2.0, np.pi / 4]])
    on_the_diagonal, across_it = [12.0, 2.0, 0.0], [12.0, -2.0, 0.0]
    annotations = Annotations(np.array([5]), np.array([0]), boxes)
    assert owners(np.array([on_the_diagonal, across_it]), annotations, UPRIGHT).tolist() == [
        5,
        NO_OBJECT,
    ]


def test_boxes_stand_upright_however_the_sensor_leans():
    """The sensor's front is 3 degrees down: 6 m off a bus's middle that makes 0.3 m."""
    sensor = Frame(3.0, 1.0, 1.8, 0.4, pitch=np.deg2rad(3.0))
    bus = np.array([[20.0, 2.0, 1.7, 12.0, 2.9, 3.4, 0.4]])
    ends = bus[0, :3] + [[5.9 * np.cos(0.4), 5.9 * np.sin(0.4), h] for h in (1.6, -1.6, 1.8, -1.8)]
    annotations = Annotations(np.array([7]), np.array([2]), sensor.boxes_to_local(bus))
    found = owners(sensor.vectors_to_local(ends - sensor.origin), annotations, sensor)
    assert found.tolist() == [7, 7, NO_OBJECT, NO_OBJECT]


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
    assert not any("gone" in name for name in tables.pictures), "they would fill the memory"


def test_the_car_turns_and_drives_and_the_object_stays(tmp_path):
    far = annotated("vehicle.car", (20.0, 2.0, 0.85), instance="a", yaw=0.3)
    samples = [
        ([far], pose(4.0 * n, 0.5 * n, 0.1 * n), add_recorded_losses(WORLD)) for n in range(4)
    ]
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
        annotated(
            "human.pedestrian.adult", (near[0], y, near[2]), size, instance=name, visible=level
        )
        for name, y, level in [("a", 3.0, "4"), ("b", 1.0, "2"), ("c", -1.0, "1"), ("d", -3.0, "")]
    ]
    (shot,) = first(database(tmp_path, [(boxes, pose(), add_recorded_losses(WORLD))])).shots
    assert shot.annotations.objects.tolist() == [0, 1, 2, 3]
    assert shot.seen.objects.tolist() == [0, 1, 3]
    surest = shot.seen.detections.confidences
    assert surest[1] < surest[0] < surest[2]
    # The middles of the levels' bins; without a level an object counts as wholly visible.
    assert shot.seen.visible.tolist() == [0.9, 0.5, 1.0]
    assert set(shot.seen.detections.cameras.tolist()) == {0}


@pytest.mark.parametrize("channel", [name for name in SENSORS if name.startswith("CAM")])
def test_cameras_see_what_the_recorded_calibration_projects(tmp_path, channel):
    """Mount, roll and principal point: pixels of the recorded picture come back to a tenth of a
    pixel.
    """
    movie = first(database(tmp_path))
    camera = movie.cameras[list(SENSORS)[1:].index(channel)]
    translation, (w, x, y, z), (focal, u, v) = SENSORS[channel]
    pixels = np.array([[80.0, 100.0], [800.0, 450.0], [1500.0, 850.0]])
    rays = np.column_stack([(pixels - (u, v)) / focal, np.ones(3)])
    points = np.add(translation, Rotation.from_quat([x, y, z, w]).apply(rays) * 30)
    sensor = movie.shots[0].sensor
    shown, depth = camera.project(sensor.vectors_to_local(points - sensor.origin))
    assert np.all(depth > 0)
    shift = np.array([camera.width, camera.height]) / 2 - (u, v)
    assert shown - shift == pytest.approx(pixels, abs=0.1)
    assert (shift >= 0).all(), "the recorded picture lies within"
    spare = np.array([camera.width, camera.height]) - (1600, 900)
    assert (shift <= spare).all()
    assert (spare < 110).all()


def test_what_lies_outside_the_classes_or_holds_no_point_is_left_out(tmp_path):
    boxes = [
        CAR,
        annotated("vehicle.trailer", (30, 0, 2)),
        annotated("vehicle.bicycle", (9, 3, 0.6), points=0),
    ]
    (shot,) = first(database(tmp_path, [(boxes, pose(), add_recorded_losses(WORLD))])).shots
    assert len(shot.annotations) == 1


def test_boxes_without_a_point_were_present_at_the_first_keyframe(tmp_path):
    waiting, seen = (
        annotated(
            "human.pedestrian.adult", (30.0, 4.0, 0.9), (0.7, 0.7, 1.8), instance="w", points=n
        )
        for n in (0, 5)
    )
    trailer = annotated("vehicle.trailer", (30, 0, 2), points=0)
    samples = [
        ([CAR, waiting, trailer], pose(), add_recorded_losses(WORLD)),
        ([CAR, seen], pose(4.0), add_recorded_losses(WORLD)),
    ]
    movie = first(database(tmp_path, samples))
    assert [len(shot.annotations) for shot in movie.shots] == [1, 2]
    assert movie.hidden.objects.tolist() == [
        number for number in movie.shots[1].annotations.objects if number
    ]
    world = movie.shots[0].sensor.boxes_to_world(movie.hidden.boxes)
    assert world[0, :3] == pytest.approx([30.0, 4.0, 0.9])


def test_the_validation_split_holds_the_150_scenes_of_the_devkit():
    val = OFFICIAL["val"]
    assert len(val) == len(set(val)) == 150
    assert {"scene-0003", "scene-1073", *OFFICIAL["mini_val"]} <= set(val)
    assert {"scene-0037", "scene-0628", "scene-0918", "scene-0970", "scene-1074"}.isdisjoint(val)


def test_splits_choose_scenes(tmp_path):
    sample = [([CAR], pose(), add_recorded_losses(WORLD))]
    root = write(tmp_path, {"scene-0061": sample, "scene-0103": sample, "scene-0916": sample})
    tables = Database(root)
    assert [row["name"] for row in split_scenes(tables)] == ["scene-0103", "scene-0916"]
    assert len(split_scenes(tables, "all")) == 3
    (root / "v1.0-trainval" / "splits.json").write_text(
        json.dumps({"mine": ["scene-0061"], "gone": ["scene-9"]})
    )
    assert [row["name"] for row in split_scenes(tables, "mine")] == ["scene-0061"]
    with pytest.raises(InvalidInput, match=r"splits.json: the split 'gone' names 'scene-9'"):
        split_scenes(tables, "gone")
    with pytest.raises(
        InvalidInput, match="unknown split 'x'; known: all, gone, mine, mini_train, "
    ):
        split_scenes(tables, "x")


@pytest.fixture
def sweep(recorded):
    (path,) = (recorded / "nuscenes").glob("*.pcd.bin")
    rings = np.fromfile(path, "<f4").reshape(-1, 5)[:, 4].astype(int)
    points = read_points(path)
    assert np.array_equal(points[:, 4], rings)
    assert points[:, 3].max() == 1.0
    return points[:, :3], rings


def test_real_rings_are_rows_one_to_one(sweep):
    """Ring 0 is the lowest. Near the sensor points stray by a row: lasers stand at different places
    in their head.
    """
    points, rings = sweep
    ranges = np.linalg.norm(points, axis=1)
    rows = AngularGrid().cells_of(points) // AngularGrid().columns
    medians = [np.median(rows[(ranges > 1.0) & (rings == ring)]) for ring in range(32)]
    assert medians == [31 - ring for ring in range(32)]
    own_row = rows == 31 - rings
    assert own_row[ranges > 8.0].all()
    assert own_row[ranges > 1.0].mean() == pytest.approx(0.875, abs=0.001)


PERSON = annotated("human.pedestrian.adult", (15.0, -3.0, 0.9), (0.7, 0.7, 1.8), instance="p")
TRAILER = annotated("vehicle.trailer", (12.0, 1.2, 1.5), (3.0, 2.0, 3.0), instance="t")
"""It hides CAR, and is outside the five classes."""


@pytest.fixture(autouse=True)
def said_anew():
    report_once.cache_clear()


def alone(folder, *boxes, keyframes=1):
    """The tables of a standing car, without sweeps."""
    root = database(folder, [([*boxes], pose(), add_recorded_losses(WORLD))] * keyframes)
    shutil.rmtree(root / "samples")
    return root


def returns(shot):
    """How many returns each object has."""
    return {number: int((shot.cloud.objects == number).sum()) for number in (NO_OBJECT, 0, 1)}


def test_rays_meet_the_boxes_and_cameras_show_them(tmp_path, capsys):
    movie = first(alone(tmp_path, CAR))
    (shot,) = movie.shots
    on_car = shot.cloud.points[shot.cloud.objects == 0]
    world = shot.sensor.origin + shot.sensor.vectors_to_world(on_car)
    assert len(on_car) > 30
    assert np.abs(world[:, :2] - (20.0, 2.0)).max(axis=0) == pytest.approx([2.3, 0.95], abs=0.02)
    assert world[:, 2].max() <= 1.71
    assert shot.seen.objects.tolist() == [0]
    assert CLASSES[shot.annotations.classes[0]] == "car"
    lines = capsys.readouterr().err.splitlines()
    assert [line.partition("nuscenes: ")[2] for line in lines] == [
        "no recorded sweeps (samples/LIDAR_TOP): annotated boxes become bodies, and rays are cast "
        "at them"
    ]


def test_the_road_is_level_however_the_lidar_leans(tmp_path):
    (shot,) = first(alone(tmp_path, CAR)).shots
    assert abs(shot.sensor.pitch) > np.radians(1)
    road = shot.cloud.points[shot.cloud.objects == NO_OBJECT]
    heights = (shot.sensor.origin + shot.sensor.vectors_to_world(road))[:, 2]
    assert len(road) > 5000
    assert np.abs(heights).max() < 1e-6


def test_recorded_cameras_show_what_projection_shows(tmp_path):
    """To a pixel of their small pictures, five of the recorded ones; the LiDAR leans in both."""
    root = alone(tmp_path, CAR)
    rendered = first(root)
    shutil.copytree(
        database(tmp_path / "swept", [([CAR], pose(), add_recorded_losses(WORLD))]) / "samples",
        root / "samples",
    )
    projected = first(root)
    boxes = []
    for movie in (rendered, projected):
        camera = movie.cameras[0]
        seen = movie.shots[0].seen.detections
        assert seen.cameras.tolist() == [0]
        boxes.append(camera.rays(seen.boxes.reshape(-1, 2, 2))[0])
    # Metres to the side and up, a metre ahead: 250 pixels.
    assert np.abs(boxes[0] - boxes[1]).max() < 1.5 / 250
    assert rendered.cameras[0].width < 340


def test_what_is_outside_the_classes_hides_and_is_no_object(tmp_path):
    (free,), (hidden,) = (
        first(alone(tmp_path / str(n), CAR, *more)).shots for n, more in enumerate([(), (TRAILER,)])
    )
    assert returns(free)[0] > 30
    assert returns(hidden)[0] == 0
    assert len(hidden.annotations) == 1, "the car is annotated, for it holds a recorded point"
    assert hidden.seen.objects.size == 0


def test_a_box_without_a_point_is_neither_annotated_nor_a_body_unless_asked_for(tmp_path, capsys):
    root = alone(tmp_path, CAR, TRAILER | {"num_lidar_pts": 0}, PERSON | {"num_lidar_pts": 0})
    movie, full = first(root), first(root, empty_boxes=True)
    assert [len(each.shots[0].annotations) for each in (movie, full)] == [1, 2]
    assert [len(each.hidden) for each in (movie, full)] == [1, 0]
    assert returns(movie.shots[0])[0] > 30
    assert returns(full.shots[0])[0] == 0
    told = capsys.readouterr().err
    assert "scene-0103: 1 of 2 boxes within 50 m hold no recorded point: 0 newcomers" in told


def test_sweeps_that_are_not_there_cannot_be_gathered(tmp_path):
    root = alone(tmp_path, CAR)
    with pytest.raises(InvalidInput, match=r"no recorded sweeps .*: sweeps must be 1, got 3"):
        first(root, sweeps=3)


def test_sweeps_that_come_later_make_another_film(tmp_path):
    root = write_drive(tmp_path / "drive")
    (root / "samples").rename(tmp_path / "samples")
    source = source_of(f"nuscenes:{root}")
    scene, _ = source.scenes()
    assert source.row(scene)["points"] == "boxes"
    before, hash_before = source.row(scene)["recording"], film_hash(film_of(source, scene))
    (tmp_path / "samples").rename(root / "samples")
    assert "points" not in source.row(scene)
    assert source.row(scene)["recording"] != before
    assert film_hash(film_of(source, scene)) != hash_before


def test_the_metadata_of_two_real_scenes_plays(tmp_path, recorded):
    if not (recorded / "nuscenes-mini").is_dir():
        pytest.skip("no nuscenes-mini in shared/data")
    shutil.copytree(
        recorded / "nuscenes-mini" / "v1.0-mini",
        tmp_path / "v1.0-mini",
        ignore=shutil.ignore_patterns("*.arrow"),
    )
    source = NuScenes(tmp_path, split="mini_val")
    assert source.scenes() == ["scene-0103", "scene-0916"]
    movie = source.film("scene-0103")
    sightings = Sightings.of("", [shot.annotations for shot in movie.shots], hidden=movie.hidden)
    assert (len(movie.shots), len(sightings.events)) == (40, 89)
    ages = np.array([shot.seen.pictures[:, 0] for shot in movie.shots])
    assert ages.max() == pytest.approx(0.0454, abs=1e-4)
