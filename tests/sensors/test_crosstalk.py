import numpy as np
import pytest

from care_sim.core.conditions import ReturnSettings, Sensing
from care_sim.core.frames import Frame
from care_sim.core.types import Scan
from care_sim.sensors.annotated import NO_OBJECT, Cloud
from care_sim.sensors.engines import ENGINES
from care_sim.sensors.lidar import Lidar, RecordedLidar
from care_sim.sensors.lidar_faults import CellFaults, Crosstalk, crosstalk_of
from care_sim.world.bodies import CATALOGUE

SENSOR = Frame(0.0, 0.0, 1.84, 0.0)


def crosstalk(grid, rate, seed=0):
    return Crosstalk(grid, ReturnSettings(lidar_crosstalk=rate), np.random.SeedSequence(seed))


def silent(cells):
    """A scan without a return, and the bodies behind it."""
    scan = Scan(cells, np.full(len(cells), np.inf), np.zeros(len(cells)))
    return scan, np.full(len(cells), -1)


@pytest.mark.parametrize("rate", [0.0, 0.02, 0.5, 1.0])
def test_a_share_of_the_cells_has_a_ghost(grid, rate):
    scan, bodies = crosstalk(grid, rate).over_scan(*silent(np.arange(grid.size)))
    ghosts = np.isfinite(scan.ranges)
    assert ghosts.mean() == pytest.approx(rate, abs=0.015)
    assert np.array_equal(scan.intensities, ghosts)
    assert (bodies == -1).all()


def test_ghosts_are_anywhere_within_reach(grid):
    scan, _ = crosstalk(grid, 1.0).over_scan(*silent(np.arange(grid.size)))
    counts, _ = np.histogram(scan.ranges, bins=10, range=(0, grid.range_m))
    assert 0 < scan.ranges.min() < scan.ranges.max() < grid.range_m
    assert counts == pytest.approx(np.full(10, grid.size / 10), rel=0.1)


def test_a_ghost_takes_the_place_of_a_return_and_of_its_body(grid):
    cells = np.arange(grid.size)
    scan = Scan(cells, np.full(grid.size, 7.0))
    haunted, bodies = crosstalk(grid, 0.5).over_scan(scan, np.full(grid.size, 3))
    assert np.array_equal(haunted.ranges != 7.0, bodies == -1)


def test_ghosts_change_from_keyframe_to_keyframe_and_not_with_what_fires(grid):
    one, other = crosstalk(grid, 0.3), crosstalk(grid, 0.3)
    cells = np.arange(0, grid.size, 5)
    keyframes = []
    for _ in range(3):
        full, _ = one.over_scan(*silent(np.arange(grid.size)))
        part, _ = other.over_scan(*silent(cells))
        assert np.array_equal(part.ranges, full.ranges[cells])
        keyframes.append(np.isfinite(full.ranges))
    assert 0.4 < (keyframes[0] == keyframes[1]).mean() < 0.7


def test_recorded_clouds_have_the_same_ghosts(grid):
    """The cells of a cloud with a return each, of which every third answers."""
    cells = np.arange(0, grid.size, 2)
    cloud = Cloud(cells, grid.directions[cells] * 7.0, np.zeros(len(cells), np.int64))
    answering = np.arange(grid.size) % 3 == 0
    haunted = crosstalk(grid, 0.3).over_cloud(cloud.take(answering[cells]), answering)
    scan, _ = crosstalk(grid, 0.3).over_scan(*silent(np.arange(grid.size)))
    ghosts = np.isfinite(scan.ranges) & answering
    assert (np.diff(haunted.cells) > 0).all()
    assert np.array_equal(haunted.cells[haunted.objects == NO_OBJECT], np.flatnonzero(ghosts))
    ranges = np.linalg.norm(haunted.points, axis=1)
    assert ranges[haunted.objects == NO_OBJECT] == pytest.approx(scan.ranges[ghosts])
    assert ranges[haunted.objects == 0] == pytest.approx(7.0)


def test_crosstalk_leaves_noise_and_dropout_as_they_are(grid, bullet):
    """Neither a dead row nor a cell whose return drops out has a ghost."""
    bullet.add(CATALOGUE["bus"], (12.0, 4.0, 0.0))
    faults = {"lidar_range_sigma": 0.1, "lidar_dropout": 0.3, "lidar_dead_rows": (9, 20)}
    cells = np.arange(grid.size)
    engine = ENGINES["fast"](bullet, grid)
    (plain, bodies), (haunted, found) = (
        Lidar(grid, engine, Sensing(**faults, **given), np.random.SeedSequence(4)).fire(
            cells, SENSOR
        )
        for given in ({}, {"lidar_crosstalk": 0.2})
    )
    same = haunted.ranges == plain.ranges
    assert 0.1 < (~same).mean() < 0.2
    assert np.array_equal(found[same], bodies[same])
    assert not np.isfinite(haunted.ranges[np.isin(cells // grid.columns, (9, 20))]).any()


def test_ghosts_have_a_stream_of_their_own(grid):
    """Neither that of the noise nor, drawn at the same rate, that of the dropout."""
    sensing = Sensing(lidar_crosstalk=0.3, lidar_dropout=0.3)
    nothing = silent(np.arange(grid.size))
    seed = np.random.SeedSequence(4)
    noise = Crosstalk(grid, sensing, np.random.SeedSequence(4)).over_scan(*nothing)[0]
    dropout = Crosstalk(grid, sensing, np.random.SeedSequence(4).spawn(1)[0]).over_scan(*nothing)[0]
    CellFaults(grid, sensing, seed)
    own = crosstalk_of(grid, sensing, seed).over_scan(*nothing)[0]
    for other in (noise, dropout):
        both = np.isfinite(own.ranges) & np.isfinite(other.ranges)
        assert both.mean() == pytest.approx(0.09, abs=0.01)


def test_a_recorded_lidar_draws_ghosts_in_cells_that_fire(grid):
    nothing = Cloud(np.empty(0, np.int64), np.empty((0, 3)), np.empty(0, np.int64))
    lidar = RecordedLidar(grid, Sensing(lidar_crosstalk=0.5), np.random.SeedSequence(0))
    cells = np.arange(100, 200)
    haunted = lidar.fire(cells, nothing)
    assert 30 < len(haunted) < 70
    assert np.isin(haunted.cells, cells).all()
    assert not len(lidar.peek(nothing))
