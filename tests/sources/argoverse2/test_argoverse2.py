"""Logs with recorded sweeps, and downloads with splits."""

import functools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import feather

from care_sim.base.errors import InvalidInput
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.types import CLASSES
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.sources.argoverse2.recordings import (
    UP_LIDAR,
    Argoverse2,
    _bodies,
    argoverse2_film,
    logs,
)
from care_sim.sources.argoverse2.tables import read_boxes, read_points
from care_sim.sources.box_films import annotations_of
from care_sim.sources.named import source_of
from care_sim.sources.nuscenes.sweeps import owners
from tests.helpers.av2_log import CAR_AHEAD, at, box, parked, replaced, rewrite, stamp, write


def returns_of(shot, number):
    return shot.cloud.points[shot.cloud.objects == number]


def test_a_car_ahead_is_annotated_hit_and_seen_where_it_stands(tmp_path):
    (shot,) = argoverse2_film(parked(tmp_path, CAR_AHEAD)).shots
    assert [CLASSES[c] for c in shot.annotations.classes] == ["car"]
    centre = np.subtract((15.0, 0.0, 0.42), UP_LIDAR)
    assert shot.annotations.boxes[0] == pytest.approx([*centre, 4.0, 2.0, 1.5, 0.0])

    points = returns_of(shot, 0)
    assert len(points) > 20
    assert points[:, 0].min() == pytest.approx(15 - 2 - UP_LIDAR[0], abs=1e-6)
    assert np.all(np.abs(points - centre) <= np.array([2.0, 1.0, 0.75]) + 1e-6)

    assert shot.seen.objects.tolist() == [0]
    left, _, right, _ = shot.seen.detections.boxes[0]
    assert (left + right) / 2 == pytest.approx(160, abs=1)
    assert shot.seen.detections.cameras.tolist() == [0]


def test_the_tilt_of_the_car_reaches_the_world_and_not_its_own_view(tmp_path):
    """Boxes are annotated in the car's frame: however the car lies in the city, its sensors see the
    same.
    """
    boxes = [CAR_AHEAD, box("PEDESTRIAN", (8.0, 5.0, 0.6), (0.6, 0.7, 1.8), yaw=0.7)]
    level, tilted = (
        argoverse2_film(parked(tmp_path / name, *boxes, pose=pose)).shots[0]
        for name, pose in {
            "level": at(),
            "tilted": at(3.0, 4.0, 5.0, yaw=2.0, pitch=-0.06, roll=0.04),
        }.items()
    )
    assert tilted.sensor.roll == pytest.approx(0.04)
    assert tilted.sensor.pitch == pytest.approx(-0.06)
    assert tilted.annotations.boxes == pytest.approx(level.annotations.boxes)
    assert np.mean(tilted.cloud.objects == level.cloud.objects) > 0.999
    world = tilted.sensor.boxes_to_world(tilted.annotations.boxes)
    up = np.array([0.0, 0.0, UP_LIDAR[2]])
    car = tilted.sensor.origin - tilted.sensor.vectors_to_world(np.array(UP_LIDAR))
    assert car == pytest.approx(np.zeros(3), abs=1e-9), "the world starts at the first pose"
    ahead = tilted.sensor.vectors_to_world(
        np.array([15.0, 0.0, 0.42]) - up
    ) + tilted.sensor.vectors_to_world(up)
    assert world[0, :3] == pytest.approx(ahead)


def test_only_the_five_classes_are_annotated_and_everything_occludes(tmp_path):
    wall = box("VEHICULAR_TRAILER", (10.0, 0.0, 1.17), (1.0, 8.0, 3.0))
    (shot,) = argoverse2_film(parked(tmp_path, wall, CAR_AHEAD)).shots
    assert len(shot.annotations) == 1
    assert len(returns_of(shot, 0)) == 0
    assert len(shot.seen.objects) == 0
    assert returns_of(shot, NO_OBJECT)[:, 2].max() > 0


def test_boxes_without_a_point_were_present_at_the_first_keyframe(tmp_path):
    waiting = box("PEDESTRIAN", (12.0, 5.0, 0.6), (0.6, 0.7, 1.8), track="w", points=0)
    trailer = box("VEHICULAR_TRAILER", (20.0, -6.0, 1.17), (1.0, 8.0, 3.0), points=0)
    late = box("REGULAR_VEHICLE", (0.0, 12.0, 0.42), track="late", points=0)
    sweeps = [
        [CAR_AHEAD, waiting, trailer],
        *([[CAR_AHEAD, late]] * 4),
        [CAR_AHEAD, waiting | {"num_interior_pts": 3}],
    ]
    movie = argoverse2_film(write(tmp_path, sweeps, [at()] * 6))
    assert [len(shot.annotations) for shot in movie.shots] == [1, 2]
    assert [CLASSES[n] for n in movie.hidden.classes] == ["pedestrian"]
    assert (
        movie.hidden.objects.tolist()
        == np.setdiff1d(
            movie.shots[1].annotations.objects, movie.shots[0].annotations.objects
        ).tolist()
    )
    assert movie.hidden.boxes[0, :2] == pytest.approx(np.subtract((12.0, 5.0), UP_LIDAR[:2]))


