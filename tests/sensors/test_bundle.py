import numpy as np
import pytest

from care_sim.core.grid import AngularGrid
from care_sim.sensors.beams import bundle

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


@pytest.mark.parametrize(
    "grid",
    [
        AngularGrid(rows=4, top=0.0, bottom=-np.pi / 2),
        # Several rows lie within a beam of straight up and of straight down.
        AngularGrid(rows=512, columns=64, top=np.pi / 2, bottom=-np.pi / 2),
        AngularGrid.of_elevations([np.pi / 2, 1.56, 0.3, -np.pi / 2]),
    ],
    ids=["down", "dense", "listed"],
)
def test_every_row_moves_by_the_same_angle_but_those_that_would_pass_straight_up_or_down(grid):
    grids = bundle(grid, 100.0)
    raised = [one.elevations - grid.elevations for one in grids]
    inner = np.abs(grid.elevations) < np.pi / 2 - 0.05
    for one, moved in zip(grids, raised, strict=True):
        assert moved[inner] == pytest.approx(np.median(moved[inner]), abs=1e-9)
        ends = np.clip(grid.elevations + moved[inner][0], -np.pi / 2, np.pi / 2)
        assert one.elevations == pytest.approx(ends, abs=1e-6)
    highest = max(moved[inner][0] for moved in raised)
    assert highest == pytest.approx(0.05 * np.sqrt(7 / 12) * np.sin(np.pi / 3))
