import numpy as np
import pytest

from care_sim.core.grid import AngularGrid
from care_sim.sensors.bundle import bundle

GRIDS = [
    AngularGrid(),
    AngularGrid(columns=120, field_of_view=2 * np.pi / 3, heading=0.5),
    AngularGrid.of_elevations([0.2, 0.05, -0.1, -0.3], columns=90),
    AngularGrid(heading=1.0, pitch=-0.3, roll=0.2),
]


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("divergence", [0.5, 3.0, 10.0])
def test_seven_rays_lie_round_the_direction_of_their_cell(grid, divergence):
    """At the level the bundle has the variance of an evenly lit disc of that diameter."""
    grids = bundle(grid, divergence)
    assert grids[0] == grid
    assert len(grids) == 7
    row = int(np.argmin(np.abs(grid.elevations)))
    cells = row * grid.columns + np.arange(0, grid.columns, 9)
    middle = grid.directions[cells]
    apart = np.array([1000 * (one.directions[cells] - middle) for one in grids])
    radius = divergence / 2
    spread = (apart**2).sum(axis=2)
    assert spread.mean(axis=0) == pytest.approx(np.full(len(cells), radius**2 / 2), rel=0.02)
    assert spread.max() < radius**2
    assert apart.mean(axis=0) == pytest.approx(np.zeros_like(middle), abs=1e-3 * divergence)


def test_a_row_that_looks_straight_down_stays_on_the_sphere():
    grid = AngularGrid(rows=4, top=0.0, bottom=-np.pi / 2)
    assert all(one.bottom >= -np.pi / 2 for one in bundle(grid, 20.0))