def test_every_fifth_annotated_sweep_is_a_keyframe_and_tracks_keep_their_number(tmp_path):
    walker = [box("PEDESTRIAN", (10.0, n / 10, 0.6), (0.6, 0.7, 1.8), track="w") for n in range(12)]
    early = box("BICYCLE", (12.0, 5.0, 0.3), (1.7, 0.6, 1.2), track="e")
    sweeps = [[w, early] if n < 3 else [w] for n, w in enumerate(walker)]
    movie = argoverse2_film(write(tmp_path, sweeps, [at()] * 12))
    assert [shot.token for shot in movie.shots] == [str(stamp(n)) for n in (0, 5, 10)]
    assert [shot.time_s for shot in movie.shots] == pytest.approx([0.0, 0.5, 1.0])
    numbers = [
        shot.annotations.objects[shot.annotations.classes == CLASSES.index("pedestrian")]
        for shot in movie.shots
    ]
    assert len({int(n) for n in np.concatenate(numbers)}) == 1
    assert [len(shot.annotations) for shot in movie.shots] == [2, 1, 1]
    assert (movie.keyframe_s, movie.name) == (0.5, tmp_path.name)


def test_keyframes_stay_half_a_second_apart_where_sweeps_hold_nobody(tmp_path):
    """Sweeps 3 to 7 and the first one show nobody else: the keyframes there are empty, and none of
    them moves.
    """
    ego = box("EGO_VEHICLE", (1.4, 0.0, 0.5), (4.9, 1.9, 1.5))
    sweeps = [[ego], *([[CAR_AHEAD]] * 2), *([[]] * 5), *([[CAR_AHEAD]] * 3)]
    movie = argoverse2_film(write(tmp_path, sweeps, [at()] * 11))
    assert [shot.token for shot in movie.shots] == [str(stamp(n)) for n in (0, 5, 10)]
    assert [len(shot.annotations) for shot in movie.shots] == [0, 0, 1]
    assert [shot.time_s for shot in movie.shots] == pytest.approx([0.0, 0.5, 1.0])


def test_the_cars_motion_comes_from_its_poses(tmp_path):
    """4 m/s gaining 2 m/s every second on a circle of 20 m."""
    times = np.arange(16) / 10
    way = 4 * times + times**2
    poses = [at(20 * np.sin(w / 20), 20 * (1 - np.cos(w / 20)), yaw=w / 20) for w in way]
    movie = argoverse2_film(write(tmp_path, [[CAR_AHEAD]] * 16, poses))
    ego = movie.shots[1].ego
    assert ego.speed == pytest.approx(5.0, abs=0.01)
    assert ego.yaw_rate == pytest.approx(0.25, abs=0.001)
    assert ego.acceleration == pytest.approx(2.0, abs=0.1), (
        "of so tight a circle a parabola is not all"
    )
    assert argoverse2_film(parked(tmp_path / "one", CAR_AHEAD)).shots[0].ego.speed == 0.0


def test_a_log_with_sensor_recordings_loads_and_either_name_of_the_annotations(tmp_path):
    first = write(tmp_path / "a", [[CAR_AHEAD]], [at()])
    (first / "sensors" / "lidar").mkdir(parents=True)
    write(tmp_path / "b", [[CAR_AHEAD]], [at()], "annotations_with_ego.feather")
    assert [path.name for path in logs(tmp_path)] == ["a", "b"]
    assert logs(first) == [first]
    assert (
        len({argoverse2_film(path).shots[0].annotations.boxes.tobytes() for path in logs(tmp_path)})
        == 1
    )


def test_a_log_is_called_by_its_folder_from_wherever_it_is_asked_for(tmp_path, monkeypatch):
    log = parked(tmp_path / "here", CAR_AHEAD, sweeps=11)
    monkeypatch.chdir(log)
    source = source_of("argoverse2:.")
    (scene,) = source.scenes()
    assert scene.name == source.film(scene).name == argoverse2_film(Path()).name == "here"
    assert source.row(scene) == source_of(f"argoverse2:{log.parent}").row(scene)


