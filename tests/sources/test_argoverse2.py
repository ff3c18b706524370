import functools

import numpy as np
import pyarrow as pa
import pytest
from av2_log import at, box, rewrite, stamp, write
from pyarrow import feather

from care_sim.errors import InvalidInput
from care_sim.film import NOBODY
from care_sim.grid import AngularGrid
from care_sim.sources.argoverse2 import CATEGORIES, SENSOR_HEIGHT_M, UP_LIDAR, film, logs
from care_sim.types import CLASSES

CAR_AHEAD = box("REGULAR_VEHICLE", (15.0, 0.0, 0.42), track="a")
"""Stands on the road: its bottom 0.33 m under the rear axle."""
HERE = at()


loaded = functools.cache(film)


def parked(folder, *boxes, pose=HERE, sweeps=1):
    return write(folder, [boxes] * sweeps, [pose] * sweeps)


def returns_of(shot, number):
    return shot.cloud.points[shot.cloud.objects == number]


def test_a_car_ahead_is_annotated_hit_and_seen_where_it_stands(tmp_path):
    (shot,) = film(parked(tmp_path, CAR_AHEAD)).shots
    assert [CLASSES[c] for c in shot.annotations.classes] == ["car"]
    centre = np.subtract((15.0, 0.0, 0.42), UP_LIDAR)
    assert shot.annotations.boxes[0] == pytest.approx([*centre, 4.0, 2.0, 1.5, 0.0])

    points = returns_of(shot, 0)
    assert len(points) > 20
    assert points[:, 0].min() == pytest.approx(15 - 2 - UP_LIDAR[0], abs=1e-6)
    assert np.all(np.abs(points - centre) <= np.array([2.0, 1.0, 0.75]) + 1e-6)

    assert shot.sights.objects.tolist() == [0]
    left, _, right, _ = shot.sights.detections.boxes[0]
    assert (left + right) / 2 == pytest.approx(160, abs=1)
    assert shot.sights.detections.cameras.tolist() == [0]


def test_the_road_returns_the_rays_that_nothing_stopped(tmp_path):
    (shot,) = film(parked(tmp_path, CAR_AHEAD)).shots
    road = returns_of(shot, NOBODY)
    assert road[:, 2] == pytest.approx(-SENSOR_HEIGHT_M)
    assert np.linalg.norm(road, axis=1).max() <= 50.0
    assert np.all(np.diff(shot.cloud.cells) > 0)


def test_a_car_that_the_plane_would_bury_is_hit_all_the_same(tmp_path):
    """Ahead the real road falls: the whole box lies under the plane through the wheels."""
    (shot,) = film(parked(tmp_path, box("BUS", (20.0, 0.0, -2.0), (10.0, 3.0, 3.0)))).shots
    assert len(returns_of(shot, 0)) > 20


def test_the_tilt_of_the_car_reaches_the_world_and_not_its_own_view(tmp_path):
    """Boxes are annotated in the car's frame: however the car lies in the city, its sensors see the same."""
    boxes = [CAR_AHEAD, box("PEDESTRIAN", (8.0, 5.0, 0.6), (0.6, 0.7, 1.8), yaw=0.7)]
    level, tilted = (
        film(parked(tmp_path / name, *boxes, pose=pose)).shots[0]
        for name, pose in {"level": at(), "tilted": at(3.0, 4.0, 5.0, yaw=2.0, pitch=-0.06, roll=0.04)}.items()
    )
    assert tilted.sensor.roll == pytest.approx(0.04)
    assert tilted.sensor.pitch == pytest.approx(-0.06)
    assert tilted.annotations.boxes == pytest.approx(level.annotations.boxes)
    assert np.mean(tilted.cloud.objects == level.cloud.objects) > 0.999
    world = tilted.sensor.boxes_to_world(tilted.annotations.boxes)
    up = np.array([0.0, 0.0, UP_LIDAR[2]])
    car = tilted.sensor.origin - tilted.sensor.vectors_to_world(np.array(UP_LIDAR))
    assert car == pytest.approx(np.zeros(3), abs=1e-9), "the world starts at the first pose"
    ahead = tilted.sensor.vectors_to_world(np.array([15.0, 0.0, 0.42]) - up) + tilted.sensor.vectors_to_world(up)
    assert world[0, :3] == pytest.approx(ahead)


def test_a_box_has_its_own_roll_and_pitch(tmp_path):
    slab = (6.0, 6.0, 0.1)
    flat = film(parked(tmp_path / "flat", box("SIGN", (12.0, 0.0, 1.64), slab))).shots[0]
    steep = film(parked(tmp_path / "steep", box("BUS", (12.0, 0.0, 1.64), slab, pitch=1.2))).shots[0]
    assert len(returns_of(steep, 0)) > 100
    assert len(flat.annotations) == 0


