import numpy as np
import pytest
from scipy import ndimage

from care_sim.core.frames import Frame
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.sensor_setup import LIDAR_POSITION
from care_sim.sensors.pictures import FRONT_CAMERA
from care_sim.world.bodies import CATALOGUE
from care_sim.world.bullet import NO_BODY, BulletWorld

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


def test_nothing_within_reach_is_infinitely_far(bullet):
    bullet.add(BLOCK, (40.0, 0.0, 0.0))
    ranges, ids = bullet.cast([0.0, 0.0, 1.0], FORWARD, 33.9)
    assert (ranges[0], ids[0]) == (np.inf, NO_BODY)
    assert bullet.cast([0.0, 0.0, 1.0], FORWARD, 34.1)[0][0] == pytest.approx(40 - 12.01 / 2)


def test_the_nearer_body_hides_the_farther_one(bullet):
    far = bullet.add(BLOCK, (30.0, 0.0, 0.0))
    near = bullet.add(CATALOGUE["car"], (10.0, 0.0, 0.0))
    assert bullet.cast([0.0, 0.0, 0.5], FORWARD, 50.0)[1].tolist() == [near]
    assert bullet.cast([0.0, 0.0, 3.0], FORWARD, 50.0)[1].tolist() == [far]


@pytest.mark.parametrize("count", [1, 8192, 8193, 16_383, 16_384, 16_385, 20_000])
def test_every_ray_of_any_number_is_answered_in_its_place(bullet, count):
    body = bullet.add(BLOCK, (20.0, 0.0, np.pi / 2))
    directions = np.tile([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], (count // 2 + 1, 1))[:count]
    ranges, ids = bullet.cast([0.0, 0.0, 1.0], directions, 50.0)
    ahead = np.arange(count) % 2 == 0
    assert len(ranges) == len(ids) == count
    assert np.array_equal(ids, np.where(ahead, body, NO_BODY))
    assert np.allclose(ranges[ahead], NEAR_SIDE)


def test_no_rays_no_answers(bullet):
    ranges, ids = bullet.cast([0.0, 0.0, 1.0], np.empty((0, 3)), 50.0)
    assert len(ranges) == len(ids) == 0


def test_rays_pass_through_the_transparent_ego_and_keep_doing_so_when_it_moves(bullet):
    ego = bullet.add(CATALOGUE["ego"], (0.0, 0.0, 0.0), transparent=True)
    bus = bullet.add(CATALOGUE["bus"], (20.0, 0.0, 0.0))
    assert bullet.cast([-10.0, 0.0, 0.5], FORWARD, 50.0)[1].tolist() == [bus]
    bullet.move(ego, (5.0, 0.0, 0.3))
    assert bullet.cast([-10.0, 0.0, 0.5], FORWARD, 50.0)[1].tolist() == [bus]


def test_a_moved_body_is_where_it_was_put(bullet):
    body = bullet.add(BLOCK, (20.0, 0.0, 0.0))
    bullet.move(body, (30.0, 0.0, np.pi / 2))
    assert bullet.cast([0.0, 0.0, 1.0], FORWARD, 50.0)[0][0] == pytest.approx(10 + NEAR_SIDE)


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


@pytest.mark.parametrize("ground", [True, False])
def test_ids_count_from_the_ground_on(ground):
    world = BulletWorld(ground)
    bodies = [world.add(CATALOGUE["car"], (10.0 * n, 0.0, 0.0)) for n in range(3)]
    assert bodies == [ground + n for n in range(3)]
    world.close()


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


def test_rays_know_of_bodies_moved_together(bullet):
    bodies = np.array(
        [bullet.add(BLOCK, (20.0, 0.0, np.pi / 2)), bullet.add(BLOCK, (30.0, 0.0, np.pi / 2))]
    )
    bullet.move_all(bodies, np.array([[40.0, 0.0, np.pi / 2], [10.0, 0.0, np.pi / 2]]))
    ranges, ids = bullet.cast([0.0, 0.0, 1.0], FORWARD, 50.0)
    assert ids.tolist() == [bodies[1]]
    assert ranges[0] == pytest.approx(NEAR_SIDE - 10.0)


def test_the_ground_returns_rays(bullet):
    down = np.array([[np.cos(0.3), 0.0, -np.sin(0.3)]])
    ranges, ids = bullet.cast([0.0, 0.0, 1.84], down, 50.0)
    assert ids.tolist() == [bullet.ground]
    assert ranges[0] == pytest.approx(1.84 / np.sin(0.3))


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


def test_an_empty_street_shows_no_body(bullet):
    picture = bullet.body_ids(FRONT_CAMERA, Frame(0, 0, 1.84, 0))
    assert set(picture.ravel().tolist()) <= {NO_BODY, bullet.ground}
    assert set(picture[:80].ravel().tolist()) == {NO_BODY}


def test_left_is_left_in_the_picture(bullet):
    body = bullet.add(CATALOGUE["car"], (15.0, 5.0, 0.0))
    rows, columns = np.nonzero(bullet.body_ids(FRONT_CAMERA, Frame(0, 0, 1.84, 0)) == body)
    assert columns.max() < 160
    assert rows.min() > 85


def test_colours_are_a_picture_of_the_same_view(bullet):
    bullet.add(CATALOGUE["pedestrian"], (6.0, 0.0, 0.0))
    colours = bullet.colours(FRONT_CAMERA, Frame(0, 0, 1.84, 0))
    assert colours.shape == (180, 320, 3)
    assert colours.std() > 5


@pytest.mark.parametrize("gap", [0.0, 0.25, 3.0, 20.0])
def test_clearance_between_bumpers(bullet, gap):
    ego = bullet.add(CATALOGUE["ego"], (0.0, 0.0, 0.0), transparent=True)
    bus = bullet.add(CATALOGUE["bus"], (2.04 + gap + 11.19 / 2, 0.0, 0.0))
    assert bullet.clearance(ego, bus) == pytest.approx(gap, abs=2e-3)
    assert bullet.clearance(bus, ego) == pytest.approx(gap, abs=2e-3)


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


def test_closing_twice_is_harmless_and_leaves_other_worlds_alone(bullet):
    other = BulletWorld()
    bus = other.add(CATALOGUE["bus"], (20.0, 0.0, 0.0))
    bullet.close()
    bullet.close()
    assert other.cast([0.0, 0.0, 1.0], FORWARD, 50.0)[1].tolist() == [bus]
    other.close()
