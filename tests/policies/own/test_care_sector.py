"""The layers of `care-sector`, and its sector on any grid."""

import numpy as np
import pytest

import care_sim
from care_sim.core.grid import AngularGrid
from care_sim.core.residual import camera_layers
from care_sim.core.rig import Rig
from care_sim.policies.controls.patterns import cells_by_row
from care_sim.policies.own.care import CORE_FIRST, CareSector
from care_sim.policies.own.sight_lines import columns_ahead


def test_the_sector_is_as_wide_as_a_street_at_50_m():
    """14.6 degrees to either side: of columns of 0.703 degrees, whose first middle lies 0.35
    degrees off, 21 to the right (below 256) and 21 to the left.
    """
    columns = columns_ahead(AngularGrid())
    assert sorted(columns) == [*range(235, 277)]
    assert columns[:4].tolist() == [255, 256, 254, 257]


@pytest.mark.parametrize(("columns", "ahead"), [(5, [2]), (36, [17, 18]), (12, [])])
def test_the_sector_of_a_coarse_grid(columns, ahead):
    """Odd: one column lies straight ahead. Of 36 the first middles lie 5 degrees off and the next
    15; of 12 already the first lie 15 off.
    """
    assert sorted(columns_ahead(AngularGrid(columns, 16))) == ahead


def test_without_camera_and_tracks_it_is_the_sector_then_rows(belief_of):
    """Row 9, at -1.33 degrees, is where things enter the range."""
    layers = CareSector(Rig()).demand(belief_of()).layers
    asked = [[cells.tolist() for cells in layer] for layer in layers]
    sector = (9 * 512 + columns_ahead(AngularGrid())).tolist()
    rows = cells_by_row(Rig()).tolist()
    assert asked == [[], [sector], [], [], [], [rows[:512]], [], [rows[:819]]]


@pytest.mark.parametrize("shape", [(64, 16), (1024, 64)])
def test_the_row_of_the_sector_is_that_of_any_grid(shape, belief_of):
    grid = AngularGrid(*shape)
    (sector,) = CareSector(Rig(grid=grid)).demand(belief_of()).layers[1]
    x, y, z = grid.directions[sector].T
    assert np.rad2deg(np.abs(np.arctan2(y, x))).max() < 14.6
    off = np.abs(np.rad2deg(np.arcsin(z)) + 1.25)
    assert off.max() <= np.rad2deg(grid.row_height) / 2


def test_wedges_and_hulls_are_served_in_rounds(environment, encounter):
    policy = care_sim.make_policy("care-sector", environment)
    served = np.zeros(5, int)
    for observation in encounter:
        belief = policy.rig.read(observation)
        unexplained, known = (
            policy.rig.listed(sets, CORE_FIRST) for sets in camera_layers(belief, policy.rig)
        )
        hulls = policy.rig.listed(policy.rig.hulls(belief.tracks.boxes), CORE_FIRST)
        layers = policy.demand(belief).layers
        expected = {
            0: [cells[:9] for cells in unexplained],
            2: [cells[:6] for cells in hulls],
            3: [cells[:6] for cells in known],
            4: [cells[9:36] for cells in unexplained],
            6: [cells[6:15] for cells in hulls],
        }
        for number, sets in expected.items():
            assert [cells.tolist() for cells in layers[number]] == [s.tolist() for s in sets]
        served += [sum(map(len, sets)) for sets in expected.values()]
    assert served.min() > 0
