"""Every engine over the same bodies: the ranges of a scene that can be reckoned by hand."""

import sys
from contextlib import ExitStack

import numpy as np
import pytest

from care_sim.measure.bench.config import BenchConfig
from care_sim.measure.bench.scanning.casters import PEER_CASTERS, casters
from care_sim.measure.bench.scanning.moving_bodies import (
    NEAREST_BODY_M,
    SENSOR,
    SWAY_M,
    moving_bodies,
)
from care_sim.measure.bench.scanning.scans import REFERENCE_ENGINE, agreement, drawn_cells, scans
from care_sim.sensors.engines import ENGINES
from care_sim.world.bodies import CATALOGUE

BUS = CATALOGUE["bus"]
AHEAD, LEFT, BEHIND = 256, 384, 0
"""Columns of the grid whose rays point along x, y and -x, but for half a column."""


@pytest.fixture
def opened():
    with ExitStack() as stack:
        yield stack


def cell(grid, row, column):
    return row * grid.columns + column


def test_every_engine_sees_the_bodies_where_they_were_put_last(grid, opened):
    made, skipped = casters([BUS, BUS], grid, opened)
    assert set(made) | {line.partition(":")[0] for line in skipped} == {*ENGINES, *PEER_CASTERS}
    level = 8
    cells = np.array([cell(grid, level, BEHIND), cell(grid, level, AHEAD), cell(grid, level, LEFT)])
    down = np.array([cell(grid, grid.rows - 1, BEHIND)])
    length, width, _ = BUS.size
    for caster in made.values():
        caster.place(np.array([[15.0, 0.0, 0.0], [0.0, -20.0, 0.0]]))
        caster.place(np.array([[30.0, 0.0, 0.0], [0.0, 20.0, 0.0]]))
        ranges, bodies = caster.cast(SENSOR, cells)
        horizontal = np.hypot(*grid.directions[cells][:, :2].T) * np.cos(grid.column_width / 2)
        assert bodies.tolist() == [-1, 1, 2]
        assert ranges[0] == np.inf
        assert ranges[1:] * horizontal[1:] == pytest.approx(
            [30 - length / 2, 20 - width / 2], abs=1e-4
        )
        ranges, bodies = caster.cast(SENSOR, down)
        assert bodies.tolist() == [0]
        assert ranges == pytest.approx([-SENSOR.z / grid.directions[down[0], 2]], abs=1e-4)


def test_a_body_beyond_the_reach_is_not_hit(grid, opened):
    made, _ = casters([BUS], grid, opened)
    for caster in made.values():
        caster.place(np.array([[grid.range_m + BUS.size[0], 0.0, 0.0]]))
        ranges, bodies = caster.cast(SENSOR, np.array([cell(grid, 8, AHEAD)]))
        assert (ranges.tolist(), bodies.tolist()) == ([np.inf], [-1])


def test_all_engines_agree_on_the_scene_that_is_measured(grid, opened):
    """Triangles of round parts may lose a ray in a thousand to the body behind them."""
    bodies = moving_bodies(30, 1)
    made, _ = casters(bodies.kinds, grid, opened)
    shares = agreement(made, bodies, drawn_cells(grid, 1638, 1))
    assert shares[REFERENCE_ENGINE] == {"same_body": 1.0, "same_range": 1.0}
    for name, share in shares.items():
        assert share["same_body"] > 0.998, name
        assert share["same_range"] > 0.99, name


def test_bodies_move_with_every_scan_and_stay_in_reach(grid):
    bodies = moving_bodies(300, 0)
    first, second = bodies.at(0), bodies.at(1)
    moved = np.hypot(*(first - second)[:, :2].T)
    assert np.all(moved > 0.01)
    assert np.all(moved <= 2 * SWAY_M)
    distances = np.hypot(*bodies.poses[:, :2].T)
    longest = max(kind.size[0] for kind in bodies.kinds) / 2
    assert distances.min() >= NEAREST_BODY_M > longest + SWAY_M
    assert distances.max() + SWAY_M < grid.range_m


def test_a_peer_without_its_library_is_left_out_in_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    monkeypatch.setitem(sys.modules, "open3d", None)
    figures, skipped = scans(BenchConfig(samples=2, repeats=1))
    assert set(figures["engines"]) == set(ENGINES)
    embree, mujoco = skipped
    assert embree.startswith(
        "Embree (Open3D): Open3D needs the extra 'open3d': pip install -c constraints.txt -e "
        "'.[open3d]'"
    )
    assert mujoco.startswith(
        "MuJoCo: MuJoCo needs the extra 'bench': pip install -c constraints.txt -e '.[bench]'"
    )


def test_the_figures_of_a_scan_hold_together():
    figures, _ = scans(BenchConfig(samples=5, repeats=2, budget=0.03))
    assert figures["rays"] == round(0.03 * 512 * 32)
    for engine in figures["engines"].values():
        for poses, cast, both, rate in zip(
            *(engine[key] for key in ("poses_ms", "cast_ms", "scan_ms", "rays_per_s")), strict=True
        ):
            assert 0 < max(poses, cast) < both
            assert rate == pytest.approx(1e3 * figures["rays"] / both)