def test_only_the_five_classes_are_annotated_and_everything_occludes(tmp_path):
    wall = box("VEHICULAR_TRAILER", (10.0, 0.0, 1.17), (1.0, 8.0, 3.0))
    (shot,) = film(parked(tmp_path, wall, CAR_AHEAD)).shots
    assert len(shot.annotations) == 1
    assert len(returns_of(shot, 0)) == 0
    assert len(shot.sights.objects) == 0
    assert returns_of(shot, NOBODY)[:, 2].max() > 0


def test_the_recording_car_and_boxes_without_a_point_are_left_out(tmp_path):
    ego = box("EGO_VEHICLE", (1.4, 0.0, 0.5), (4.9, 1.9, 1.5))
    unseen = box("REGULAR_VEHICLE", (0.0, 12.0, 0.4), track="b", points=0)
    (shot,) = film(parked(tmp_path, CAR_AHEAD, ego, unseen)).shots
    assert shot.annotations.objects.tolist() == [0]
    assert len(returns_of(shot, 0)) > 20
    assert not np.any(shot.cloud.points[:, 1] == pytest.approx(11.0, abs=1e-6))


def test_a_keyframe_in_which_nobody_is_seen_shows_the_road_alone(tmp_path):
    (shot,) = film(parked(tmp_path, CAR_AHEAD | {"num_interior_pts": 0})).shots
    assert (len(shot.annotations), len(shot.sights.objects)) == (0, 0)
    assert set(shot.cloud.objects.tolist()) == {NOBODY}


def test_every_fifth_annotated_sweep_is_a_keyframe_and_tracks_keep_their_number(tmp_path):
    walker = [box("PEDESTRIAN", (10.0, n / 10, 0.6), (0.6, 0.7, 1.8), track="w") for n in range(12)]
    early = box("BICYCLE", (12.0, 5.0, 0.3), (1.7, 0.6, 1.2), track="e")
    sweeps = [[w, early] if n < 3 else [w] for n, w in enumerate(walker)]
    movie = film(write(tmp_path, sweeps, [at()] * 12))
    assert [shot.token for shot in movie.shots] == [str(stamp(n)) for n in (0, 5, 10)]
    assert [shot.time_s for shot in movie.shots] == pytest.approx([0.0, 0.5, 1.0])
    numbers = [
        shot.annotations.objects[shot.annotations.classes == CLASSES.index("pedestrian")] for shot in movie.shots
    ]
    assert len({int(n) for n in np.concatenate(numbers)}) == 1
    assert [len(shot.annotations) for shot in movie.shots] == [2, 1, 1]
    assert (movie.keyframe_s, movie.name) == (0.5, tmp_path.name)


def test_keyframes_stay_half_a_second_apart_where_sweeps_hold_nobody(tmp_path):
    """Sweeps 3 to 7 and the first one show nobody else: the keyframes there are empty, and none of them moves."""
    ego = box("EGO_VEHICLE", (1.4, 0.0, 0.5), (4.9, 1.9, 1.5))
    sweeps = [[ego], *([[CAR_AHEAD]] * 2), *([[]] * 5), *([[CAR_AHEAD]] * 3)]
    movie = film(write(tmp_path, sweeps, [at()] * 11))
    assert [shot.token for shot in movie.shots] == [str(stamp(n)) for n in (0, 5, 10)]
    assert [len(shot.annotations) for shot in movie.shots] == [0, 0, 1]
    assert [shot.time_s for shot in movie.shots] == pytest.approx([0.0, 0.5, 1.0])


def test_sweeps_that_jitter_are_still_the_nearest_to_every_half_second(tmp_path):
    log = write(tmp_path, [[CAR_AHEAD]] * 11, [at()] * 11)
    for name in ("annotations.feather", "city_SE3_egovehicle.feather"):
        rewrite(log / name, lambda t: shifted(t, {stamp(5): 9_000_000, stamp(10): -4_000_000}))
    assert [shot.token for shot in film(log).shots] == [
        str(s) for s in (stamp(0), stamp(5) + 9_000_000, stamp(10) - 4_000_000)
    ]


def shifted(table, shifts):
    stamps = [s + shifts.get(s, 0) for s in table["timestamp_ns"].to_pylist()]
    return replaced(table, "timestamp_ns", stamps)


def replaced(table, name, values):
    return table.set_column(table.column_names.index(name), name, pa.array(values))