@pytest.mark.parametrize("unit", [10**3, 10**6])
def test_times_that_are_no_nanoseconds_are_refused(tmp_path, unit):
    log = parked(tmp_path, CAR_AHEAD, sweeps=11)
    for path in log.iterdir():
        rewrite(path, lambda t: replaced(t, "timestamp_ns", t["timestamp_ns"].to_numpy() // unit))
    with pytest.raises(InvalidInput, match=r"annotations.feather: two sweeps .* must be nanosec"):
        argoverse2_film(log)


def test_a_folder_without_logs_is_named(tmp_path):
    with pytest.raises(InvalidInput, match="no Argoverse 2 log"):
        logs(tmp_path)


def test_the_first_keyframe_knows_the_motion_of_the_poses_before_it(tmp_path):
    """At 5 m/s: the poses are recorded from 0.2 s before the first annotated sweep."""
    log = write(tmp_path, [[], [], *[[CAR_AHEAD]] * 11], [at(x=sweep * 0.5) for sweep in range(13)])
    first, *_ = argoverse2_film(log).shots
    assert first.ego.speed == pytest.approx(5.0)
    assert (first.time_s, first.sensor.x) == (0.0, UP_LIDAR[0])


ON_THE_CAR, BESIDE_IT = (13.5, 0.2, 0.6), (13.5, 5.0, 0.6)


def of_lasers(count):
    return {"intensity": np.uint8([51] * count), "laser_number": np.uint8([7] * count)}


def swept(log, *points, keyframes=(0, 5, 10)):
    """Write a sweep of these points, in the car's frame, for every keyframe."""
    folder = log / "sensors" / "lidar"
    folder.mkdir(parents=True)
    columns = dict(zip("xyz", np.array(points, np.float16).T, strict=True))
    for number in keyframes:
        feather.write_feather(
            pa.table(columns | of_lasers(len(points))), folder / f"{stamp(number)}.feather"
        )
    return log


def test_recorded_sweeps_are_what_returns(tmp_path):
    log = swept(parked(tmp_path / "log", CAR_AHEAD, sweeps=11), ON_THE_CAR, BESIDE_IT)
    for shot in argoverse2_film(log).shots:
        ours = dict(zip(shot.cloud.objects.tolist(), shot.cloud.points, strict=True))
        assert ours[0] == pytest.approx(np.subtract(ON_THE_CAR, UP_LIDAR), abs=0.01)
        assert ours[NO_OBJECT] == pytest.approx(np.subtract(BESIDE_IT, UP_LIDAR), abs=0.01)
        assert shot.cloud.intensities == pytest.approx([0.2, 0.2])
        assert shot.cloud.rings.tolist() == [7, 7]
        assert shot.seen.objects.tolist() == [0], "pictures are those of the boxes"


def test_a_log_that_lacks_a_sweep_is_cast_at_its_boxes_and_says_so(tmp_path, capsys):
    log = swept(parked(tmp_path / "log", CAR_AHEAD, sweeps=11), ON_THE_CAR, keyframes=(0, 10))
    assert all(len(shot.cloud) > 100 for shot in argoverse2_film(log).shots)
    assert "log: 2 of 3 keyframes have a sweep" in capsys.readouterr().err


def test_a_sweep_that_changes_plays_again_and_one_that_nothing_reads_does_not(tmp_path):
    log = swept(parked(tmp_path / "log", CAR_AHEAD, sweeps=11), ON_THE_CAR)
    source = source_of(f"argoverse2:{log}")
    (scene,) = source.scenes()
    before = source.row(scene)
    feather.write_feather(pa.table({"x": [1.0]}), log / "sensors" / "lidar" / f"{stamp(1)}.feather")
    assert source.row(scene) == before
    sweep = log / "sensors" / "lidar" / f"{stamp(5)}.feather"
    feather.write_feather(
        pa.table(dict(zip("xyz", np.float16([[9], [0], [0]]), strict=True)) | of_lasers(1)), sweep
    )
    assert source.row(scene) != before


@pytest.mark.parametrize(
    ("columns", "told"),
    [
        ({"x": [1.0], "y": [1.0]}, "lacks the column 'z'"),
        ({"x": [1.0], "y": [np.nan], "z": [0.0]}, "'y' has a value that is not finite"),
        ({"x": [900.0], "y": [1.0], "z": [0.0]}, "'x' must lie in"),
    ],
)
def test_a_damaged_sweep_is_named(tmp_path, columns, told):
    log = swept(parked(tmp_path / "log", CAR_AHEAD, sweeps=11), ON_THE_CAR)
    damaged = pa.table(columns | of_lasers(1))
    feather.write_feather(damaged, log / "sensors" / "lidar" / f"{stamp(5)}.feather")
    with pytest.raises(InvalidInput, match=f"{stamp(5)}.feather: .*{told}"):
        argoverse2_film(log)


def test_a_download_with_splits_is_found(tmp_path):
    for split in ("train", "val", "test"):
        parked(tmp_path / split / f"of-{split}", CAR_AHEAD)
    assert [log.name for log in logs(tmp_path)] == ["of-train", "of-val"]
    assert Argoverse2(tmp_path, "test").scenes() == ["of-test"]
    with pytest.raises(InvalidInput, match=r"split in .* 'vall'.*train, val"):
        Argoverse2(tmp_path, "vall").scenes()


def test_a_real_sweep_has_as_many_points_in_every_box_as_are_annotated(recorded):
    """All points, whatever cells they lie in: this proves the frames of sweep and boxes."""
    log = recorded / "argoverse2" / "adcf7d18-0510-35b0-a2fa-b4cea13a6d76"
    (sweep,) = (log / "sensors" / "lidar").glob("*.feather")
    _, boxes = read_boxes(log / "annotations.feather")
    # A label of one kind: only the five classes make annotations, and all boxes are counted here.
    everything = annotations_of(
        [replace(body, label="car") for body in _bodies(boxes, int(sweep.stem))[0]]
    )
    found = owners(read_points(sweep)[:, :3] - UP_LIDAR, everything, Frame(0.0, 0.0, 0.0, 0.0))
    counts = [(found == number).sum() for number in everything.objects]
    assert np.array_equal(
        counts, boxes["num_interior_pts"][boxes["timestamp_ns"] == int(sweep.stem)]
    )


loaded = functools.cache(argoverse2_film)


@pytest.mark.parametrize(
    "log", ["3bffdcff-c3a7-38b6-a0f2-64196d130958", "adcf7d18-0510-35b0-a2fa-b4cea13a6d76"]
)
def test_real_logs_load(recorded, log):
    movie = loaded(recorded / "argoverse2" / log)
    assert len(movie.shots) == 32
    near = [np.hypot(*shot.annotations.boxes[:, :2].T) < 50 for shot in movie.shots]
    hits = [
        [(shot.cloud.objects == n).sum() >= 3 for n in shot.annotations.objects[inside]]
        for shot, inside in zip(movie.shots, near, strict=True)
    ]
    assert np.mean(np.concatenate(hits)) > 0.75
    assert min(spread(movie)) < 1.0, "a parked car stays in its place while ours moves"


def spread(movie):
    """How far the centre of every object that all keyframes hold moves in the world, metres."""
    everywhere = set.intersection(*(set(shot.annotations.objects.tolist()) for shot in movie.shots))
    for n in everywhere:
        rows = [
            s.sensor.boxes_to_world(s.annotations.boxes)[s.annotations.objects == n][0, :2]
            for s in movie.shots
        ]
        yield np.ptp(rows, axis=0).max()


SWEPT = "adcf7d18-0510-35b0-a2fa-b4cea13a6d76"
"""The log with a recorded sweep of its first annotated timestamp; the car stood still."""


@pytest.fixture
def sweep(recorded):
    """Points (n, 3) in the sensor frame, and the laser of each; 0 to 31 are those of `up_lidar`."""
    (path,) = (recorded / "argoverse2" / SWEPT / "sensors" / "lidar").glob("*.feather")
    table = feather.read_table(path)
    points = np.stack([table[axis].to_numpy().astype(float) for axis in "xyz"], axis=1)
    return points - UP_LIDAR, table["laser_number"].to_numpy()


def test_cast_returns_lie_where_the_recorded_sweep_has_them(recorded, sweep):
    """On annotated objects half the cast ranges agree with the recorded sweep to 0.4 m: boxes are
    coarse bodies.
    """
    shot = loaded(recorded / "argoverse2" / SWEPT).shots[0]
    points, _ = sweep
    cells = AngularGrid().cells_of(points)
    real = np.full(AngularGrid().size, np.inf)
    np.minimum.at(real, cells[cells >= 0], np.linalg.norm(points, axis=1)[cells >= 0])
    hit = shot.cloud.objects != NO_OBJECT
    gap = np.abs(real[shot.cloud.cells[hit]] - np.linalg.norm(shot.cloud.points[hit], axis=1))
    assert np.median(gap) < 0.4
