"""The LiDAR whose full scan was recorded: five returns made by hand, two of them in one cell."""

from dataclasses import replace

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import ReturnSettings, Sensing
from care_sim.core.frames import Frame
from care_sim.core.types import Scan
from care_sim.sensors.annotated import NO_OBJECT, Cloud
from care_sim.sensors.engines import ENGINES, check_engine
from care_sim.sensors.lidar import (
    CellFaults,
    Crosstalk,
    Lidar,
    RecordedLidar,
    check_dead_rows,
    crosstalk_of,
    noisy,
)
from care_sim.world.bodies import CATALOGUE

SENSOR = Frame(0.0, 0.0, 1.84, 0.0)


@pytest.fixture
def street(bullet):
    bullet.add(CATALOGUE["bus"], (12.0, 4.0, 0.0))
    bullet.add(CATALOGUE["trailer"], (-15.0, 0.0, np.pi / 2))
    bullet.add(CATALOGUE["car"], (8.0, -3.0, 0.5))
    return bullet


@pytest.fixture(params=sorted(ENGINES))
def engine(request):
    """The name of every engine in turn."""
    return request.param


@pytest.fixture
def lidar(engine):
    """Makes a LiDAR over a world, with noise."""

    def make(grid, bullet, seed=0, **noise):
        return Lidar(
            grid, ENGINES[engine](bullet, grid), Sensing(**noise), np.random.SeedSequence(seed)
        )

    return make


def everything(grid):
    return np.arange(grid.size)


def test_a_scan_of_some_cells_is_that_part_of_the_full_scan(grid, street, lidar):
    full, full_bodies = lidar(grid, street).fire(everything(grid), SENSOR)
    cells = np.sort(np.random.default_rng(1).choice(grid.size, 500, replace=False))
    part, bodies = lidar(grid, street).fire(cells, SENSOR)
    assert part.cells.tolist() == cells.tolist()
    assert np.array_equal(part.ranges, full.ranges[cells])
    assert np.array_equal(bodies, full_bodies[cells])


def test_range_noise_has_its_spread_and_leaves_misses_alone(grid, street, lidar):
    clean, _ = lidar(grid, street).fire(everything(grid), SENSOR)
    noisy, _ = lidar(grid, street, lidar_range_sigma=0.05).fire(everything(grid), SENSOR)
    hit = np.isfinite(clean.ranges)
    errors = noisy.ranges[hit] - clean.ranges[hit]
    assert np.isinf(noisy.ranges[~hit]).all()
    assert errors.std() == pytest.approx(0.05, rel=0.1)
    assert errors.mean() == pytest.approx(0, abs=0.01)


def test_dropout_loses_its_share_of_returns_with_their_bodies(grid, street, lidar):
    clean, _ = lidar(grid, street).fire(everything(grid), SENSOR)
    noisy, bodies = lidar(grid, street, lidar_dropout=0.3).fire(everything(grid), SENSOR)
    hit = np.isfinite(clean.ranges)
    assert np.isinf(noisy.ranges[hit]).mean() == pytest.approx(0.3, abs=0.05)
    assert np.array_equal(bodies == -1, np.isinf(noisy.ranges))
    kept = np.isfinite(noisy.ranges)
    assert np.array_equal(noisy.ranges[kept], clean.ranges[kept])


def test_noise_is_added_where_there_is_room_and_folded_back_at_the_ends():
    ranges = np.array([20.0, 49.9, 0.2, 49.9, 0.2, 30.0])
    errors = np.array([0.5, 0.05, -0.1, 0.3, -0.5, 49.98 + 49.98])
    assert noisy(ranges, errors, 50.0) == pytest.approx([20.5, 49.95, 0.1, 49.78, 0.32, 30.0])
    assert noisy(ranges, errors, 50.0)[:3].tolist() == (ranges + errors)[:3].tolist()


def test_a_peek_sees_no_more_than_live_rows_can_return(grid, street, lidar):
    peeked = lidar(grid, street, lidar_dead_rows=(9, 12), lidar_dropout=0.5).peek(SENSOR)
    fired, _ = lidar(grid, street, lidar_dead_rows=(9, 12)).fire(everything(grid), SENSOR)
    assert np.array_equal(peeked.ranges, fired.ranges)


def test_noise_of_a_cell_does_not_depend_on_which_others_fire(grid, street, lidar):
    noise = {"lidar_range_sigma": 0.1, "lidar_dropout": 0.3}
    everywhere, here = lidar(grid, street, **noise), lidar(grid, street, **noise)
    cells = np.arange(7000, 9000, 3)
    for _ in range(3):
        full, part = everywhere.fire(everything(grid), SENSOR)[0], here.fire(cells, SENSOR)[0]
        assert np.array_equal(part.ranges, full.ranges[cells])


