"""Logs without labels: what the reference makes of sweeps, and every form of file."""

import json

import numpy as np
import pytest
from scipy.spatial import cKDTree

from care_sim.base.errors import InvalidInput
from care_sim.core.types import CLASSES
from care_sim.evaluation.sightings import Sightings
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.sources.film_checks import check_film
from care_sim.sources.installed import recordings
from care_sim.sources.sweeps.logs import log_of_folder
from care_sim.sources.sweeps.points import in_seconds
from tests.helpers.commands import run
from tests.helpers.places import EXAMPLES, ROOT, loaded
from tests.helpers.sweeps_log import (
    APPEARS_S,
    FORMS,
    SPEED_MPS,
    STANDING,
    START_NS,
    STEP_NS,
    WALKER,
    sweep,
    write_log,
)


def film_of(folder, scene=None, **options):
    source = recordings(f"sweeps:{folder}", options)
    film = source.film(scene or source.scenes()[0])
    check_film(film, recorded=True)
    return film


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_log(tmp_path_factory.mktemp("log") / "drive")


@pytest.fixture(scope="module")
def film(folder):
    return film_of(folder)


def in_world(film):
    """Places of every object in the world, by keyframe."""
    places = {}
    for shot in film.shots:
        boxes = shot.sensor.boxes_to_world(shot.annotations.boxes)
        for number, box in zip(shot.annotations.objects.tolist(), boxes, strict=True):
            places.setdefault(number, []).append(box[:2])
    return {number: np.array(each) for number, each in places.items()}


def test_what_stands_is_an_object_that_stays_where_it_is(film):
    places = in_world(film)
    assert len(places) == 3
    for x, y, *_ in STANDING.values():
        (number,) = (n for n, each in places.items() if np.hypot(*(each[2] - (x, y))) < 1.5)
        assert np.ptp(places[number], axis=0).max() < 1.2
    speeds = [shot.ego.speed for shot in film.shots[1:]]
    assert speeds == pytest.approx([SPEED_MPS] * len(speeds), abs=0.01)


def test_a_cluster_that_appears_is_the_event(film):
    sightings = Sightings.of(film.name, [shot.annotations for shot in film.shots])
    (event,) = sightings.events
    assert film.shots[sightings.frames.keyframes[event]].time_s == pytest.approx(APPEARS_S)
    assert CLASSES[sightings.frames.classes[event]] == "pedestrian"
    places = in_world(film)[int(sightings.frames.objects[event])]
    assert np.abs(places - WALKER[:2]).max() < 0.5
    # Its points are its own.
    last = film.shots[-1]
    assert (last.cloud.objects == sightings.frames.objects[event]).sum() > 10
    assert (last.cloud.objects == NO_OBJECT).sum() > 1000


def test_clusters_that_do_not_last_are_no_objects(tmp_path):
    def flicker(time_s):
        points = sweep(time_s)
        return points if 1.0 <= time_s < 2.1 and time_s < APPEARS_S + 0.7 else sweep(0.0)[:4500]

    film = film_of(write_log(tmp_path / "drive", points_of=flicker, seconds=3.0))
    # The walker is there at two keyframes, what stands at three.
    assert len(in_world(film)) == 2


@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_file_holds_the_same_points(tmp_path, folder, form):
    source = recordings(f"sweeps:{folder}")
    told = write_log(tmp_path / "drive", form, seconds=1.0)
    other = film_of_points(told)
    usual = film_of_points(source.folder)
    assert other.shape == usual.shape
    assert np.abs(other - usual).max() < 1e-5


def film_of_points(folder):
    from care_sim.sources.sweeps.logs import log_of_folder

    return log_of_folder(folder).points_of(7)[:, :3]


def test_a_lidar_that_is_turned_on_its_mount(tmp_path, film):
    def turned(time_s):
        x, y, z = sweep(time_s).T
        return np.stack([-y, x, z], axis=1)  # x to the right, y ahead

    own = write_log(tmp_path / "drive", points_of=turned)
    usual = (ROOT / "care_sim/sensors/shipped/hdl-32e.toml").read_text()
    (own / "sensor.toml").write_text(usual + "yaw_deg = -90.0\n")
    for one, two in zip(film.shots, film_of(own).shots, strict=True):
        assert two.annotations.boxes == pytest.approx(one.annotations.boxes, abs=1e-6)
        assert len(two.cloud.cells) == pytest.approx(len(one.cloud.cells), rel=0.01)


