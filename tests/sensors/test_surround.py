import numpy as np
import pytest

from care_sim.film import NOBODY
from care_sim.frames import Frame
from care_sim.sensors.surround import SURROUND_CAMERAS, full_sweep, look_around, numbers_of
from care_sim.world.bodies import CATALOGUE

SENSOR = Frame(3.0, -2.0, 1.84, 0.6, roll=0.03, pitch=-0.02)


def test_every_direction_lies_in_some_picture():
    """From 5 m on; nearer by, the places of the cameras leave gaps, as in the real car."""
    for azimuth in np.linspace(-np.pi, np.pi, 720):
        point = np.array([5 * np.cos(azimuth), 5 * np.sin(azimuth), -0.3])
        shown = [camera.project(point) for camera in SURROUND_CAMERAS]
        assert any(d > 0 and 0 <= u <= 320 and 0 <= v <= 180 for (u, v), d in shown)


def test_the_ring_is_as_wide_as_nuscenes_says():
    degrees = [(round(np.rad2deg(c.yaw)), round(np.rad2deg(c.horizontal_fov))) for c in SURROUND_CAMERAS]
    assert degrees == [(0, 70), (55, 70), (-55, 70), (110, 70), (-110, 70), (180, 110)]


def test_a_full_sweep_holds_every_return_at_its_place(bullet, grid):
    body = bullet.add(CATALOGUE["bus"], (15.0, 4.0, 0.3))
    cloud = full_sweep(bullet, grid, SENSOR)
    ranges, bodies = bullet.cast(SENSOR.origin, SENSOR.vectors_to_world(grid.directions), grid.range_m)
    assert np.array_equal(cloud.cells, np.flatnonzero(np.isfinite(ranges)))
    assert np.linalg.norm(cloud.points, axis=1) == pytest.approx(ranges[cloud.cells])
    assert np.array_equal(cloud.objects, bodies[cloud.cells])
    ground = SENSOR.origin + SENSOR.vectors_to_world(cloud.points[cloud.objects == bullet.ground])
    assert ground[:, 2] == pytest.approx(0.0, abs=1e-6)
    assert body in cloud.objects


def test_cameras_report_labelled_bodies_alone(bullet):
    bus, van = bullet.add(CATALOGUE["bus"], (20.0, -2.0, 0.0)), bullet.add(CATALOGUE["van"], (-15.0, -2.0, 0.0))
    boxes = SENSOR.boxes_to_local(
        np.array([[20.0, -2.0, 1.7, *CATALOGUE["bus"].size, 0.0], [-15.0, -2.0, 1.2, *CATALOGUE["van"].size, 0.0]])
    )
    sights = look_around(bullet, SURROUND_CAMERAS, SENSOR, {bus: 2}, boxes)
    assert set(sights.objects.tolist()) == {bus}
    assert set(sights.detections.classes.tolist()) == {2}
    both = look_around(bullet, SURROUND_CAMERAS, SENSOR, {bus: 2, van: 1}, boxes)
    assert set(both.objects.tolist()) == {bus, van}
    assert numbers_of(both.objects, {bus: 7}).tolist() == [7 if b == bus else NOBODY for b in both.objects]
