from dataclasses import fields

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import Sensing
from care_sim.core.frames import Frame
from care_sim.core.types import Scan
from care_sim.sensors.engines import ENGINES, check_engine
from care_sim.sensors.lidar import Lidar
from care_sim.sensors.lidar_faults import check_dead_rows, noisy
from care_sim.world.bodies import CATALOGUE

SENSOR = Frame(0.0, 0.0, 1.84, 0.0)


class Watched:
    """Passes cells on to an engine and keeps them."""

    def __init__(self, engine):
        self.engine, self.cells = engine, []

    def cast(self, sensor, cells):
        self.cells.append(cells)
        return self.engine.cast(sensor, cells)


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


def test_only_the_fired_cells_are_cast(grid, street, engine):
    watched = Watched(ENGINES[engine](street, grid))
    cells = np.array([5, 300, 9000, 16383])
    Lidar(grid, watched, Sensing(), np.random.SeedSequence(0)).fire(cells, SENSOR)
    assert [cast.tolist() for cast in watched.cells] == [cells.tolist()]


def test_a_scan_of_some_cells_is_that_part_of_the_full_scan(grid, street, lidar):
    full, full_bodies = lidar(grid, street).fire(everything(grid), SENSOR)
    cells = np.sort(np.random.default_rng(1).choice(grid.size, 500, replace=False))
    part, bodies = lidar(grid, street).fire(cells, SENSOR)
    assert part.cells.tolist() == cells.tolist()
    assert np.array_equal(part.ranges, full.ranges[cells])
    assert np.array_equal(bodies, full_bodies[cells])


def test_a_full_scan_answers_every_cell(grid, street, lidar):
    scan, bodies = lidar(grid, street).fire(everything(grid), SENSOR)
    assert len(scan.ranges) == len(bodies) == 16384
    assert len(set(bodies.tolist()) - {-1, street.ground}) == 3


def test_returns_lie_on_the_bodies_they_hit(grid, street, lidar):
    bus = street.add(CATALOGUE["bus"], (5.0, 20.0, 1.0))
    scan, bodies = lidar(grid, street).fire(everything(grid), SENSOR)
    hit = bodies == bus
    points = SENSOR.origin + scan.ranges[hit, None] * grid.directions[hit]
    local = Frame(5.0, 20.0, 3.47 / 2, 1.0).boxes_to_local(
        np.hstack([points, np.zeros((hit.sum(), 4))])
    )[:, :3]
    assert hit.sum() > 50
    assert np.all(np.abs(local) <= np.array([11.19, 2.94, 3.47]) / 2 + 1e-3)
    assert np.abs(np.abs(local) / (np.array([11.19, 2.94, 3.47]) / 2)).max(axis=1) == pytest.approx(
        1, abs=1e-3
    )


def test_the_scan_turns_with_the_sensor(grid, street, lidar):
    trailer_behind = lidar(grid, street).fire(np.array([8 * 512]), SENSOR)[1]
    turned_round = lidar(grid, street).fire(np.array([8 * 512 + 256]), Frame(0, 0, 1.84, np.pi))[1]
    assert trailer_behind.tolist() == turned_round.tolist()
    assert trailer_behind[0] not in (-1, street.ground)


def test_a_scan_carries_no_body_ids():
    assert [field.name for field in fields(Scan)] == [
        "cells",
        "ranges",
        "intensities",
        "times",
        "points",
    ]


def test_without_noise_the_generator_does_not_matter(grid, street, lidar):
    one, other = (lidar(grid, street, seed).fire(everything(grid), SENSOR) for seed in (0, 1))
    assert np.array_equal(one[0].ranges, other[0].ranges)
    assert np.array_equal(one[1], other[1])


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


def test_total_dropout_returns_nothing(grid, street, lidar):
    scan, bodies = lidar(grid, street, lidar_dropout=1.0).fire(everything(grid), SENSOR)
    assert np.isinf(scan.ranges).all()
    assert np.all(bodies == -1)


def test_noise_does_not_move_what_drops_out(grid, street, lidar):
    plain, _ = lidar(grid, street, lidar_dropout=0.3).fire(everything(grid), SENSOR)
    noisy, _ = lidar(grid, street, lidar_dropout=0.3, lidar_range_sigma=0.1).fire(
        everything(grid), SENSOR
    )
    assert np.array_equal(np.isinf(plain.ranges), np.isinf(noisy.ranges))


def test_noise_is_added_where_there_is_room_and_folded_back_at_the_ends():
    ranges = np.array([20.0, 49.9, 0.2, 49.9, 0.2, 30.0])
    errors = np.array([0.5, 0.05, -0.1, 0.3, -0.5, 49.98 + 49.98])
    assert noisy(ranges, errors, 50.0) == pytest.approx([20.5, 49.95, 0.1, 49.78, 0.32, 30.0])
    assert noisy(ranges, errors, 50.0)[:3].tolist() == (ranges + errors)[:3].tolist()


@pytest.mark.parametrize("distance", [49.9, 0.4])
def test_noisy_returns_near_the_ends_do_not_heap_up(grid, bullet, lidar, distance):
    """A lorry's rear so far away: one range seen again and again would tell that it was cut."""
    length = CATALOGUE["truck"].size[0]
    bullet.add(CATALOGUE["truck"], (distance + length / 2, 0.0, 0.0))
    clean, bodies = lidar(grid, bullet).fire(everything(grid), SENSOR)
    hit = np.isfinite(clean.ranges) & (bodies == bodies.max())
    erring = lidar(grid, bullet, lidar_range_sigma=0.5)
    ranges = np.concatenate(
        [erring.fire(everything(grid), SENSOR)[0].ranges[hit] for _ in range(5)]
    )
    assert len(np.unique(ranges)) == len(ranges) > 10
    assert 0 < ranges.min() < ranges.max() < 50


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


def test_firing_nothing_returns_nothing(grid, street, lidar):
    scan, bodies = lidar(grid, street).fire(np.array([], dtype=np.int64), SENSOR)
    assert len(scan.ranges) == len(bodies) == 0


@pytest.mark.parametrize(
    ("noise", "named"),
    [({"lidar_dropout": 1.5}, "dropout"),
     ({"lidar_dropout": -0.1}, "dropout"), ({"lidar_range_sigma": -1}, "range_sigma"),
     ({"lidar_range_sigma": float("nan")}, "lidar_range_sigma")],
)  # fmt: skip
def test_impossible_noise_is_refused_by_name(noise, named):
    with pytest.raises(InvalidInput, match=named):
        Sensing(**noise)


def test_an_unknown_engine_is_refused_with_the_known_ones():
    for name in ENGINES:
        check_engine(name)
    with pytest.raises(InvalidInput, match=r"engine 'warp'.*bullet"):
        check_engine("warp")
