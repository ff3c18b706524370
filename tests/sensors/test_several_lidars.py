"""Returns of several LiDARs: each from its own place, all told in the frame of the first."""

from contextlib import closing

import numpy as np
import pytest

from care_sim.core.cells.stack import GridStack
from care_sim.core.conditions import ReturnSettings, Sensing
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.types import Scan
from care_sim.perception.proxy import ReturnsRule
from care_sim.sensors.annotated import Cloud, cloud_of
from care_sim.sensors.beams import Beams
from care_sim.sensors.engines import ENGINES, make_engine
from care_sim.sensors.lidar import CellFaults, Crosstalk, Lidar, RecordedLidar
from care_sim.sensors.surround import full_sweep
from care_sim.world.bodies import CATALOGUE, BodyKind, Part
from care_sim.world.bullet import NO_BODY, BulletWorld
from care_sim.world.motions import LinearMotion
from tests.helpers.lidars import DEGREE, STACK

SENSOR = Frame(3.0, -2.0, 1.84, 0.6)
EVERY_CELL = np.arange(STACK.size)
TRUCK = BodyKind("truck", None, (0.4, 4.0, 4.0), (
    Part("box", (0.4, 4.0, 4.0), (0.0, 0.0, 2.0), (0.5,) * 3),
))  # fmt: skip
PERSON = BodyKind("person", None, (0.4, 0.4, 4.0), (
    Part("box", (0.4, 0.4, 4.0), (0.0, 0.0, 2.0), (0.5,) * 3),
))  # fmt: skip
STRAIGHT = AngularGrid(63, 3, DEGREE, -DEGREE, field_of_view=63 * DEGREE)
"""Its middle cell looks straight ahead."""
MIDDLE = 63 + 31
PAIR = GridStack((STRAIGHT, STRAIGHT), ((0.0, 0.0, 0.0), (0.5, 3.0, -0.4)))
"""The second stands 3 m to the left of the first, and half a metre ahead of it."""
every_engine = pytest.mark.parametrize("engine", sorted(ENGINES))


@pytest.fixture
def hidden(bullet):
    """A person 20 m ahead and 3 m to the left, and a truck half-way, before the first LiDAR."""
    bullet.add(TRUCK, (10.0, 0.0, 0.0))
    person = bullet.add(PERSON, (20.0, 3.0, 0.0))
    return bullet, person


@pytest.fixture
def street(bullet):
    for name, pose in {
        "bus": (15.0, 4.0, 0.3),
        "car": (9.5, -4.0, 1.2),
        "adult": (8.0, 1.0, 0.0),
    }.items():
        bullet.add(CATALOGUE[name], pose)
    return bullet


@every_engine
def test_only_the_second_lidar_sees_who_is_behind_the_truck(hidden, engine):
    """Straight ahead of it the person's near side is 20 - 0.2 - 0.5 = 19.3 m away."""
    world, person = hidden
    sensor = Frame(0.0, 0.0, 1.84, 0.0)
    rays = make_engine(engine, world, PAIR)
    cells = np.arange(PAIR.size)
    ranges, bodies = rays.cast(sensor, cells)
    (met,) = np.nonzero(bodies == person)
    assert len(met) >= 2
    assert (met >= STRAIGHT.size).all()
    straight = STRAIGHT.size + MIDDLE
    assert ranges[straight] == pytest.approx(19.3, abs=1e-3)
    assert ranges[MIDDLE] == pytest.approx(9.8, abs=1e-3)

    # The points that a detector is given of it lie on the person, in the frame of the first LiDAR.
    cloud = cloud_of(Scan(cells, ranges), bodies, PAIR)
    points = cloud.points[cloud.objects == person]
    assert points[cloud.cells[cloud.objects == person] == straight][0] == pytest.approx(
        [19.8, 3.0, -0.4], abs=1e-3
    )
    assert (np.abs(points[:, :2] - [20.0, 3.0]) <= 0.2 + 1e-3).all()

    # And the proxy counts it, whichever LiDAR fired.
    lidar = Lidar(PAIR, rays, Sensing(), np.random.SeedSequence(0))
    assert lidar.hits(person, cells, sensor) == len(met)
    assert lidar.hits(person, cells[: STRAIGHT.size], sensor) == 0
    boxes = np.array([[20.0, 3.0, 0.16, 0.4, 0.4, 4.0, 0.0]])
    _, found = ReturnsRule({person: 0}, 2).detections(bodies, lambda ids: boxes[: len(ids)])
    assert found.tolist() == [person]


@every_engine
def test_each_casts_as_if_it_were_alone_where_it_stands(street, engine):
    ranges, bodies = make_engine(engine, street, STACK).cast(SENSOR, EVERY_CELL)
    for head in STACK.heads:
        x, y, z = SENSOR.origin + SENSOR.vectors_to_world(np.array(head.place))
        own = ENGINES[engine](street, head.grid).cast(
            Frame(x, y, z, SENSOR.yaw), np.arange(head.grid.size)
        )
        assert np.array_equal(ranges[head.cells], own[0])
        assert np.array_equal(bodies[head.cells], own[1])
    assert len({*bodies.tolist()} - {NO_BODY, street.ground}) == 3


