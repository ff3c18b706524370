"""Bodies at any height, roll and pitch, sensors that tilt, and worlds without a ground plane."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.frames import Frame
from care_sim.core.types import CLASSES
from care_sim.sensors.pictures import FRONT_CAMERA
from care_sim.world.bodies import CATALOGUE, sized
from care_sim.world.bullet import NO_BODY, BulletWorld

FORWARD = np.array([[1.0, 0.0, 0.0]])


def test_a_body_stands_at_any_height(bullet):
    bus = bullet.add(CATALOGUE["bus"], Frame(30.0, 0.0, 100.0, 0.0))
    heights = [99.9, 100.1, 103.4, 103.5]
    assert [bullet.cast([0.0, 0.0, z], FORWARD, 50.0)[1][0] for z in heights] == [
        NO_BODY,
        bus,
        bus,
        NO_BODY,
    ]


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


def test_a_rolled_box_leans_to_its_right(bullet):
    slab = sized("slab", None, (4.0, 0.2, 3.0))
    bullet.add(slab, Frame(10.0, 0.0, 0.0, 0.0, roll=0.3))
    up, out = 2.8 * np.cos(0.3), -2.8 * np.sin(0.3)
    hits = [bullet.cast([0.0, y, up], FORWARD, 50.0)[1][0] != NO_BODY for y in (out, -out)]
    assert hits == [True, False]


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


def test_a_world_without_ground_returns_nothing_from_below():
    world = BulletWorld(ground=False)
    try:
        ranges, ids = world.cast([0.0, 0.0, 1.84], np.array([[0.0, 0.0, -1.0]]), 50.0)
        assert (ranges[0], ids[0], world.ground) == (np.inf, NO_BODY, NO_BODY)
    finally:
        world.close()


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


def test_the_catalogue_s_own_size_gives_the_catalogue_s_own_parts():
    for label in CLASSES:
        for mine, theirs in zip(
            sized("x", label, CATALOGUE[label].size).parts, CATALOGUE[label].parts, strict=True
        ):
            assert mine.size == pytest.approx(theirs.size)
            assert mine.centre == pytest.approx(theirs.centre)
