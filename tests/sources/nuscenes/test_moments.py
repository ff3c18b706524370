"""Each camera's picture is that of the camera where it was when the picture was taken."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from care_sim.base.errors import InvalidInput
from care_sim.core.grid import AngularGrid
from care_sim.core.residual import wedges
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES
from care_sim.envs.open_loop import FilmEnv
from care_sim.sensors.annotated import NO_OBJECT
from tests.helpers.nuscenes_database import (
    SENSORS,
    START_US,
    add_recorded_losses,
    annotated,
    change,
    pose,
)
from tests.helpers.nuscenes_scene import CAR, SCENE, WORLD, database, first

LEFT = "CAM_FRONT_LEFT"
SPEED, TURN = 9.0, -0.3
"""Metres and radians per second."""
EARLY_S = 0.043
"""So long before the sweep nuScenes' front left camera takes its picture."""
VAN = annotated("vehicle.truck", (16.0, 11.0, 1.2), (2.0, 5.0, 2.4), instance="van")
AHEAD = annotated("vehicle.car", (30.0, 4.0, 0.9), instance="ahead")
LEANING_PX = 7
"""The LiDAR leans by 1.4 degrees, and boxes stand upright in its frame."""


def at(seconds):
    """The pose of the car."""
    return pose(SPEED * seconds, 0.0, TURN * seconds)


def as_turned(seconds):
    """The pose of LEFT's picture in a car that does nothing but turn by 20 degrees until the
    sweep.
    """
    seconds += EARLY_S
    return pose(SPEED * seconds, 0.0, TURN * seconds + np.radians(20))


def timed(folder, early_s=EARLY_S, keyframes=3, own_pose=at):
    """Keyframes of a car that drives and turns, LEFT before the sweep, other cameras with it."""
    moments = [0.5 * n for n in range(keyframes)]
    root = database(
        folder, [([VAN, AHEAD], at(moment), add_recorded_losses(WORLD)) for moment in moments]
    )

    def earlier(rows):
        for row in rows:
            if LEFT in row["token"]:
                row["timestamp"] -= round(early_s * 1e6)

    def moved(rows):
        for row in rows:
            if LEFT in row["token"]:
                row.update(own_pose(0.5 * int(row["token"].split("-")[3]) - early_s))

    change(root, "sample_data", earlier)
    change(root, "ego_pose", moved)
    return root


def projected_by_hand(box, car, channel):
    """(4,) left, top, right and bottom in the recorded picture."""
    width, length, height = box["size"]
    corners = np.stack(
        np.meshgrid(*[(-side / 2, side / 2) for side in (length, width, height)]), -1
    ).reshape(-1, 3)
    corners += box["translation"]
    for translation, (w, x, y, z) in ((car["translation"], car["rotation"]), SENSORS[channel][:2]):
        corners = Rotation.from_quat([x, y, z, w]).inv().apply(corners - np.array(translation))
    focal, u, v = SENSORS[channel][2]
    pixels = corners[:, :2] / corners[:, 2:] * focal + (u, v)
    return np.clip(np.r_[pixels.min(axis=0), pixels.max(axis=0)], 0, (1600, 900, 1600, 900))


def shown(movie, shot, channel=LEFT):
    """(4,) the van's box in the recorded picture of a camera."""
    number = list(SENSORS)[1:].index(channel)
    camera, (_, u, v) = movie.cameras[number], SENSORS[channel][2]
    seen = shot.seen.detections
    is_van = seen.classes == CLASSES.index("truck")
    (box,) = seen.boxes[is_van & (seen.cameras == number)]
    return box - np.tile(np.array([camera.width, camera.height]) / 2 - (u, v), 2)


def test_a_standing_object_is_where_its_camera_saw_it(tmp_path):
    root = timed(tmp_path)
    own, swept = first(root), first(root, camera_times="sweep")
    assert own.cameras == swept.cameras, "the mounts"
    for n, (one, other) in enumerate(zip(own.shots, swept.shots, strict=True)):
        then, now = (projected_by_hand(VAN, at(0.5 * n - early), LEFT) for early in (EARLY_S, 0.0))
        assert shown(own, one) == pytest.approx(then, abs=LEANING_PX)
        assert shown(swept, other) == pytest.approx(now, abs=LEANING_PX)
        assert np.abs(then - now).max() > 3 * LEANING_PX


def test_boxes_have_the_age_and_turn_of_their_picture(tmp_path):
    root = timed(tmp_path)
    for shot in first(root).shots:
        seen = shot.seen.detections
        left = seen.cameras == 1
        assert left.any()
        assert not left.all()
        assert seen.ages[left] == pytest.approx(EARLY_S)
        assert seen.yaw_changes[left] == pytest.approx(TURN * EARLY_S, abs=1e-6)
        assert not seen.ages[~left].any()
        assert seen.yaw_changes[~left] == pytest.approx(0.0, abs=1e-9)
    for shot in first(root, camera_times="sweep").shots:
        assert not shot.seen.detections.ages.any()
        assert not shot.seen.detections.yaw_changes.any()


def test_a_turn_across_the_back_of_the_compass_is_small(tmp_path):
    root = timed(tmp_path)
    yaw = np.pi - TURN * (0.5 - EARLY_S / 2)
    change(root, "ego_pose", lambda rows: [turn(row, yaw) for row in rows])
    for shot in first(root).shots:
        assert np.abs(shot.seen.pictures[:, 1]).max() < 0.1


def turn(row, yaw):
    w, x, y, z = row["rotation"]
    x, y, z, w = (Rotation.from_euler("z", yaw) * Rotation.from_quat([x, y, z, w])).as_quat()
    row["rotation"] = [w, x, y, z]


