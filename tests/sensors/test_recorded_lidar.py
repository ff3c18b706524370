"""The LiDAR whose full scan was recorded: five returns made by hand, two of them in one cell."""

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import Sensing
from care_sim.sensors.annotated import NO_OBJECT, Cloud
from care_sim.sensors.lidar import RecordedLidar

CELLS = np.array([100, 100, 700, 9000, 16000])
RANGES = np.array([7.0, 12.0, 30.0, 5.0, 49.999])
OBJECTS = np.array([4, 9, 4, NO_OBJECT, 4])


@pytest.fixture(scope="module")
def cloud(grid):
    return Cloud(CELLS, grid.directions[CELLS] * RANGES[:, None], OBJECTS)


def lidar(grid, seed=0, **faults):
    return RecordedLidar(grid, Sensing(**faults), np.random.SeedSequence(seed))


def everything(grid):
    return np.arange(grid.size)


def test_only_fired_cells_return_and_all_that_fell_in_them(grid, cloud):
    returned = lidar(grid).fire(np.array([9000, 3, 100]), cloud)
    assert returned.cells.tolist() == [100, 100, 9000]
    assert returned.objects.tolist() == [4, 9, NO_OBJECT]
    assert np.array_equal(returned.points, cloud.points[[0, 1, 3]])
    assert len(lidar(grid).fire(np.array([], np.int64), cloud)) == 0


def test_of_several_returns_in_a_cell_the_nearest_is_its_range(grid, cloud):
    ranges = lidar(grid).ranges(cloud)
    assert ranges[[100, 700, 9000]] == pytest.approx([7, 30, 5])
    assert np.count_nonzero(np.isfinite(ranges)) == 4


def test_dead_rows_return_nothing_to_scan_or_peek(grid, cloud):
    """Cells 100 and 700 lie in the two highest rows of 512 columns."""
    broken = lidar(grid, lidar_dead_rows=(0, 1))
    assert broken.fire(everything(grid), cloud).cells.tolist() == [9000, 16000]
    assert broken.peek(cloud).cells.tolist() == [9000, 16000]
    with pytest.raises(InvalidInput, match=r"lidar_dead_rows must lie in 0\.\.31, got 32"):
        lidar(grid, lidar_dead_rows=(32,))


def full(grid, range_m=20.0):
    """A return in every cell."""
    return Cloud(everything(grid), grid.directions * range_m, np.full(grid.size, 1))


def test_the_share_lost_is_the_dropout(grid):
    left = len(lidar(grid, lidar_dropout=0.3).fire(everything(grid), full(grid)))
    assert left / grid.size == pytest.approx(0.7, abs=0.015)


def test_noise_moves_points_along_their_rays_by_its_spread(grid):
    noisy = lidar(grid, lidar_range_sigma=0.2).fire(everything(grid), full(grid))
    ranges = np.linalg.norm(noisy.points, axis=1)
    assert noisy.points == pytest.approx(grid.directions * ranges[:, None])
    assert (ranges.mean(), ranges.std()) == pytest.approx((20.0, 0.2), rel=0.03)


@pytest.mark.parametrize(("range_m", "least", "most"), [(49.9, 49.0, 49.99), (0.05, 0.01, 1.0)])
def test_noise_leaves_a_return_a_return(grid, range_m, least, most):
    """Neither at 0 m, which reads as not fired, nor at the reach, which reads as no return."""
    ranges = np.linalg.norm(
        lidar(grid, lidar_range_sigma=0.2).fire(everything(grid), full(grid, range_m)).points,
        axis=1,
    )
    assert ranges.min() >= least - 1e-9
    assert ranges.max() <= most + 1e-9
    assert len(np.unique(np.round(ranges, 9))) > 0.99 * len(ranges), (
        "cut, they would heap up at one number"
    )


def test_every_choice_of_cells_meets_the_same_noise_and_dropout(grid):
    """At the second keyframe too, whatever was fired at the first."""
    some = np.arange(0, grid.size, 3)
    faults = {"lidar_dropout": 0.3, "lidar_range_sigma": 0.2}
    first, second = lidar(grid, **faults), lidar(grid, **faults)
    first.fire(everything(grid), full(grid))
    second.fire(some[:5], full(grid))
    second.peek(full(grid))
    whole, part = first.fire(everything(grid), full(grid)), second.fire(some, full(grid))
    assert part.cells.tolist() == np.intersect1d(whole.cells, some).tolist()
    assert np.array_equal(part.points, whole.take(np.isin(whole.cells, some)).points)


@pytest.mark.parametrize("fault", ["lidar_dropout", "lidar_range_sigma"])
def test_noise_and_dropout_are_seeded(grid, fault):
    one, same, other = (
        lidar(grid, seed, **{fault: 0.3}).fire(everything(grid), full(grid)) for seed in (1, 1, 2)
    )
    assert np.array_equal(one.points, same.points)
    assert not np.array_equal(one.points, other.points)


def test_the_recording_stays_as_it_is(grid, cloud):
    before = cloud.points.copy()
    lidar(grid, lidar_range_sigma=0.5).fire(everything(grid), cloud)
    assert np.array_equal(cloud.points, before)
