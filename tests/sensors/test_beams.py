import numpy as np
import pytest

from care_sim.core.conditions import ReturnSettings, Sensing
from care_sim.core.frames import Frame
from care_sim.sensors.beams import Beams
from care_sim.sensors.engines import ENGINES
from care_sim.sensors.lidar import Lidar
from care_sim.world.bodies import CATALOGUE

SENSOR = Frame(0.0, 0.0, 1.84, 0.3)
STATED = {"lidar_stated_range_m": 40.0}


@pytest.fixture(params=sorted(ENGINES))
def engine(request):
    return request.param


@pytest.fixture
def street(bullet):
    bullet.add(CATALOGUE["bus"], (12.0, 4.0, 0.0))
    bullet.add(CATALOGUE["car"], (25.0, -3.0, 0.5))
    bullet.add(CATALOGUE["adult"], (20.0, 1.0, 0.0))
    return bullet


def standing():
    raise AssertionError("without a sweep nobody asks how the world moves")


def cast(world, grid, engine, **settings):
    beams = Beams(world, grid, ReturnSettings(**settings), engine, standing)
    return beams.cast(SENSOR, np.arange(grid.size))


def test_what_returns_is_a_part_of_what_rays_meet(street, grid, engine):
    ranges, bodies = ENGINES[engine](street, grid).cast(SENSOR, np.arange(grid.size))
    scan, found = cast(street, grid, engine, **STATED)
    kept = np.isfinite(scan.ranges)
    assert 0 < kept.sum() < np.isfinite(ranges).sum()
    assert np.array_equal(scan.ranges[kept], ranges[kept])
    assert np.array_equal(found, np.where(kept, bodies, -1))
    assert (scan.intensities[kept] > 0).all()
    assert not scan.intensities[~kept].any()


def test_the_road_is_lost_where_it_is_met_too_flat(street, grid, engine):
    """0.17 h / r^3 falls below 0.1 / 40^2 at r^3 = 0.17 * 1.84 * 16000: 17.1 m."""
    scan, found = cast(street, grid, engine, **STATED)
    road = found == street.ground
    assert scan.ranges[road].max() <= (0.17 * 1.84 * 16000) ** (1 / 3)
    assert scan.ranges[road].max() > 14


def test_fog_hides_the_far_ones_first(street, grid, engine):
    clear = cast(street, grid, engine, **STATED)[0]
    fog = cast(street, grid, engine, **STATED, visibility_m=50.0)[0]
    thick = cast(street, grid, engine, **STATED, visibility_m=20.0)[0]
    counts = [np.isfinite(scan.ranges).sum() for scan in (clear, fog, thick)]
    assert counts[0] > counts[1] > counts[2] > 0
    assert thick.ranges[np.isfinite(thick.ranges)].max() < 12


def test_a_sensor_that_reaches_far_enough_loses_nothing(street, grid, engine):
    ranges, bodies = ENGINES[engine](street, grid).cast(SENSOR, np.arange(grid.size))
    scan, found = cast(street, grid, engine, lidar_stated_range_m=10_000.0)
    assert np.array_equal(scan.ranges, ranges)
    assert np.array_equal(found, bodies)


def test_cells_return_the_same_alone_and_among_others(street, grid, engine):
    full, bodies = cast(street, grid, engine, **STATED)
    cells = np.arange(5, grid.size, 7)
    beams = Beams(street, grid, ReturnSettings(**STATED), engine, standing)
    part, found = beams.cast(SENSOR, cells)
    assert np.array_equal(part.ranges, full.ranges[cells])
    assert np.array_equal(part.intensities, full.intensities[cells])
    assert np.array_equal(found, bodies[cells])


def lidar(world, grid, **faults):
    sensing = Sensing(**STATED, **faults)
    beams = Beams(world, grid, sensing, "fast", standing)
    engine = ENGINES["fast"](world, grid)
    return Lidar(grid, engine, sensing, np.random.SeedSequence(0), beams)


def test_faults_come_on_top_of_what_returns(street, grid):
    cells = np.arange(grid.size)
    whole, _ = lidar(street, grid).fire(cells, SENSOR)
    broken = lidar(street, grid, lidar_dropout=0.5, lidar_dead_rows=(9,), lidar_range_sigma=0.1)
    scan, bodies = broken.fire(cells, SENSOR)
    lost = np.isinf(scan.ranges)
    assert lost[np.isinf(whole.ranges)].all()
    assert 0.4 < (~lost).sum() / np.isfinite(whole.ranges).sum() < 0.6
    assert not scan.intensities[lost].any()
    assert (bodies[lost] == -1).all()
    assert np.array_equal(scan.intensities[~lost], whole.intensities[~lost])


def test_truth_is_what_would_return(street, grid):
    """The bound of the reward, and what privileged policies are told."""
    one = lidar(street, grid)
    cells = np.arange(grid.size)
    scan, bodies = one.fire(cells, SENSOR)
    assert np.array_equal(one.peek(SENSOR).ranges, scan.ranges)
    assert one.hits(bodies.max(), cells, SENSOR) == np.count_nonzero(bodies == bodies.max())
