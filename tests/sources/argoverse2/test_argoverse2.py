from pathlib import Path

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.types import CLASSES
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.sources.argoverse2.recordings import (
    ARGOVERSE2_CATEGORIES,
    ARGOVERSE2_SENSOR_HEIGHT_M,
    UP_LIDAR,
    argoverse2_film,
    logs,
)
from care_sim.sources.argoverse2.tables import annotation_file
from care_sim.sources.named import source_of
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


def test_the_road_returns_the_rays_that_nothing_stopped(tmp_path):
    (shot,) = argoverse2_film(parked(tmp_path, CAR_AHEAD)).shots
    road = returns_of(shot, NO_OBJECT)
    assert road[:, 2] == pytest.approx(-ARGOVERSE2_SENSOR_HEIGHT_M)
    assert np.linalg.norm(road, axis=1).max() <= 50.0
    assert np.all(np.diff(shot.cloud.cells) > 0)


def test_a_car_that_the_plane_would_bury_is_hit_all_the_same(tmp_path):
    """Ahead the real road falls: the whole box lies under the plane through the wheels."""
    (shot,) = argoverse2_film(
        parked(tmp_path, box("BUS", (20.0, 0.0, -2.0), (10.0, 3.0, 3.0)))
    ).shots
    assert len(returns_of(shot, 0)) > 20


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


def test_a_box_has_its_own_roll_and_pitch(tmp_path):
    slab = (6.0, 6.0, 0.1)
    flat = argoverse2_film(parked(tmp_path / "flat", box("SIGN", (12.0, 0.0, 1.64), slab))).shots[0]
    steep = argoverse2_film(
        parked(tmp_path / "steep", box("BUS", (12.0, 0.0, 1.64), slab, pitch=1.2))
    ).shots[0]
    assert len(returns_of(steep, 0)) > 100
    assert np.ptp(returns_of(steep, 0)[:, 2]) > 4.0, (
        "it is hit wherever it stands, however flat it was"
    )
    assert len(flat.annotations) == 0


def test_only_the_five_classes_are_annotated_and_everything_occludes(tmp_path):
    wall = box("VEHICULAR_TRAILER", (10.0, 0.0, 1.17), (1.0, 8.0, 3.0))
    (shot,) = argoverse2_film(parked(tmp_path, wall, CAR_AHEAD)).shots
    assert len(shot.annotations) == 1
    assert len(returns_of(shot, 0)) == 0
    assert len(shot.seen.objects) == 0
    assert returns_of(shot, NO_OBJECT)[:, 2].max() > 0


def test_the_recording_car_and_boxes_without_a_point_are_left_out(tmp_path):
    ego = box("EGO_VEHICLE", (1.4, 0.0, 0.5), (4.9, 1.9, 1.5))
    unseen = box("REGULAR_VEHICLE", (0.0, 12.0, 0.4), track="b", points=0)
    (shot,) = argoverse2_film(parked(tmp_path, CAR_AHEAD, ego, unseen)).shots
    assert shot.annotations.objects.tolist() == [0]
    assert len(returns_of(shot, 0)) > 20
    assert not np.any(shot.cloud.points[:, 1] == pytest.approx(11.0, abs=1e-6))


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


def test_a_keyframe_in_which_nobody_is_seen_shows_the_road_alone(tmp_path):
    (shot,) = argoverse2_film(parked(tmp_path, CAR_AHEAD | {"num_interior_pts": 0})).shots
    assert (len(shot.annotations), len(shot.seen.objects)) == (0, 0)
    assert set(shot.cloud.objects.tolist()) == {NO_OBJECT}


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


def test_sweeps_that_jitter_are_still_the_nearest_to_every_half_second(tmp_path):
    log = write(tmp_path, [[CAR_AHEAD]] * 11, [at()] * 11)
    for name in ("annotations.feather", "city_SE3_egovehicle.feather"):
        rewrite(log / name, lambda t: shifted(t, {stamp(5): 9_000_000, stamp(10): -4_000_000}))
    assert [shot.token for shot in argoverse2_film(log).shots] == [
        str(s) for s in (stamp(0), stamp(5) + 9_000_000, stamp(10) - 4_000_000)
    ]


def shifted(table, shifts):
    stamps = [s + shifts.get(s, 0) for s in table["timestamp_ns"].to_pylist()]
    return replaced(table, "timestamp_ns", stamps)


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


def test_the_six_cameras_cover_the_whole_circle(tmp_path):
    ring = [
        box(
            "PEDESTRIAN",
            (12 * np.cos(a) + 1.35, 12 * np.sin(a), 0.55),
            (0.6, 0.7, 1.8),
            track=f"{n:02}",
        )
        for n, a in enumerate(np.linspace(-np.pi, np.pi, 24, endpoint=False))
    ]
    (shot,) = argoverse2_film(parked(tmp_path, *ring)).shots
    assert set(shot.seen.objects.tolist()) == set(range(24))
    assert set(shot.seen.detections.cameras.tolist()) == set(range(6))


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


def test_of_several_annotations_the_plain_name_counts(tmp_path):
    log = parked(tmp_path, CAR_AHEAD, sweeps=3)
    copy = log / "annotations (1).feather"
    copy.write_bytes(b"of a download that broke off")
    assert annotation_file(log) == log / "annotations.feather"
    (log / "annotations.feather").rename(log / "annotations_old.feather")
    with pytest.raises(
        InvalidInput, match=r"annotations \(1\).feather, annotations_old.feather: c"
    ):
        annotation_file(log)


def test_a_log_is_called_by_its_folder_from_wherever_it_is_asked_for(tmp_path, monkeypatch):
    log = parked(tmp_path / "here", CAR_AHEAD, sweeps=11)
    monkeypatch.chdir(log)
    source = source_of("argoverse2:.")
    (scene,) = source.scenes()
    assert scene.name == source.film(scene).name == argoverse2_film(Path()).name == "here"
    assert source.row(scene) == source_of(f"argoverse2:{log.parent}").row(scene)


def test_a_home_folder_is_expanded(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    parked(tmp_path / "logs" / "a", CAR_AHEAD)
    assert [scene.name for scene in source_of("argoverse2:~/logs").scenes()] == ["a"]


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


def test_every_category_of_the_taxonomy_has_its_place():
    assert len(ARGOVERSE2_CATEGORIES) == 31, (
        "the 30 of the guide, and the second name of one of them"
    )
    assert set(ARGOVERSE2_CATEGORIES.values()) == {*CLASSES, None}


def test_the_first_keyframe_knows_the_motion_of_the_poses_before_it(tmp_path):
    """At 5 m/s: the poses are recorded from 0.2 s before the first annotated sweep."""
    log = write(tmp_path, [[], [], *[[CAR_AHEAD]] * 11], [at(x=sweep * 0.5) for sweep in range(13)])
    first, *_ = argoverse2_film(log).shots
    assert first.ego.speed == pytest.approx(5.0)
    assert (first.time_s, first.sensor.x) == (0.0, UP_LIDAR[0])