def test_the_cars_motion_comes_from_its_poses(tmp_path):
    """4 m/s gaining 2 m/s every second on a circle of 20 m."""
    times = np.arange(16) / 10
    way = 4 * times + times**2
    poses = [at(20 * np.sin(w / 20), 20 * (1 - np.cos(w / 20)), yaw=w / 20) for w in way]
    movie = film(write(tmp_path, [[CAR_AHEAD]] * 16, poses))
    ego = movie.shots[1].ego
    assert ego.speed == pytest.approx(5.0, abs=0.01)
    assert ego.yaw_rate == pytest.approx(0.25, abs=0.001)
    assert ego.acceleration == pytest.approx(2.0, abs=0.1), "of so tight a circle a parabola is not all"
    assert film(parked(tmp_path / "one", CAR_AHEAD)).shots[0].ego.speed == 0.0


def test_the_six_cameras_cover_the_whole_circle(tmp_path):
    ring = [
        box("PEDESTRIAN", (12 * np.cos(a) + 1.35, 12 * np.sin(a), 0.55), (0.6, 0.7, 1.8), track=f"{n:02}")
        for n, a in enumerate(np.linspace(-np.pi, np.pi, 24, endpoint=False))
    ]
    (shot,) = film(parked(tmp_path, *ring)).shots
    assert set(shot.sights.objects.tolist()) == set(range(24))
    assert set(shot.sights.detections.cameras.tolist()) == set(range(6))


def test_a_log_with_sensor_recordings_loads_and_either_name_of_the_annotations(tmp_path):
    first = write(tmp_path / "a", [[CAR_AHEAD]], [at()])
    (first / "sensors" / "lidar").mkdir(parents=True)
    write(tmp_path / "b", [[CAR_AHEAD]], [at()], "annotations_with_ego.feather")
    assert [path.name for path in logs(tmp_path)] == ["a", "b"]
    assert logs(first) == [first]
    assert len({film(path).shots[0].annotations.boxes.tobytes() for path in logs(tmp_path)}) == 1


BREAKS = {
    "no annotations": (lambda log: (log / "annotations.feather").unlink(), r"annotations\*\.feather: no such file"),
    "no poses": (lambda log: (log / "city_SE3_egovehicle.feather").unlink(), "city_SE3_egovehicle.feather: no such"),
    "truncated": (
        lambda log: (log / "annotations.feather").write_bytes((log / "annotations.feather").read_bytes()[:300]),
        "annotations.feather: no readable Feather file",
    ),
    "empty file": (lambda log: (log / "annotations.feather").write_bytes(b""), "no readable Feather file"),
    "no column": (
        lambda log: rewrite(log / "annotations.feather", lambda t: t.drop_columns(["width_m"])),
        "annotations.feather: lacks the column 'width_m'; needed: timestamp_ns",
    ),
    "two columns": (
        lambda log: rewrite(log / "annotations.feather", lambda t: t.append_column("tx_m", t["tx_m"])),
        "annotations.feather: has 2 columns 'tx_m'; needed: timestamp_ns",
    ),
    "half points": (
        lambda log: rewrite(log / "annotations.feather", lambda t: replaced(t, "num_interior_pts", [1.5] * len(t))),
        "annotations.feather: column 'num_interior_pts' must hold int values, has double",
    ),
    "numbers as text": (
        lambda log: rewrite(log / "annotations.feather", lambda t: replaced(t, "tx_m", ["1.5"] * len(t))),
        "annotations.feather: column 'tx_m' must hold float values, has string",
    ),
    "flags": (
        lambda log: rewrite(log / "annotations.feather", lambda t: replaced(t, "tx_m", [True] * len(t))),
        "annotations.feather: column 'tx_m' must hold float values, has bool",
    ),
    "text as numbers": (
        lambda log: rewrite(log / "annotations.feather", lambda t: replaced(t, "track_uuid", [7] * len(t))),
        "annotations.feather: column 'track_uuid' must hold str values, has int64",
    ),
    "a folder": (
        lambda log: ((log / "annotations.feather").unlink(), (log / "annotations.feather").mkdir()),
        "annotations.feather: no readable Feather file",
    ),
    "an object twice": (
        lambda log: rewrite(log / "annotations.feather", lambda t: pa.concat_tables([t, t.slice(1, 1)])),
        f"annotations.feather: track a is annotated twice at {stamp(1)}",
    ),
    "two poses": (
        lambda log: rewrite(log / "city_SE3_egovehicle.feather", lambda t: pa.concat_tables([t, t.slice(1, 1)])),
        f"city_SE3_egovehicle.feather: two poses at {stamp(1)}",
    ),
    "no turn": (
        lambda log: rewrite(log / "city_SE3_egovehicle.feather", lambda t: replaced(t, "qw", [1.0, 0.0])),
        f"city_SE3_egovehicle.feather: a quaternion qw, qx, qy, qz of length zero at {stamp(1)}",
    ),
    "no rows": (lambda log: rewrite(log / "annotations.feather", lambda t: t.slice(0, 0)), "no annotations"),
    "no pose": (
        lambda log: rewrite(log / "city_SE3_egovehicle.feather", lambda t: t.slice(0, 1)),
        f"city_SE3_egovehicle.feather: no pose for the timestamp {stamp(1)} of annotations.feather",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BREAKS)
def test_what_is_wrong_with_a_log_is_said_in_one_line(tmp_path, name):
    breaks, message = BREAKS[name]
    log = parked(tmp_path / "log", CAR_AHEAD, sweeps=2)
    breaks(log)
    with pytest.raises(InvalidInput, match=message) as caught:
        film(log)
    assert "\n" not in str(caught.value)
    assert str(log) in str(caught.value)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (box("SPACESHIP", (9, 0, 0)), "unknown category 'SPACESHIP'; known: ANIMAL, "),
        (
            box("BUS", (9, 0, 0), (4, 0, 2), track="flat"),
            f"track flat has a box without length, width or height at {stamp(0)}",
        ),
        (box("BUS", (9, np.nan, 0)), "column 'ty_m' has a value that is not finite, in row 1"),
        (box("BUS", (9, 0, 0)) | {"qw": 0.0, "qz": 0.0}, "track BUS has a quaternion qw, qx, qy, qz of length zero"),
        (box("BUS", (9, 0, 0)) | {"qx": None}, "column 'qx' has 1 empty values"),
    ],
)
def test_a_wrong_box_is_named(tmp_path, wrong, message):
    with pytest.raises(InvalidInput, match=message):
        film(parked(tmp_path, CAR_AHEAD, wrong))


