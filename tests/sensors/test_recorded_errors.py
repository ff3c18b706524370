"""Losses and errors of recorded sweeps, on clouds with known answers."""

import numpy as np
import pytest

from care_sim.core.grid import AngularGrid
from care_sim.core.types import CLASSES
from care_sim.sensors.annotated import NO_OBJECT, Cloud
from care_sim.sensors.recorded_errors import MOST_SIGMAS, PASSED, SLOPE, add_recorded_losses, slopes

GRID = AngularGrid()
NOBODY = np.empty(0, np.int64), np.empty(0)


def ball(range_m, objects=NO_OBJECT):
    """Every cell above the car returns from one range."""
    cells = np.arange(GRID.size)[GRID.elevations[np.arange(GRID.size) // GRID.columns] > -0.34]
    points = GRID.points(cells, np.full(len(cells), range_m))
    return Cloud(cells, points, np.full(len(cells), objects))


def nothing(cells):
    return ball(1.0).take(np.zeros(len(ball(1.0)), bool))


def worn(cloud, objects=NOBODY, behind=nothing):
    return add_recorded_losses(cloud, GRID, objects, behind, np.random.default_rng(0))


@pytest.mark.parametrize(("range_m", "lost"), [(8.0, 0.02), (18.5, 0.075), (40.0, 0.13)])
def test_the_share_that_is_lost_grows_with_range(range_m, lost):
    cloud = ball(range_m)
    assert 1 - len(worn(cloud)) / len(cloud) == pytest.approx(lost, abs=0.006)


@pytest.mark.parametrize(("range_m", "sigma"), [(8.0, 0.0053), (25.0, 0.008)])
def test_ranges_err_along_the_ray_and_stay_within_reach(range_m, sigma):
    kept = worn(ball(range_m))
    ranges = np.linalg.norm(kept.points, axis=1)
    assert ranges.std() == pytest.approx(sigma, rel=0.05)
    assert np.array_equal(GRID.cells_of(kept.points), kept.cells)
    assert np.linalg.norm(worn(ball(50.0)).points, axis=1).max() <= 50.0


def test_an_object_loses_what_its_class_and_its_surface_make_it_lose():
    label = CLASSES.index("car")
    cloud = ball(15.0, objects=0)
    for bright, kept in ((0.0, 0.53), (1.0, 0.78), (-1.0, 0.28)):
        objects = np.array([label]), np.array([bright])
        assert len(worn(cloud, objects)) / len(cloud) == pytest.approx(kept, abs=0.02)


def test_of_the_rays_that_an_object_does_not_return_its_share_returns_from_behind():
    def wall(cells):
        assert (np.diff(cells) > 0).all()
        return Cloud(cells, GRID.points(cells, np.full(len(cells), 30.0)), NO_OBJECT * cells**0)

    for name, kept in (("car", 0.53), ("pedestrian", 0.54)):
        cloud = ball(15.0, objects=0)
        made = worn(cloud, (np.array([CLASSES.index(name)]), np.zeros(1)), wall)
        ranges = np.linalg.norm(made.points, axis=1)
        assert (np.diff(made.cells) > 0).all()
        assert np.array_equal(made.objects == NO_OBJECT, ranges > 29)
        shares = np.mean(ranges < 16), np.mean(ranges > 29)
        expected = np.array([kept, (1 - kept) * PASSED[name]]) * len(cloud) / len(made)
        assert shares == pytest.approx(expected, abs=0.02)


def test_luck_is_that_of_the_cell_whatever_else_returns():
    whole, part = ball(30.0), ball(30.0).take(np.arange(len(ball(30.0))) % 3 == 0)
    kept = worn(whole)
    again = worn(part)
    shared = np.isin(kept.cells, part.cells)
    assert np.array_equal(kept.cells[shared], again.cells)
    assert np.array_equal(kept.points[shared], again.points)


def test_the_car_hides_the_road_in_the_lowest_rows():
    cells = np.arange(GRID.size - GRID.columns, GRID.size)
    cloud = Cloud(cells, GRID.points(cells, np.full(512, 3.6)), np.full(512, NO_OBJECT))
    assert len(worn(cloud)) < 0.3 * 512


def test_slopes_change_along_the_way_and_are_bounded():
    ego = np.column_stack([np.linspace(0, 120, 40), np.zeros(40), np.zeros(40)])
    tilts = np.array([slopes(ego, np.random.default_rng(seed)) for seed in range(60)])
    assert (np.abs(tilts) <= MOST_SIGMAS * np.array(SLOPE)).all()
    assert tilts.std(axis=(0, 1)) == pytest.approx(SLOPE, rel=0.25)
    assert (np.ptp(tilts, axis=1) > 0.01).any(axis=1).all()
