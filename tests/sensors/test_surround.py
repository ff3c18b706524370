from contextlib import closing

import numpy as np
import pytest

from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.sensors.engines import Bullet
from care_sim.sensors.surround import (
    SURROUND_CAMERAS,
    View,
    full_sweep,
    numbers_of,
    surround_detections,
)
from care_sim.world.bodies import CATALOGUE
from care_sim.world.bullet import NO_BODY, BulletWorld

SENSOR = Frame(3.0, -2.0, 1.84, 0.6, roll=0.03, pitch=-0.02)


def test_every_direction_lies_in_some_picture():
    """From 5 m on; nearer by, the places of the cameras leave gaps, as in the real car."""
    for azimuth in np.linspace(-np.pi, np.pi, 720):
        point = np.array([5 * np.cos(azimuth), 5 * np.sin(azimuth), -0.3])
        shown = [camera.project(point) for camera in SURROUND_CAMERAS]
        assert any(d > 0 and 0 <= u <= 320 and 0 <= v <= 180 for (u, v), d in shown)


@pytest.fixture
def bare():
    """A world without ground."""
    with closing(BulletWorld(ground=False)) as world:
        yield world


def test_a_full_sweep_holds_every_return_at_its_place(bare, grid):
    """Casting at every cell finds the same, also from a sensor that leans."""
    poses = {
        "bus": (15.0, 4.0, 0.3),
        "car": (4.5, -4.0, 1.2),
        "building": (0.0, -30.0, 0.0),
        "pedestrian": (-9.0, 3.0, 0),
    }
    for name, pose in poses.items():
        bare.add(CATALOGUE[name], pose)
    boxes = np.array(
        [
            [x, y, CATALOGUE[n].size[2] / 2, *CATALOGUE[n].size, yaw]
            for n, (x, y, yaw) in poses.items()
        ]
    )
    for sensor in (SENSOR, Frame(3.0, -2.0, 1.84, 0.6)):
        cloud = full_sweep(bare, grid, sensor, sensor.boxes_to_local(boxes), 1.84)
        ranges, bodies = bare.cast(
            sensor.origin, sensor.vectors_to_world(grid.directions), grid.range_m
        )
        hit = cloud.objects != NO_BODY
        assert np.array_equal(cloud.cells[hit], np.flatnonzero(np.isfinite(ranges)))
        assert np.array_equal(cloud.objects[hit], bodies[cloud.cells[hit]])
        assert np.linalg.norm(cloud.points[hit], axis=1) == pytest.approx(ranges[cloud.cells[hit]])
        assert set(bodies.tolist()) == {NO_BODY, *range(len(poses))}


def test_the_road_is_where_a_ground_plane_would_be_hit(bullet, grid):
    upright = Frame(3.0, -2.0, 1.84, 0.6)
    with closing(BulletWorld(ground=False)) as bare:
        cloud = full_sweep(bare, grid, upright, np.empty((0, 7)), 1.84)
    ranges, _ = bullet.cast(upright.origin, upright.vectors_to_world(grid.directions), grid.range_m)
    assert np.array_equal(cloud.cells, np.flatnonzero(np.isfinite(ranges)))
    assert np.linalg.norm(cloud.points, axis=1) == pytest.approx(ranges[cloud.cells], abs=1e-9)
    assert set(cloud.objects.tolist()) == {NO_BODY}


def test_cameras_report_labelled_bodies_alone(bullet):
    bus, van = (
        bullet.add(CATALOGUE["bus"], (20.0, -2.0, 0.0)),
        bullet.add(CATALOGUE["van"], (-15.0, -2.0, 0.0)),
    )
    boxes = SENSOR.boxes_to_local(
        np.array(
            [
                [20.0, -2.0, 1.7, *CATALOGUE["bus"].size, 0.0],
                [-15.0, -2.0, 1.2, *CATALOGUE["van"].size, 0.0],
            ]
        )
    )
    views = [View(camera, SENSOR) for camera in SURROUND_CAMERAS]
    engine = Bullet(bullet, AngularGrid())
    identified = surround_detections(engine, views, SENSOR, {bus: 2}, boxes)
    assert set(identified.objects.tolist()) == {bus}
    assert set(identified.detections.classes.tolist()) == {2}
    both = surround_detections(
        Bullet(bullet, AngularGrid()), views, SENSOR, {bus: 2, van: 1}, boxes
    )
    assert set(both.objects.tolist()) == {bus, van}
    assert numbers_of(both.objects, {bus: 7}).tolist() == [
        7 if b == bus else NO_OBJECT for b in both.objects
    ]
