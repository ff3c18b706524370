"""Tables without recorded sweeps: boxes become bodies, and rays are cast at them."""

import shutil

import gymnasium as gym
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.types import CLASSES
from care_sim.evaluation.sightings import Sightings
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.sources.film_checks import report_once
from care_sim.sources.named import source_of
from care_sim.sources.nuscenes.recordings import NuScenes
from care_sim.sources.scenes import film_of
from care_sim.study.scene_play import film_hash
from tests.helpers.nuscenes_database import annotated, as_recorded, pose, write
from tests.helpers.nuscenes_drive import write_drive
from tests.helpers.nuscenes_scene import CAR, WORLD, database, first

PERSON = annotated("human.pedestrian.adult", (15.0, -3.0, 0.9), (0.7, 0.7, 1.8), instance="p")
TRAILER = annotated("vehicle.trailer", (12.0, 1.2, 1.5), (3.0, 2.0, 3.0), instance="t")
"""It hides CAR, and is outside the five classes."""


@pytest.fixture(autouse=True)
def said_anew():
    report_once.cache_clear()


def alone(folder, *boxes, keyframes=1):
    """The tables of a standing car, without sweeps."""
    root = database(folder, [([*boxes], pose(), as_recorded(WORLD))] * keyframes)
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
        database(tmp_path / "swept", [([CAR], pose(), as_recorded(WORLD))]) / "samples",
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


def test_the_environment_plays_them(tmp_path):
    root = write_drive(tmp_path / "drive")
    shutil.rmtree(root / "samples")
    options = {"camera_times": "sweep", "empty_boxes": True}
    with gym.make("CARE-Replay-v0", source=f"nuscenes:{root}", **options) as env:
        policy = care_sim.make_policy("care", env)
        observation, _ = env.reset(seed=0)
        for _ in range(4):
            observation, *_ = env.step(policy(observation))
        assert env.unwrapped.loop.belief.tracks.ids.size


def test_a_split_that_is_held_in_part_names_what_is_missing(tmp_path, capsys):
    sample = [([CAR], pose(), as_recorded(WORLD))]
    root = write(tmp_path, {"scene-0103": sample, "scene-0916": sample, "scene-1100": sample})
    held = {split: NuScenes(root, split=split).scenes() for split in ("val", "train", "mini_train")}
    assert held["val"] == ["scene-0103", "scene-0916"]
    assert held["train"] == held["mini_train"] == ["scene-1100"]
    lines = [line.partition("scene.json: ")[2] for line in capsys.readouterr().err.splitlines()]
    assert lines == [
        "holds 2 of the 150 scenes of the split val; missing: scene-0003, scene-0012, scene-0013 "
        "and 145 more",
        "holds 1 of the 700 scenes of the split train; missing: scene-0001, scene-0002, scene-0004 "
        "and 696 more",
        "holds 1 of the 8 scenes of the split mini_train; missing: scene-0061, scene-0553, "
        "scene-0655 and 4 more",
    ]
    NuScenes(root, split="mini_val").scenes()
    NuScenes(root, split="all").scenes()
    assert not capsys.readouterr().err


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
