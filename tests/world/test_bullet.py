"""Bodies, rays, pictures and clearance in PyBullet."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from care_sim.core.frames import Frame
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.sensor_setup import LIDAR_POSITION
from care_sim.core.types import CLASSES
from care_sim.sensors.pictures import FRONT_CAMERA
from care_sim.world.bodies import CATALOGUE, sized
from care_sim.world.bullet import NO_BODY, BulletWorld
from care_sim.world.bullet_bodies import borrow, give_back

FORWARD = np.array([[1.0, 0.0, 0.0]])
BLOCK = CATALOGUE["trailer"]
NEAR_SIDE = 20.0 - BLOCK.size[1] / 2
"""Distance of a trailer that stands across the road 20 m away."""
QUARTERS = [(20.0, 0.0), (0.0, 20.0), (-20.0, 0.0), (0.0, -20.0)]
"""Ahead, left, behind and right, 20 m away."""


def test_a_box_at_a_known_distance(bullet):
    bus = bullet.add(CATALOGUE["bus"], (30.0, 0.0, 0.0))
    ranges, ids = bullet.cast([0.0, 0.0, 1.84], FORWARD, 50.0)
    assert ids.tolist() == [bus]
    assert ranges[0] == pytest.approx(30 - 11.19 / 2, abs=1e-6)


def test_a_slanted_ray_onto_a_turned_box(bullet):
    """A trailer across the road presents its width: its face lies half of it before its centre."""
    bullet.add(BLOCK, (20.0, 0.0, np.pi / 2))
    direction = np.array([[np.cos(0.1), np.sin(0.1), 0.0]])
    ranges, _ = bullet.cast([0.0, 0.0, 1.0], direction, 50.0)
    assert ranges[0] == pytest.approx(NEAR_SIDE / np.cos(0.1), abs=1e-6)


@pytest.mark.parametrize("count", [1, 8192, 8193, 16_383, 16_384, 16_385, 20_000])
def test_every_ray_of_any_number_is_answered_in_its_place(bullet, count):
    body = bullet.add(BLOCK, (20.0, 0.0, np.pi / 2))
    directions = np.tile([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], (count // 2 + 1, 1))[:count]
    ranges, ids = bullet.cast([0.0, 0.0, 1.0], directions, 50.0)
    ahead = np.arange(count) % 2 == 0
    assert len(ranges) == len(ids) == count
    assert np.array_equal(ids, np.where(ahead, body, NO_BODY))
    assert np.allclose(ranges[ahead], NEAR_SIDE)


def test_rays_pass_through_the_transparent_ego_and_keep_doing_so_when_it_moves(bullet):
    ego = bullet.add(CATALOGUE["ego"], (0.0, 0.0, 0.0), transparent=True)
    bus = bullet.add(CATALOGUE["bus"], (20.0, 0.0, 0.0))
    assert bullet.cast([-10.0, 0.0, 0.5], FORWARD, 50.0)[1].tolist() == [bus]
    bullet.move(ego, (5.0, 0.0, 0.3))
    assert bullet.cast([-10.0, 0.0, 0.5], FORWARD, 50.0)[1].tolist() == [bus]


def test_rays_pictures_and_clearance_all_know_of_a_move(bullet):
    """From 20 m ahead to 30, each asked first after its move."""
    body, other = (
        bullet.add(BLOCK, (20.0, 0.0, np.pi / 2)),
        bullet.add(BLOCK, (0.0, 0.0, np.pi / 2)),
    )
    bullet.move(body, (30.0, 0.0, np.pi / 2))
    assert bullet.clearance(body, other) == pytest.approx(30.0 - BLOCK.size[1], abs=1e-3)
    bullet.move(body, (-30.0, 0.0, np.pi / 2))
    assert body not in bullet.body_ids(FRONT_CAMERA, Frame(2.0, 0.0, 1.84, 0.0))
    bullet.move(body, (30.0, 0.0, np.pi / 2))
    assert body in bullet.body_ids(FRONT_CAMERA, Frame(2.0, 0.0, 1.84, 0.0))
    bullet.move(body, (40.0, 0.0, np.pi / 2))
    assert bullet.cast([2.0, 0.0, 1.0], FORWARD, 50.0)[0][0] == pytest.approx(18 + NEAR_SIDE)


def test_clearance_between_two_bodies_leaves_a_third_one_to_be_told_of(bullet):
    near, far, third = (bullet.add(BLOCK, (x, 0.0, np.pi / 2)) for x in (20.0, 30.0, 40.0))
    bullet.move(third, (10.0, 0.0, np.pi / 2))
    assert bullet.clearance(near, far) == pytest.approx(10.0 - BLOCK.size[1], abs=1e-3)
    assert bullet.cast([0.0, 0.0, 1.0], FORWARD, 50.0)[1].tolist() == [third]


def test_bodies_keep_their_ids_in_whatever_order_they_are_asked_about(bullet):
    """Two of four are asked about first, the later before the earlier. Each stands alone in a
    direction of its own.
    """
    bodies = [bullet.add(CATALOGUE["car"], (x, y, 0.0)) for x, y in QUARTERS]
    assert bullet.clearance(bodies[3], bodies[1]) == pytest.approx(40.0 - 1.95, abs=1e-3)
    rays = np.array([[x, y, 0.0] for x, y in QUARTERS]) / 20.0
    assert bullet.cast([0.0, 0.0, 0.5], rays, 50.0)[1].tolist() == bodies
    for body, (x, y) in zip(bodies, QUARTERS, strict=True):
        picture = bullet.body_ids(FRONT_CAMERA, Frame(0.0, 0.0, 1.84, np.arctan2(y, x)))
        assert set(picture.ravel().tolist()) == {NO_BODY, body}
    late = bullet.add(CATALOGUE["bus"], (10.0, 0.0, 0.0))
    assert bullet.cast([0.0, 0.0, 0.5], rays, 50.0)[1].tolist() == [late, *bodies[1:]]


def test_moving_all_is_moving_each(bullet):
    rng = np.random.default_rng(0)
    bodies = [bullet.add(BLOCK, Frame(0.0, 0.0, 1.0, 0.0, 0.3, 0.2)) for _ in range(5)]
    poses = rng.uniform(-10, 10, (5, 3))
    for body, pose in zip(bodies, poses.tolist(), strict=True):
        bullet.move(body, tuple(pose))
    each = bullet.primitives.poses.copy()
    bullet.primitives.poses[bodies] = 0.0
    bullet.move_all(np.array(bodies), poses)
    assert np.array_equal(bullet.primitives.poses, each)


def street(bullet):
    places = {
        "car": (12, 3, 0.1), "van": (16, -4, 0.0), "truck": (30, 5, 0.4),
        "pedestrian": (9, -1, 1.5),
        "trailer": (35, -7, 0.0), "bicycle": (14, 0.5, 0.8), "building": (60, 10, 0.0),
    }  # fmt: skip
    return {bullet.add(CATALOGUE[name], pose): name for name, pose in places.items()}


def within_silhouettes(picture):
    """Pixels whose eight neighbours show the same body."""
    alike = ndimage.minimum_filter(picture, 3) == ndimage.maximum_filter(picture, 3)
    alike[[0, -1]] = alike[:, [0, -1]] = False
    return alike


@pytest.mark.parametrize("heading", [0.0, 0.15, -0.2])
@pytest.mark.parametrize(
    "camera", [FRONT_CAMERA, PinholeCamera(320, 180, 1.2, (0.5, 0.3, -0.2), 0.1, 0.05)]
)
def test_the_picture_agrees_with_rays_through_its_pixels(bullet, heading, camera):
    """Camera and LiDAR see the same world, except at silhouettes, where a pixel is part one, part
    other.
    """
    bodies = street(bullet)
    sensor = Frame.mounted((1.0, -0.5, heading), LIDAR_POSITION)
    picture = bullet.body_ids(camera, sensor)
    u, v = np.meshgrid(np.arange(320) + 0.5, np.arange(180) + 0.5)
    rays = camera.rays(np.stack([u.ravel(), v.ravel()], axis=-1))
    turn = np.array(
        [[np.cos(heading), -np.sin(heading), 0], [np.sin(heading), np.cos(heading), 0], [0, 0, 1]]
    )
    eye = sensor.origin + turn @ camera.position
    _, ids = bullet.cast(eye, (rays / np.linalg.norm(rays, axis=1)[:, None]) @ turn.T, 110.0)
    cast = np.where(ids == bullet.ground, NO_BODY, ids).reshape(180, 320)
    shown = np.where(picture == bullet.ground, NO_BODY, picture)

    same = shown == cast
    assert same[within_silhouettes(shown) & within_silhouettes(cast)].all()
    assert same.mean() > 0.985
    assert len(set(np.unique(shown)) & set(bodies)) >= 5


def test_left_is_left_in_the_picture(bullet):
    body = bullet.add(CATALOGUE["car"], (15.0, 5.0, 0.0))
    rows, columns = np.nonzero(bullet.body_ids(FRONT_CAMERA, Frame(0, 0, 1.84, 0)) == body)
    assert columns.max() < 160
    assert rows.min() > 85


def test_clearance_is_between_hulls_and_not_boxes(bullet):
    """Corner to corner: a trailer ahead and to the side of the ego."""
    ego = bullet.add(CATALOGUE["ego"], (0.0, 0.0, 0.0))
    trailer = bullet.add(BLOCK, (10.0, 10.0, 0.0))
    across, along = 10 - BLOCK.size[1] / 2 - 0.865, 10 - 6.005 - 2.04
    assert bullet.clearance(ego, trailer) == pytest.approx(np.hypot(across, along), abs=2e-3)


def test_overlap_is_negative_and_far_is_infinite(bullet):
    ego = bullet.add(CATALOGUE["ego"], (0.0, 0.0, 0.0))
    bus = bullet.add(CATALOGUE["bus"], (2.04 + 11.19 / 2 - 0.3, 0.0, 0.0))
    assert bullet.clearance(ego, bus) == pytest.approx(-0.3, abs=1e-2)
    bullet.move(bus, (60.0, 0.0, 0.0))
    assert bullet.clearance(ego, bus, within=5.0) == np.inf


AHEAD = np.array([[1.0, 0.0, 0.0], [0.9, 0.0, -np.sqrt(0.19)]])
SENSOR = Frame(0.0, 0.0, 1.84, 0.0)


def answers(world):
    bus = world.add(CATALOGUE["bus"], (30.0, 0.0, 0.3))
    ranges, ids = world.cast(SENSOR.origin, AHEAD, 50.0)
    return bus, ranges.tolist(), ids.tolist(), world.body_ids(FRONT_CAMERA, SENSOR).tobytes()


@pytest.mark.parametrize("ground", [True, False])
def test_a_world_answers_as_in_a_fresh_client_whatever_was_there_before(monkeypatch, ground):
    used = BulletWorld()
    for x in range(5, 25, 5):
        used.add(CATALOGUE["trailer"], (float(x), 0.0, 1.0), transparent=x == 5)
    used.close()
    again = BulletWorld(ground)
    after = answers(again)
    monkeypatch.setattr("care_sim.world.bullet_bodies._free", [])
    fresh = BulletWorld(ground)
    assert again._client.number != fresh._client.number
    assert after == answers(fresh)
    again.close()
    fresh.close()


def test_closing_twice_gives_a_client_back_once():
    world = BulletWorld()
    world.close()
    world.close()
    first, second = borrow(), borrow()
    assert first != second
    give_back(first)
    give_back(second)


def test_a_world_that_is_not_asked_borrows_no_client(monkeypatch):
    monkeypatch.setattr("care_sim.world.bullet_bodies._free", free := [borrow()])
    world = BulletWorld()
    bus = world.add(CATALOGUE["bus"], (30.0, 0.0, 0.0))
    world.move(bus, (10.0, 0.0, 0.0))
    assert len(free) == 1
    ranges, ids = world.cast(SENSOR.origin, AHEAD[:1], 50.0)
    assert (ids.tolist(), free) == ([bus], [])
    assert ranges[0] < 10.0
    world.close()
    assert len(free) == 1


def test_whoever_does_not_close_gives_the_client_back_with_the_last_reference(monkeypatch):
    monkeypatch.setattr("care_sim.world.bullet_bodies._free", free := [])
    world = BulletWorld()
    world.cast(SENSOR.origin, AHEAD, 50.0)
    number = world._client.number
    del world
    assert free == [number]


def test_a_pitched_box_presents_its_slanting_front(bullet):
    """A cube of 2 m, nose down by 0.2 rad about the middle of its bottom face, which lies at the
    height of a level ray: the ray meets the front face, 1 m along the slope, nearer by 1 /
    cos(0.2).
    """
    cube = sized("cube", None, (2.0, 2.0, 2.0))
    body = bullet.add(cube, Frame(10.0, 0.0, 5.0, np.pi, pitch=0.2))
    ranges, ids = bullet.cast([0.0, 0.0, 5.0], FORWARD, 50.0)
    assert ids.tolist() == [body]
    assert ranges[0] == pytest.approx(10 - 1 / np.cos(0.2), abs=1e-6)


def test_a_frame_without_tilt_puts_a_body_where_a_pose_does(bullet):
    first = bullet.add(CATALOGUE["car"], (10.0, 1.0, 0.7))
    rays = np.array([[np.cos(a), np.sin(a), -0.08] for a in np.linspace(-0.3, 0.3, 50)])
    by_pose = bullet.cast([0.0, 0.0, 1.5], rays, 50.0)
    bullet.move(first, Frame(10.0, 1.0, 0.0, 0.7))
    by_frame = bullet.cast([0.0, 0.0, 1.5], rays, 50.0)
    assert np.array_equal(by_pose[1], by_frame[1])
    assert by_pose[0] == pytest.approx(by_frame[0], abs=1e-9)


def test_a_tilted_camera_and_tilted_rays_see_the_same(bullet):
    sensor = Frame(1.0, -0.5, 1.84, 0.15, roll=0.08, pitch=-0.06)
    for name, pose in {
        "car": (12, 3, 0.1),
        "truck": (30, 5, 0.4),
        "pedestrian": (9, -1, 1.5),
    }.items():
        bullet.add(CATALOGUE[name], pose)
    picture = bullet.body_ids(FRONT_CAMERA, sensor)
    u, v = np.meshgrid(np.arange(320) + 0.5, np.arange(180) + 0.5)
    rays = FRONT_CAMERA.rays(np.stack([u.ravel(), v.ravel()], axis=-1))
    eye = sensor.origin + sensor.vectors_to_world(np.array(FRONT_CAMERA.position))
    rays = sensor.vectors_to_world(rays / np.linalg.norm(rays, axis=1)[:, None])
    _, ids = bullet.cast(eye, rays, 110.0)
    cast = np.where(ids == bullet.ground, NO_BODY, ids).reshape(180, 320)
    assert (picture == cast).mean() > 0.985
    assert len(np.unique(picture)) == 4


@given(st.sampled_from([*CLASSES, None]), st.tuples(*[st.floats(0.2, 15.0)] * 3))
def test_a_body_of_any_size_fills_its_box_and_stays_within_it(label, size):
    kind = sized("thing", label, size)
    low, high = (
        np.array([np.array(part.centre) + sign * np.array(part.size) / 2 for part in kind.parts])
        for sign in (-1, 1)
    )
    half = np.array([size[0] / 2, size[1] / 2, 0.0])
    assert np.all(low >= -half - 1e-9)
    assert np.all(high <= np.array([size[0] / 2, size[1] / 2, size[2]]) + 1e-9)
    boxed = [n for n, part in enumerate(kind.parts) if part.shape == "box"]
    assert high[boxed, 1].max() == pytest.approx(size[1] / 2)
    assert low.min(axis=0)[2] == pytest.approx(0.0, abs=1e-9)