def test_a_folder_without_logs_is_named(tmp_path):
    with pytest.raises(InvalidInput, match="no Argoverse 2 log"):
        logs(tmp_path)


def test_every_category_of_the_taxonomy_has_its_place():
    assert len(CATEGORIES) == 31, "the 30 of the guide, and the second name of one of them"
    assert set(CATEGORIES.values()) == {*CLASSES, None}


@pytest.mark.parametrize("log", ["3bffdcff-c3a7-38b6-a0f2-64196d130958", "adcf7d18-0510-35b0-a2fa-b4cea13a6d76"])
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
        rows = [s.sensor.boxes_to_world(s.annotations.boxes)[s.annotations.objects == n][0, :2] for s in movie.shots]
        yield np.ptp(rows, axis=0).max()


SWEPT = "adcf7d18-0510-35b0-a2fa-b4cea13a6d76"
"""The log with a recorded sweep, taken at its first annotated timestamp while the car stood still."""


@pytest.fixture
def sweep(recorded):
    """Points (n, 3) in the sensor frame, and the laser of each; 0 to 31 are those of `up_lidar`."""
    (path,) = (recorded / "argoverse2" / SWEPT / "sensors" / "lidar").glob("*.feather")
    table = feather.read_table(path)
    points = np.stack([table[axis].to_numpy().astype(float) for axis in "xyz"], axis=1)
    return points - UP_LIDAR, table["laser_number"].to_numpy()


def test_the_mount_is_where_the_recorded_lasers_meet(sweep):
    """Seen from the right place, and from no other, every laser keeps its elevation at all ranges and azimuths."""

    def spread(shift):
        points = sweep[0] - shift
        ranges = np.linalg.norm(points, axis=1)
        near = (ranges > 3) & (ranges < 15)
        lasers = [np.arcsin(points[:, 2] / ranges)[near & (sweep[1] == laser)] for laser in range(32)]
        return np.rad2deg(np.median([np.std(elevations) for elevations in lasers if len(elevations) > 50]))

    assert spread(np.zeros(3)) < 0.005
    assert min(spread(shift) for shift in 0.1 * np.vstack([np.eye(3), -np.eye(3)])) > 0.015


def test_the_road_lies_where_the_recorded_sweep_has_it(sweep):
    points, _ = sweep
    distance = np.hypot(points[:, 0], points[:, 1])
    counts, edges = np.histogram(points[(distance > 4) & (distance < 10), 2], np.arange(-3.0, 1.0, 0.05))
    assert edges[counts.argmax()] + 0.025 == pytest.approx(-SENSOR_HEIGHT_M, abs=0.05)


def test_cast_returns_lie_where_the_recorded_sweep_has_them(recorded, sweep):
    """On annotated objects half the cast ranges agree with the recorded sweep to 0.4 m: boxes are coarse bodies."""
    shot = loaded(recorded / "argoverse2" / SWEPT).shots[0]
    points, _ = sweep
    cells = AngularGrid().cells_of(points)
    real = np.full(AngularGrid().size, np.inf)
    np.minimum.at(real, cells[cells >= 0], np.linalg.norm(points, axis=1)[cells >= 0])
    hit = shot.cloud.objects != NOBODY
    gap = np.abs(real[shot.cloud.cells[hit]] - np.linalg.norm(shot.cloud.points[hit], axis=1))
    assert np.median(gap) < 0.4
