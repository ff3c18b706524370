import numpy as np
import pytest

from care_sim.core.conditions import ReturnSettings
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.sensors.annotated import cloud_of
from care_sim.sensors.beams import Beams, RollingSweep
from care_sim.sensors.engines import ENGINES
from care_sim.world.bodies import BodyKind, Part
from care_sim.world.motions import LinearMotion

SENSOR = Frame(0.0, 0.0, 1.84, 0.0)
WALL = BodyKind("wall", None, (0.2, 30.0, 6.0), (
    Part("box", (0.2, 30.0, 6.0), (0.0, 0.0, 3.0), (0.5,) * 3),
))  # fmt: skip
POST = BodyKind("post", None, (0.4, 0.4, 4.0), (
    Part("box", (0.4, 0.4, 4.0), (0.0, 0.0, 2.0), (0.5,) * 3),
))  # fmt: skip
LEVEL_ROW = 8
"""The row at 0 degrees."""
every_engine = pytest.mark.parametrize("engine", sorted(ENGINES))


def beams(world, grid, engine, ego=(0.0, 0.0, 0.0), bodies=None, **settings):
    rates = np.zeros((len(world.primitives.poses), 3))
    for body, moves in (bodies or {}).items():
        rates[body] = moves
    motion = LinearMotion((0.0, 0.0, 0.0), np.array(ego, float), rates)
    sweep = ReturnSettings(lidar_sweep_s=0.1, **settings)
    return Beams(world, grid, sweep, engine, lambda: motion)


def column_at(grid, azimuth):
    return int(np.argmin(np.abs(grid.azimuths - azimuth)))


@pytest.mark.parametrize("columns", [512, 100, 7])
def test_every_cell_fires_once_and_in_the_sweep(columns):
    grid = AngularGrid(columns=columns)
    cells = np.arange(0, grid.size, 3)
    sweep = RollingSweep(grid, 0.1)
    seconds, parts = zip(*sweep.instants(cells), strict=True)
    assert sorted(np.concatenate(parts).tolist()) == list(range(len(cells)))
    told = sweep.seconds(cells)
    for instant, part in zip(seconds, parts, strict=True):
        assert (told[part] == instant).all()
    # Its own instant is that of the middle of its column, and that of its group is near.
    own = -0.1 * (cells % columns + 0.5) / columns
    assert np.abs(told - own).max() <= 0.1 / min(columns, 64) / 2
    assert -0.1 < told.min() < told.max() < 0


def test_the_sensor_turns_to_the_right_from_behind_to_behind(grid):
    left, ahead, right = (
        RollingSweep(grid, 0.1).seconds(np.array([column_at(grid, azimuth)])).item()
        for azimuth in (np.pi / 2, 0.0, -np.pi / 2)
    )
    assert [left, ahead, right] == pytest.approx([-0.075, -0.05, -0.025], abs=1e-3)


@every_engine
def test_where_nothing_moves_a_sweep_is_a_scan(bullet, grid, engine):
    bullet.add(WALL, (20.0, 0.0, 0.3))
    cells = np.arange(grid.size)
    ranges, bodies = ENGINES[engine](bullet, grid).cast(SENSOR, cells)
    scan, met = beams(bullet, grid, engine).cast(SENSOR, cells)
    assert np.array_equal(scan.ranges, ranges)
    assert np.array_equal(met, bodies)


@every_engine
def test_ahead_the_way_of_half_a_sweep_is_added(bullet, grid, engine):
    """A wall ahead whose face is at 19.9 m; the ego came 20 m/s times 0.05 s nearer since."""
    bullet.add(WALL, (20.0, 0.0, 0.0))
    cell = np.array([LEVEL_ROW * grid.columns + column_at(grid, 0.0)])
    scan, _ = beams(bullet, grid, engine, ego=(20.0, 0.0, 0.0)).cast(SENSOR, cell)
    assert scan.ranges == pytest.approx([19.9 + 20 * -scan.times.item()], abs=2e-3)
    assert scan.times == pytest.approx([-0.05], abs=1e-3)


@every_engine
def test_who_crosses_is_seen_where_it_was(bullet, grid, engine):
    """10 m ahead, 8 m/s to the left: 0.4 m further right than it is at the keyframe."""
    post = bullet.add(POST, (10.0, 0.0, 0.0))
    cells = LEVEL_ROW * grid.columns + np.arange(grid.columns)
    scan, met = beams(bullet, grid, engine, bodies={post: (0.0, 8.0, 0.0)}).cast(SENSOR, cells)
    hit = met == post
    sides = (grid.directions[cells][hit] * scan.ranges[hit, None])[:, 1]
    assert sides.mean() == pytest.approx(-0.4, abs=0.07)


@every_engine
def test_a_sweep_leaves_the_world_as_it_was(bullet, grid, engine):
    post = bullet.add(POST, (10.0, 0.0, 0.4))
    before = bullet.primitives.poses.copy()
    cells = np.arange(grid.size)
    first = bullet.cast(SENSOR.origin, grid.directions, 50.0)
    beams(bullet, grid, engine, bodies={post: (3.0, 8.0, 1.0)}).cast(SENSOR, cells)
    assert np.array_equal(bullet.primitives.poses, before)
    for one, other in zip(first, bullet.cast(SENSOR.origin, grid.directions, 50.0), strict=True):
        assert np.array_equal(one, other)


def off_the_wall(bullet, grid, **settings):
    """How far returns lie from the face of a wall 20 m ahead; the ego drives and turns."""
    wall = bullet.add(WALL, (20.0, 0.0, 0.0))
    cast = beams(bullet, grid, "fast", ego=(15.0, 1.0, 0.4), **settings)
    scan, met = cast.cast(SENSOR, np.arange(grid.size))
    cloud = cloud_of(cast.compensated(scan, SENSOR), met, grid)
    assert (cloud.times < 0).all()
    return np.abs(cloud.points[cloud.objects == wall, 0] - 19.9)


def test_compensated_points_of_what_stands_lie_on_it(bullet, grid):
    assert off_the_wall(bullet, grid, lidar_compensated=True).max() < 1e-9


def test_without_compensation_they_are_smeared(bullet, grid):
    """By what 15 m/s drive in the 30 to 70 ms since the sensor looked there, and by the turn."""
    apart = off_the_wall(bullet, grid)
    assert 0.3 < apart.min() < apart.max() < 1.2
