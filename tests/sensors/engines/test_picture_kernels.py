"""The engine fast draws what PyBullet's renderer draws."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.pinhole import PinholeCamera
from care_sim.sensors.engines import Bullet, Fast
from care_sim.sensors.engines.picture_kernels import visible_boxes
from care_sim.sensors.pictures import FRONT_CAMERA, Picture
from care_sim.world.bodies import CATALOGUE, BodyKind, Part
from care_sim.world.body_tables import directions, polyhedron
from care_sim.world.bullet import NO_BODY, BulletWorld

SENSOR = Frame(0.0, 0.0, 1.84, 0.0)
CROOKED = PinholeCamera(400, 220, 1.2, (0.5, 0.1, -0.2), 0.3, 0.05, 0.1)
WHOLE = (0, 0, 320, 180)


def whole(camera):
    return 0, 0, camera.width, camera.height


def drawn(world, camera=FRONT_CAMERA, sensor=SENSOR, window=None):
    grid = AngularGrid()
    engines = Bullet(world, grid), Fast(world, grid)
    return [engine.body_ids(camera, sensor, window or whole(camera)) for engine in engines]


def crowd(seed, bodies=14):
    """A world of bodies anywhere, also around the camera and behind it, and a sensor in it."""
    rng = np.random.default_rng(seed)
    world = BulletWorld()
    kinds = list(CATALOGUE.values())
    for _ in range(bodies):
        kind = kinds[rng.integers(len(kinds))]
        x, y, z, yaw, roll, pitch = rng.uniform(
            (-10, -20, 0, -3, -0.3, -0.3), (60, 20, 1, 3, 0.3, 0.3)
        )
        world.add(kind, Frame(x, y, z, yaw, roll, pitch) if rng.random() < 0.3 else (x, y, yaw))
    upright = rng.random() < 0.5
    return world, SENSOR if upright else Frame(
        0, 0, 1.84, rng.uniform(-3, 3), *rng.normal(0, 0.1, 2)
    )


def test_pictures_of_crowds_are_the_same():
    """All but single pixels on outlines, where PyBullet's single precision decides; every box to
    one pixel.
    """
    shown, different = 0, 0
    for seed in range(60):
        world, sensor = crowd(seed)
        reference, picture = drawn(world, (FRONT_CAMERA, CROOKED)[seed % 2], sensor)
        world.close()
        shown += np.count_nonzero(reference != NO_BODY)
        different += np.count_nonzero(reference != picture)
        expected, found = Picture.of(reference), Picture.of(picture)
        if set(expected.bodies) == set(found.bodies):
            assert np.abs(expected.boxes - found.boxes).max(initial=0) <= 1
        else:
            odd = np.setxor1d(expected.bodies, found.bodies)
            assert all(
                np.isin(seen.bodies, odd) @ seen.pixels <= 1 for seen in (expected, found)
            ), seed
    assert shown > 1_000_000
    assert different / shown < 1e-5


@pytest.mark.parametrize("shape", ["box", "cylinder", "sphere"])
@pytest.mark.parametrize("x", [1.2, 3.0, 15.0])
def test_a_primitive_near_and_far(bullet, shape, x):
    size = (1.0, 1.0, 1.4 if shape != "sphere" else 1.0)
    bullet.add(
        BodyKind("one", None, size, (Part(shape, size, (0.0, 0.0, 1.5), (1, 0, 0)),)), (x, 0.3, 0.7)
    )
    reference, picture = drawn(bullet)
    assert np.count_nonzero(reference != NO_BODY) > 50
    assert np.count_nonzero(reference != picture) <= 1


def test_what_stands_in_front_hides(bullet):
    person = bullet.add(CATALOGUE["pedestrian"], (25.0, 0.0, 0.0))
    assert person in drawn(bullet)[1]
    bullet.add(CATALOGUE["trailer"], (12.0, 0.0, np.pi / 2))
    assert person not in drawn(bullet)[1]


def test_transparent_bodies_backdrops_and_the_road_have_no_look(bullet):
    bullet.add(CATALOGUE["car"], (10.0, 0.0, 0.0), transparent=True)
    bullet.add(CATALOGUE["building"], (30.0, 0.0, 0.0), backdrop=True)
    assert set(drawn(bullet)[1].ravel().tolist()) == {NO_BODY}


def test_a_camera_inside_a_body_looks_through_it(bullet):
    inside, beyond = (
        bullet.add(CATALOGUE["building"], (0.0, 0.0, 0.0)),
        bullet.add(CATALOGUE["car"], (20.0, 0.0, 0.0)),
    )
    reference, picture = drawn(bullet)
    assert np.array_equal(reference, picture)
    assert beyond in picture
    assert inside not in picture


def test_a_moved_body_is_seen_where_it_was_put(bullet):
    body = bullet.add(CATALOGUE["car"], (15.0, 5.0, 0.0))
    engine = Fast(bullet, AngularGrid())
    left = np.nonzero(engine.body_ids(FRONT_CAMERA, SENSOR, WHOLE) == body)[1]
    bullet.move(body, (15.0, -5.0, 0.0))
    right = np.nonzero(engine.body_ids(FRONT_CAMERA, SENSOR, WHOLE) == body)[1]
    assert left.max() < 160 < right.min()


def test_a_window_is_cut_out_of_the_picture(bullet):
    for n in range(5):
        bullet.add(CATALOGUE["car"], (10.0 + 3 * n, 2.0 * n - 4, 0.5 * n))
    left, top, right, bottom = window = (60, 40, 201, 120)
    _, all_of_it = drawn(bullet)
    reference, part = drawn(bullet, window=window)
    assert np.array_equal(part, all_of_it[top:bottom, left:right])
    assert np.array_equal(part, reference)
    assert drawn(bullet, window=(0, 0, 0, 0))[1].size == 0


@pytest.mark.parametrize("window", [WHOLE, (60, 40, 201, 120), (0, 0, 0, 0)])
def test_the_boxes_are_those_of_the_picture(window):
    """Read off row by row, half-hidden bodies of many parts among them."""
    boxes = 0
    for seed in range(20):
        world, sensor = crowd(seed)
        engine = Fast(world, AngularGrid())
        left, top, _, _ = window
        expected = visible_boxes(engine.body_ids(FRONT_CAMERA, sensor, window))
        expected += [0, left, top, left, top, 0]
        seen = engine.visible_boxes(FRONT_CAMERA, sensor, window)
        world.close()
        assert seen.tolist() == expected.tolist()
        boxes += len(seen)
    assert boxes > 40 or window == (0, 0, 0, 0)


def test_polyhedra_are_closed():
    """Euler: corners - edges + faces = 2."""
    for shape, size in (
        ("box", (1.0, 2.0, 3.0)),
        ("cylinder", (0.2, 0.2, 0.8)),
        ("sphere", (0.3, 0.3, 0.3)),
    ):
        corners, faces, edges = polyhedron(shape, size)
        assert len(corners) - len(edges) + len(faces) == 2
        assert np.allclose(np.linalg.norm(faces[:, :3], axis=1), 1)
        assert (corners @ faces[:, :3].T <= faces[:, 3] + 1e-9).all()
    assert len(polyhedron("box", (1.0, 2.0, 3.0))[1]) == 6


def test_directions_are_spread_over_the_sphere():
    cosines = directions() @ directions().T
    np.fill_diagonal(cosines, -1)
    assert len(directions()) == 42
    assert np.allclose(np.linalg.norm(directions(), axis=1), 1)
    assert np.allclose(np.rad2deg(np.arccos(cosines.max(axis=1))), 31.717, atol=0.01)


@given(
    arrays(np.int64, st.tuples(st.integers(0, 5), st.integers(0, 6)), elements=st.integers(-1, 3))
)
def test_a_box_holds_all_pixels_of_its_body_and_no_other_line(ids):
    expected = []
    for body in range(4):
        rows, columns = np.nonzero(ids == body)
        if len(rows):
            corners = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
            expected.append([body, *corners, len(rows)])
    assert visible_boxes(ids).tolist() == expected