def test_a_dead_row_fires_and_returns_nothing(grid, street, lidar):
    clean, _ = lidar(grid, street).fire(everything(grid), SENSOR)
    scan, bodies = lidar(grid, street, lidar_dead_rows=(9, 12)).fire(everything(grid), SENSOR)
    dead = np.isin(np.arange(grid.size) // grid.columns, (9, 12))
    assert np.isfinite(clean.ranges[dead]).any()
    assert np.isinf(scan.ranges[dead]).all()
    assert np.all(bodies[dead] == -1)
    assert np.array_equal(scan.ranges[~dead], clean.ranges[~dead])


def test_a_row_that_the_grid_lacks_cannot_be_dead(grid):
    with pytest.raises(InvalidInput, match=r"lidar_dead_rows must lie in 0\.\.31, got 32"):
        check_dead_rows(grid, (32,))


def test_an_unknown_engine_is_refused_with_the_known_ones():
    for name in ENGINES:
        check_engine(name)
    with pytest.raises(InvalidInput, match=r"engine 'warp'.*bullet"):
        check_engine("warp")


CELLS = np.array([100, 100, 700, 9000, 16000])
RANGES = np.array([7.0, 12.0, 30.0, 5.0, 49.999])
OBJECTS = np.array([4, 9, 4, NO_OBJECT, 4])


@pytest.fixture(scope="module")
def cloud(grid):
    return Cloud(CELLS, grid.directions[CELLS] * RANGES[:, None], OBJECTS)


def recorded(grid, seed=0, **faults):
    return RecordedLidar(grid, Sensing(**faults), np.random.SeedSequence(seed))


def test_only_fired_cells_return_and_all_that_fell_in_them(grid, cloud):
    returned = recorded(grid).fire(np.array([9000, 3, 100]), cloud)
    assert returned.cells.tolist() == [100, 100, 9000]
    assert returned.objects.tolist() == [4, 9, NO_OBJECT]
    assert np.array_equal(returned.points, cloud.points[[0, 1, 3]])
    assert len(recorded(grid).fire(np.array([], np.int64), cloud)) == 0


def test_of_several_returns_in_a_cell_the_nearest_is_its_range(grid, cloud):
    ranges = recorded(grid).ranges(cloud)
    assert ranges[[100, 700, 9000]] == pytest.approx([7, 30, 5])
    assert np.count_nonzero(np.isfinite(ranges)) == 4


def test_dead_rows_return_nothing_to_scan_or_peek(grid, cloud):
    """Cells 100 and 700 lie in the two highest rows of 512 columns."""
    broken = recorded(grid, lidar_dead_rows=(0, 1))
    assert broken.fire(everything(grid), cloud).cells.tolist() == [9000, 16000]
    assert broken.peek(cloud).cells.tolist() == [9000, 16000]
    with pytest.raises(InvalidInput, match=r"lidar_dead_rows must lie in 0\.\.31, got 32"):
        recorded(grid, lidar_dead_rows=(32,))


def full(grid, range_m=20.0):
    """A return in every cell."""
    return Cloud(everything(grid), grid.directions * range_m, np.full(grid.size, 1))


def test_noise_moves_points_along_their_rays_by_its_spread(grid):
    noisy = recorded(grid, lidar_range_sigma=0.2).fire(everything(grid), full(grid))
    ranges = np.linalg.norm(noisy.points, axis=1)
    assert noisy.points == pytest.approx(grid.directions * ranges[:, None])
    assert (ranges.mean(), ranges.std()) == pytest.approx((20.0, 0.2), rel=0.03)


def test_every_choice_of_cells_meets_the_same_noise_and_dropout(grid):
    """At the second keyframe too, whatever was fired at the first."""
    some = np.arange(0, grid.size, 3)
    faults = {"lidar_dropout": 0.3, "lidar_range_sigma": 0.2}
    first, second = recorded(grid, **faults), recorded(grid, **faults)
    first.fire(everything(grid), full(grid))
    second.fire(some[:5], full(grid))
    second.peek(full(grid))
    whole, part = first.fire(everything(grid), full(grid)), second.fire(some, full(grid))
    assert part.cells.tolist() == np.intersect1d(whole.cells, some).tolist()
    assert np.array_equal(part.points, whole.take(np.isin(whole.cells, some)).points)


def test_far_returns_have_the_same_faults_and_leave_the_near_ones_as_they_are(grid):
    """At the second keyframe too: noise of their own, folded back at the reach, and the dropout of
    their cell.
    """
    near = full(grid)
    far = replace(full(grid, 90.0), objects=np.full(grid.size, NO_OBJECT))
    edge = replace(far, points=grid.directions * 50.1)
    faults = {"lidar_range_sigma": 0.2, "lidar_dropout": 0.3, "lidar_crosstalk": 0.1}
    alone, both, folded = (
        [lidar.fire(everything(grid), cloud) for _ in range(2)][1]
        for lidar, cloud in (
            (recorded(grid, **faults), cloud)
            for cloud in (near, replace(near, far=far), replace(near, far=edge))
        )
    )
    assert np.array_equal(alone.points, both.points)
    own = both.objects != NO_OBJECT
    assert np.array_equal(both.far.cells, both.cells[own])
    ranges = np.linalg.norm(both.far.points, axis=1)
    assert (ranges.mean(), ranges.std()) == pytest.approx((90.0, 0.2), rel=0.03)
    errors = np.linalg.norm(both.points[own], axis=1) - 20.0
    assert abs(np.corrcoef(errors, ranges)[0, 1]) < 0.05
    assert np.linalg.norm(folded.far.points, axis=1).min() >= grid.range_m


def crosstalk(grid, rate, seed=0):
    return Crosstalk(grid, ReturnSettings(lidar_crosstalk=rate), np.random.SeedSequence(seed))


def silent(cells):
    """A scan without a return, and the bodies behind it."""
    scan = Scan(cells, np.full(len(cells), np.inf), np.zeros(len(cells)))
    return scan, np.full(len(cells), -1)


@pytest.mark.parametrize("rate", [0.0, 0.02, 0.5, 1.0])
def test_a_share_of_the_cells_has_a_ghost(grid, rate):
    scan, bodies = crosstalk(grid, rate).add_to_scan(*silent(np.arange(grid.size)))
    ghosts = np.isfinite(scan.ranges)
    assert ghosts.mean() == pytest.approx(rate, abs=0.015)
    assert np.array_equal(scan.intensities, ghosts)
    assert (bodies == -1).all()


def test_ghosts_are_anywhere_within_reach(grid):
    scan, _ = crosstalk(grid, 1.0).add_to_scan(*silent(np.arange(grid.size)))
    counts, _ = np.histogram(scan.ranges, bins=10, range=(0, grid.range_m))
    assert 0 < scan.ranges.min() < scan.ranges.max() < grid.range_m
    assert counts == pytest.approx(np.full(10, grid.size / 10), rel=0.1)


def test_ghosts_change_from_keyframe_to_keyframe_and_not_with_what_fires(grid):
    one, other = crosstalk(grid, 0.3), crosstalk(grid, 0.3)
    cells = np.arange(0, grid.size, 5)
    keyframes = []
    for _ in range(3):
        full, _ = one.add_to_scan(*silent(np.arange(grid.size)))
        part, _ = other.add_to_scan(*silent(cells))
        assert np.array_equal(part.ranges, full.ranges[cells])
        keyframes.append(np.isfinite(full.ranges))
    assert 0.4 < (keyframes[0] == keyframes[1]).mean() < 0.7


def test_recorded_clouds_have_the_same_ghosts(grid):
    """The cells of a cloud with a return each, of which every third answers."""
    cells = np.arange(0, grid.size, 2)
    cloud = Cloud(cells, grid.directions[cells] * 7.0, np.zeros(len(cells), np.int64))
    answering = np.arange(grid.size) % 3 == 0
    haunted = crosstalk(grid, 0.3).add_to_cloud(cloud.take(answering[cells]), answering)
    scan, _ = crosstalk(grid, 0.3).add_to_scan(*silent(np.arange(grid.size)))
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
    noise = Crosstalk(grid, sensing, np.random.SeedSequence(4)).add_to_scan(*nothing)[0]
    dropout = Crosstalk(grid, sensing, np.random.SeedSequence(4).spawn(1)[0]).add_to_scan(*nothing)[
        0
    ]
    CellFaults(grid, sensing, seed)
    own = crosstalk_of(grid, sensing, seed).add_to_scan(*nothing)[0]
    for other in (noise, dropout):
        both = np.isfinite(own.ranges) & np.isfinite(other.ranges)
        assert both.mean() == pytest.approx(0.09, abs=0.01)