def test_a_set_up_in_the_folder_says_rows_and_height(tmp_path, folder):
    own = write_log(tmp_path / "drive", points_of=lambda time_s: sweep(time_s) - [0, 0, 0.3])
    with pytest.raises(InvalidInput, match=r"the road lies 2\.1\d m below the LiDAR"):
        film_of(own)
    text = 'name = "mine"\n[lidar]\nrows = 16\ntop_deg = 15\nbottom_deg = -15\n'
    (own / "sensor.toml").write_text(text + "position_m = [-0.445, 0, 2.14]\n")
    film = film_of(own)
    assert film.grid.rows == 16
    assert film.sensor_height_m == 2.14
    # It may lie beside the scene, too.
    (own / "sensor.toml").rename(tmp_path / "sensor.toml")
    assert film_of(own).grid.rows == 16
    # An option comes first.
    other = tmp_path / "other.toml"
    other.write_text(text + "position_m = [-0.445, 0, 1.84]\n")
    assert film_of(folder, sensor=str(other), reference="cluster").grid.rows == 16


def test_times_in_a_file_and_several_scenes(tmp_path, film):
    for name in ("a", "b"):
        own = write_log(tmp_path / name)
        rows = ["file,time"]
        for number, path in enumerate(sorted((own / "sweeps").iterdir())):
            rows.append(f"{number:03d}.npy,{int(path.stem) * 1e-9:.6f}")
            path.rename(path.with_name(f"{number:03d}.npy"))
        (own / "times.csv").write_text("\n".join(rows))
    source = recordings(f"sweeps:{tmp_path}")
    assert source.scenes() == ["a", "b"]
    shots = source.film("b").shots
    assert [shot.time_s for shot in shots] == pytest.approx([shot.time_s for shot in film.shots])
    assert tmp_path / "b" / "times.csv" in source.files("b")


@pytest.mark.parametrize("unit", [1e-9, 1e-6, 1e-3, 1.0])
def test_times_are_told_in_any_usual_unit(unit):
    seconds = np.array([1.6e9, 1.6e9 + 0.5])
    assert in_seconds(seconds / unit) == pytest.approx(seconds, abs=1e-6)


def test_a_car_that_stands_has_a_single_pose(tmp_path):
    own = write_log(tmp_path / "drive", points_of=lambda _: sweep(2.0), seconds=1.5)
    (own / "poses.csv").write_text("time,x,y,z,qx,qy,qz,qw\n0,5,5,0,0,0,1,0\n")
    film = film_of(own)
    assert {shot.ego.speed for shot in film.shots} == {0.0}
    assert film.shots[-1].sensor.yaw == pytest.approx(np.pi)


def test_poses_between_sweeps_are_interpolated(tmp_path):
    own = write_log(tmp_path / "drive")
    turn = ["time,x,y,z,yaw"] + [
        f"{START_NS * 1e-9 + t:.6f},{-6 * t:.6f},0,0,{3 + 0.2 * t - 6.283185 * (t > 0.75):.6f}"
        for t in (0, 0.7, 1.4, 2.1, 2.8, 3.5, 4.2)
    ]
    (own / "poses.csv").write_text("\n".join(turn))
    film = film_of(own)
    yaws = np.unwrap([shot.sensor.yaw for shot in film.shots])
    assert np.diff(yaws) == pytest.approx([0.1] * 8, abs=1e-4)


BOXES = [
    {"image_id": "0/{time}", "category_id": 1, "bbox": [0.0, 0.0, 800.0, 600.0], "score": 0.8},
    {"image_id": "0/{late}", "category_id": 3, "bbox": [10.0, 10.0, 50.0, 40.0], "score": 0.5},
]