def test_wedges_are_turned_back_to_where_the_object_is(tmp_path):
    """Nothing but a turn of 20 degrees lies between picture and sweep."""

    movie = first(timed(tmp_path, own_pose=as_turned))
    shot = movie.shots[1]
    seen = shot.seen.detections
    van = seen.take(seen.cameras == 1)
    rig = Rig(movie.grid, movie.cameras, 100)
    of_van = shot.annotations.classes == CLASSES.index("truck")
    hull = set(rig.hulls(shot.annotations.boxes[of_van]).cells.tolist())
    turned_back, as_seen = (
        len(hull & set(wedges(one, rig).cells.tolist())) / len(hull)
        for one in (van, van.unturned())
    )
    assert len(van) == 1
    assert turned_back > 0.8
    assert as_seen < 0.5


def test_latency_adds_to_the_age_and_false_boxes_have_that_of_their_picture(tmp_path):
    root = timed(tmp_path, keyframes=6)
    # The picture that arrives is 4 ms older than those of which false boxes are made.
    older = f"{SCENE}-0-{LEFT}"

    def age(rows):
        (row,) = (row for row in rows if row["token"] == older)
        row["timestamp"] -= 4000

    change(root, "sample_data", age)
    movie = first(root)
    with FilmEnv(movie, budget=0.1, camera_latency=1, false_positive_rate=3.0) as env:
        env.reset(seed=0)
        loop = env.loop
        loop.keyframe(np.arange(10))
        seen = loop.belief.detections
        is_false = loop.true_detected_objects() < 0
        assert is_false.any()
        left = seen.cameras == 1
        assert (left & is_false).any()
        assert seen.ages == pytest.approx(np.where(left, 0.504 + EARLY_S, 0.5))
        turns = TURN * np.where(left, 0.5 + EARLY_S, 0.5)
        assert seen.yaw_changes == pytest.approx(turns, abs=1e-6)


def test_times_in_other_units_are_named(tmp_path):
    root = timed(tmp_path)
    change(root, "sample_data", lambda rows: rows[2].update(timestamp=START_US // 1000))
    with pytest.raises(
        InvalidInput, match=rf"sample_data.json: '{SCENE}-0-{LEFT}' was taken .* s "
    ):
        first(root)
    assert first(root, camera_times="sweep")


SEEN = np.array([[22.0, 2.0, 0.8], [30.0, -5.0, 0.1]])
"""Points in the world: at the front of CAR, and on the road."""


def swept(folder, *moments, filed=1):
    """Three keyframes, 4 m apart; before the second, sweeps at the `moments` (s), filed under the
    sample of the number.
    """
    samples = [
        ([CAR], pose(4.0 * n), add_recorded_losses(WORLD - [4.0 * n, 0, 0])) for n in range(3)
    ]
    root = database(folder, samples)
    for moment in moments:
        add_sweep(root, moment, filed)
    return root


def add_sweep(root, moment, filed):
    name = f"sweep-{moment}"
    x = 8.0 * moment
    file = f"sweeps/LIDAR_TOP/{name}.pcd.bin"
    data = {"token": name, "ego_pose_token": name, "is_key_frame": False, "filename": file} | {
        "timestamp": START_US + round(moment * 1e6),
        "sample_token": f"{SCENE}-{filed}",
    }
    change(root, "sample_data", lambda rows: rows.append(rows[0] | data))
    change(root, "ego_pose", lambda rows: rows.append({"token": name} | pose(x)))
    (root / file).parent.mkdir(parents=True, exist_ok=True)
    add_recorded_losses(SEEN - [x, 0, 0]).astype("<f4").tofile(root / file)


@pytest.mark.parametrize("filed", [0, 1, 2])
def test_the_last_before_a_keyframe_are_served_in_order_of_time_wherever_they_are_filed(
    tmp_path, filed
):
    root = swept(tmp_path, 0.3, 0.1, 0.45, 0.2, filed=filed)
    shots = first(root, sweeps=4).shots
    assert [[sweep.time_s for sweep in shot.sweeps] for shot in shots] == [
        [],
        pytest.approx([0.2, 0.3, 0.45]),
        [],
    ]
    assert [len(shot.sweeps) for shot in first(root, sweeps=10).shots] == [0, 4, 0]


def test_sweeps_before_the_first_keyframe_have_no_mask_and_are_left_out(tmp_path):
    shots = first(swept(tmp_path, -0.1, 0.2, 1.2), sweeps=10).shots
    assert [len(shot.sweeps) for shot in shots] == [0, 1, 0]


def test_a_sweep_holds_its_own_cells_and_the_points_lie_in_the_boxes_of_the_keyframe(tmp_path):
    _, shot, _ = first(swept(tmp_path, 0.25), sweeps=2).shots
    (sweep,) = shot.sweeps
    assert sweep.sensor.x == pytest.approx(shot.sensor.x - 2.0)
    assert sweep.cloud.cells.tolist() == AngularGrid().cells_of(sweep.cloud.points).tolist()
    world = sweep.sensor.origin + sweep.sensor.vectors_to_world(sweep.cloud.points)
    assert sorted(map(tuple, world.round(3))) == sorted(map(tuple, SEEN))
    on_the_car = np.isclose(world[:, 0], 22.0, atol=0.01)
    assert sweep.cloud.objects[on_the_car].tolist() == [shot.annotations.objects[0]]
    assert sweep.cloud.objects[~on_the_car].tolist() == [NO_OBJECT]


def test_sweeps_that_nobody_recorded_are_refused(tmp_path):
    with pytest.raises(
        InvalidInput,
        match=rf"sample_data.json: no LIDAR_TOP between '{SCENE}-0' and '{SCENE}-2': a film of it "
        "has one sweep a keyframe",
    ):
        first(swept(tmp_path), sweeps=10)
