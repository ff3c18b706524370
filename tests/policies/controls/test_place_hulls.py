"""The control that shares its budget between a map and its tracks."""

import numpy as np
import pytest

import care_sim
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.policies.controls.patterns import likeliest_cells
from care_sim.policies.controls.patterns_and_tracks import PlaceHulls
from care_sim.policies.learned.weights import Card, save_weights

GRID = AngularGrid()


@pytest.fixture
def map_file(tmp_path):
    """A map of two cells; the others follow as `rows` has them."""
    sightings = np.zeros(GRID.shape, np.float32)
    sightings[4, 7] = 3
    sightings[9, 300] = 2
    save_weights(tmp_path / "map.npz", {"sightings": sightings}, Card("place", GRID))
    return tmp_path / "map.npz"


def test_the_map_has_its_share_first_and_the_hulls_two_rounds(map_file, belief_of, car):
    """35% of 819 cells are 286; a round is two cells for each of the three returns."""
    rig = Rig()
    belief = belief_of([car(1, 20), car(2, 12, -9)])
    first, few, more, rest = PlaceHulls(rig, map_file).demand(belief).layers
    likeliest = likeliest_cells(rig, map_file)
    assert likeliest[:2].tolist() == [4 * GRID.columns + 7, 9 * GRID.columns + 300]
    assert [cells.tolist() for cells in first] == [likeliest[:286].tolist()]
    assert [cells.tolist() for cells in rest] == [likeliest[:819].tolist()]

    # A near car's core holds more than both rounds.
    cores = rig.grid.hulls(belief.tracks.boxes, 0, 0)
    for one, other, core in zip(few, more, cores, strict=True):
        assert len({*one} | {*other}) == 12
        assert {*one} | {*other} <= {*core}


def test_it_asks_no_camera(map_file, environment, encounter):
    policy = care_sim.make_policy("place-hulls", environment, path=map_file)
    for observation in encounter:
        blind = observation | {"detections": np.zeros_like(observation["detections"])}
        blind["detections"][:, 0] = -1
        assert np.array_equal(policy(observation), policy(blind))