def test_camera_boxes_have_an_age_and_their_object(tmp_path, film, capsys):
    own = write_log(tmp_path / "drive")
    camera = "[[cameras]]\nwidth = 800\nheight = 600\nposition_m = [0.5, 0, 1.6]\n"
    lidar = "rows = 32\ntop_deg = 10.67\nbottom_deg = -30.67\nposition_m = [-0.445, 0, 1.84]\n"
    (own / "sensor.toml").write_text(f'name = "mine"\n[lidar]\n{lidar}{camera}')
    shot = next(shot for shot in film.shots if shot.time_s == pytest.approx(1.5))
    walker = shot.annotations.boxes[shot.annotations.classes == CLASSES.index("pedestrian")]
    setup = recordings(f"sweeps:{own}").setup
    from care_sim.sensors.setups import sensor_setup

    left, top, right, bottom = sensor_setup(setup).cameras[0].project_boxes(walker)[0]
    box = [left, top, right - left, bottom - top]
    rows = [
        dict(BOXES[0], image_id=f"0/{START_NS + 13 * STEP_NS}", bbox=box),
        dict(BOXES[1], image_id=f"0/{START_NS + 16 * STEP_NS}"),
    ]
    (own / "camera_boxes.json").write_text(json.dumps(rows))
    seen = [each.seen for each in film_of(own).shots]
    assert "no camera_boxes.json" not in capsys.readouterr().err
    assert [len(each) for each in seen] == [0, 0, 0, 1, 1, 0, 0, 0, 0]
    assert seen[3].detections.ages == pytest.approx([0.2], abs=1e-6)
    assert seen[3].objects[0] in shot.annotations.objects
    assert CLASSES[seen[4].detections.classes[0]] == "car"
    assert seen[4].objects.tolist() == [NO_OBJECT]
    assert seen[4].detections.ages == pytest.approx([0.4], abs=1e-6)


def test_the_protocol_counts_who_detects_a_new_cluster_first(capsys, folder, tmp_path):
    played = ("--policies", "history", "care", "rows", "full", "--budgets", "0.1")
    few = ("--floor-seeds", "1", "--workers", "1", "--detector", "cluster")
    options = (*played, *few, "--out", tmp_path / "out")
    code, printed, _ = run(
        capsys, "protocol", "--source", f"sweeps:{folder}", "--verbose", *options
    )
    assert code == 0
    told = " ".join(printed.split())
    assert "events detected earlier, later or at the same keyframe as history" in told
    # Without a camera CARE fires as history does.
    assert "10% care 0.0 0.0 1.0" in told
    assert (tmp_path / "out" / "plays.parquet").exists()


@pytest.fixture(scope="module")
def foggy(recorded, tmp_path_factory):
    """A recorded sequence in fog (RADIATE), turned into a folder of sweeps by the example."""
    out = tmp_path_factory.mktemp("radiate") / "tiny_foggy"
    loaded(EXAMPLES / "radiate_sweeps.py").convert(recorded / "radiate" / "tiny_foggy", out)
    return out


def misfit(foggy, yaw_deg):
    """Metres in the world between what two sweeps half a second apart show above the road, median
    of their points.
    """
    log = log_of_folder(foggy)
    cos, sin = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    apart = []
    for first in (10, 25, 40):
        world = []
        for number in (first, first + 5):
            points = log.points_of(number)[:, :3]
            ranges = np.hypot(*points[:, :2].T)
            x, y, z = points[(ranges > 6) & (ranges < 40) & (points[:, 2] > -1.2)].T
            (car,) = log.cars(log.times_s[[number]])
            own = np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1)
            world.append(car.origin + car.vectors_to_world(own))
        apart.append(np.median(cKDTree(world[0]).query(world[1])[0]))
    return float(np.mean(apart))


def test_what_stands_stays_in_the_world_with_the_axes_of_the_car(foggy):
    right = misfit(foggy, 0)
    assert right < 0.3
    assert min(misfit(foggy, yaw) for yaw in (-90, 90, 180)) > 4 * right


def test_the_film_has_the_speed_of_the_gps_and_a_flat_road_where_the_set_up_has_it(foggy):
    film = recordings(f"sweeps:{foggy}").film("tiny_foggy")
    assert len(film.shots) == 12
    speeds = [shot.ego.speed for shot in film.shots[1:]]
    assert speeds[0] == pytest.approx(12.1, abs=0.3)
    assert speeds[-1] == pytest.approx(9.5, abs=0.3)
    points = np.concatenate([shot.cloud.points for shot in film.shots])
    ranges = np.hypot(*points[:, :2].T)
    road = points[(ranges > 3) & (ranges < 12) & (np.abs(points[:, 2] + 2.03) < 0.15)]
    plane = np.linalg.lstsq(np.column_stack([road[:, :2], np.ones(len(road))]), road[:, 2])[0]
    assert np.degrees(np.hypot(*plane[:2])) < 1.5
    sightings = Sightings.of(film.name, [shot.annotations for shot in film.shots])
    assert 8 <= len(sightings.events) <= 20