def test_a_full_sweep_holds_every_return_at_its_place():
    """Casting every cell of every LiDAR finds the same; the road is a plane of its own."""
    poses = {"bus": (15.0, 4.0, 0.3), "car": (4.5, -4.0, 1.2), "pedestrian": (-9.0, 3.0, 0.0)}
    with closing(BulletWorld(ground=False)) as world:
        for name, pose in poses.items():
            world.add(CATALOGUE[name], pose)
        boxes = np.array(
            [
                [x, y, CATALOGUE[n].size[2] / 2, *CATALOGUE[n].size, yaw]
                for n, (x, y, yaw) in poses.items()
            ]
        )
        cloud = full_sweep(world, STACK, SENSOR, SENSOR.boxes_to_local(boxes), 1.84)
        ranges, bodies = make_engine("bullet", world, STACK).cast(SENSOR, EVERY_CELL)
    hit = cloud.objects != NO_BODY
    assert np.array_equal(cloud.cells[hit], np.flatnonzero(np.isfinite(ranges)))
    assert np.array_equal(cloud.objects[hit], bodies[cloud.cells[hit]])
    assert np.array_equal(
        cloud.points[hit], STACK.points(cloud.cells[hit], ranges[cloud.cells[hit]])
    )
    # All road lies in one plane, however high the LiDAR that met it stands.
    assert (~hit).sum() > 100
    assert cloud.points[~hit][:, 2] == pytest.approx(-1.84)
    assert {*np.searchsorted([512, 768], cloud.cells[~hit], side="right").tolist()} == {0, 1, 2}


@every_engine
@pytest.mark.parametrize(
    "settings",
    [
        {"lidar_stated_range_m": 40.0},
        {"lidar_divergence_mrad": 6.0, "lidar_returns": "both"},
    ],
)
def test_beams_are_as_bright_and_as_wide_as_those_of_each_alone(street, engine, settings):
    def cast(grid, sensor):
        beams = Beams(street, grid, ReturnSettings(**settings), engine, None)
        return beams.cast(sensor, np.arange(grid.size))

    scan, bodies = cast(STACK, SENSOR)
    for head in STACK.heads:
        own, met = cast(head.grid, head.frame(SENSOR))
        here = (scan.cells >= head.first) & (scan.cells < head.cells.stop)
        assert np.array_equal(scan.cells[here] - head.first, own.cells)
        assert np.array_equal(scan.ranges[here], own.ranges)
        assert np.array_equal(scan.intensities[here], own.intensities)
        assert np.array_equal(bodies[here], met)


@every_engine
def test_the_motion_of_the_ego_is_compensated_for_every_lidar(bullet, engine):
    """A wall that leans across the way of a car that turns: every point lies on its face as it
    stands at the keyframe.
    """
    kind = BodyKind("wall", None, (0.2, 60.0, 6.0), (
        Part("box", (0.2, 60.0, 6.0), (0.0, 0.0, 3.0), (0.5,) * 3),
    ))  # fmt: skip
    wall = bullet.add(kind, (20.0, 0.0, 0.3))
    ego = (SENSOR.x, SENSOR.y, SENSOR.yaw)
    rates = np.zeros((len(bullet.primitives.poses), 3))
    motion = LinearMotion(ego, np.array([15.0, 3.0, 0.5]), rates)
    settings = ReturnSettings(lidar_sweep_s=0.1, lidar_compensated=True)
    beams = Beams(bullet, STACK, settings, engine, lambda: motion)
    scan, bodies = beams.cast(SENSOR, EVERY_CELL)
    points = beams.compensated(scan, SENSOR).points[bodies == wall]
    cells = scan.cells[bodies == wall]
    assert all(((cells >= h.first) & (cells < h.cells.stop)).sum() > 20 for h in STACK.heads)
    world = SENSOR.origin + SENSOR.vectors_to_world(points)
    off = (world[:, 0] - 20.0) * np.cos(0.3) + world[:, 1] * np.sin(0.3)
    assert off == pytest.approx(np.full(len(off), -0.1), abs=2e-3)


def test_faults_keep_to_the_reach_of_each_lidar():
    faults = CellFaults(
        STACK, Sensing(lidar_range_sigma=30.0, lidar_dead_rows=(9,)), np.random.SeedSequence(0)
    )
    measured = faults.draw_noisy(np.full(STACK.size, 45.0), EVERY_CELL)
    assert measured[:512].max() < 50.0
    assert 50.0 < measured[512:].max() < 80.0
    # Row 9 is the second of the second LiDAR.
    assert np.array_equal(np.flatnonzero(faults.dead), np.arange(9 * 64, 10 * 64))

    jammed = Crosstalk(STACK, ReturnSettings(lidar_crosstalk=1.0), np.random.SeedSequence(0))
    nothing = Scan(EVERY_CELL, np.full(STACK.size, np.inf))
    ghosts, _ = jammed.add_to_scan(nothing, np.full(STACK.size, NO_BODY))
    assert 40.0 < ghosts.ranges[:512].max() < 50.0
    assert 70.0 < ghosts.ranges[512:].max() < 80.0
    empty = Cloud(EVERY_CELL[:0], np.empty((0, 3)), EVERY_CELL[:0])
    cloud = jammed.add_to_cloud(empty, np.ones(STACK.size, bool))
    found = STACK.ranges_to(cloud.cells, cloud.points)
    assert (found[cloud.cells < 512] < 50.0).all()
    assert found[cloud.cells >= 512].max() > 60.0


def test_a_recorded_return_is_as_far_as_it_is_from_its_own_lidar():
    cells = np.array([5, 700, 1000])
    cloud = Cloud(cells, STACK.points(cells, np.array([10.0, 20.0, 30.0])), np.full(3, -1))
    quiet = RecordedLidar(STACK, Sensing(), np.random.SeedSequence(0))
    assert quiet.ranges(cloud)[cells] == pytest.approx([10.0, 20.0, 30.0])
    noisy = RecordedLidar(STACK, Sensing(lidar_range_sigma=0.5), np.random.SeedSequence(0))
    moved = noisy.fire(EVERY_CELL, cloud)
    assert not np.allclose(moved.points, cloud.points, atol=0.01)
    # Along its own ray.
    assert moved.points == pytest.approx(STACK.points(cells, STACK.ranges_to(cells, moved.points)))
