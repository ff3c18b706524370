"""The learned scorer: what is seen of a cell, its network against plain NumPy, its reserve."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import care_sim
from care_sim.core.allocation import allocate
from care_sim.core.belief import Belief
from care_sim.core.grid import AngularGrid
from care_sim.core.residual import wedges
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES, Demand, ImageDetections
from care_sim.policies.learned.cell_inputs import RIG_INPUTS, SCAN_INPUTS, CellInputs
from care_sim.policies.learned.learned_scorer import CellNetwork, highest
from care_sim.policies.learned.weights import Card, load_weights, save_weights
from care_sim.sensors.surround import SURROUND_CAMERAS

GRID = AngularGrid()
RIG = Rig(GRID, SURROUND_CAMERAS)
BARE = replace(RIG, azimuth_margin=0, elevation_margin=0)
(UNEXPLAINED, BOX, SMALL, EXPLAINED, HULL, FIRED, STANDING, NEAR), SIZE, NEARNESS = range(8), 8, 9
AHEAD = 8 * GRID.columns + 256
"""A cell that looks straight ahead and level: row 8 is 0.003 degrees above the horizon."""
DOWN = 20 * GRID.columns + 256
"""16 degrees down: it meets the road 6.7 m away."""


@pytest.fixture
def seen_of(belief_of):
    """Makes the inputs (N, `SCAN_INPUTS`) of a belief from camera detections, tracks and ranges by
    cell.
    """

    def make(pictures=(), tracks=(), ranges=None):
        scan = np.zeros(GRID.size, np.float32)
        scan[list(ranges or {})] = list((ranges or {}).values())
        table = [[CLASSES.index(name), 0.9, *box, 0, 0, 0] for name, *box in pictures]
        detections = ImageDetections.from_rows(np.array(table, float).reshape(-1, 9))
        belief = replace(belief_of(tracks, ranges=scan.reshape(GRID.shape)), detections=detections)
        seen = CellInputs(RIG).of(belief, RIG.hulls(belief.tracks.boxes))
        return belief, seen.rows(np.arange(GRID.size))

    return make


def cells_with(seen, column):
    return np.flatnonzero(seen[:, column]).tolist()


def test_an_unexplained_box_marks_its_wedge_and_what_is_in_the_box(seen_of):
    belief, seen = seen_of([("pedestrian", 150, 80, 160, 110)])
    (wedge,), (bare,) = wedges(belief.detections, RIG), wedges(belief.detections, BARE)
    assert cells_with(seen, UNEXPLAINED) == cells_with(seen, SMALL) == wedge.tolist()
    assert cells_with(seen, BOX) == bare.tolist()
    assert set(bare) < set(wedge)
    assert seen[wedge, SIZE] == pytest.approx(np.log2(len(wedge) + 1) / 10)
    assert not seen[:, [EXPLAINED, HULL, FIRED, STANDING, NEAR, NEARNESS]].any()


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_where_wedges_overlap_the_smallest_says_size_and_kind(seen_of, order):
    pictures = [("car", 120, 80, 200, 120), ("pedestrian", 150, 80, 160, 110)]
    belief, seen = seen_of([pictures[n] for n in order])
    large, small = sorted(wedges(belief.detections, RIG), key=len, reverse=True)
    around = np.setdiff1d(large, small)
    assert cells_with(seen, SMALL) == small.tolist()
    assert seen[small, SIZE] == pytest.approx(np.log2(len(small) + 1) / 10)
    assert seen[around, SIZE] == pytest.approx(np.log2(len(large) + 1) / 10)


def test_a_detection_that_a_forecast_explains_is_marked_as_such_and_its_hull(seen_of, car):
    belief, seen = seen_of([("car", 140, 80, 180, 120)], [car(1, 12.0)])
    assert cells_with(seen, EXPLAINED) == wedges(belief.detections, RIG)[0].tolist()
    assert cells_with(seen, HULL) == RIG.hulls(belief.tracks.boxes)[0].tolist()
    assert not seen[:, [UNEXPLAINED, BOX, SMALL, SIZE]].any()


def test_a_standing_return_marks_its_surroundings_across_the_seam_too(seen_of):
    seam = 8 * GRID.columns
    _, seen = seen_of(ranges={seam: 10.0})
    around = [row * GRID.columns + column for row in (7, 8, 9) for column in (0, 1, 2, 510, 511)]
    assert cells_with(seen, FIRED) == cells_with(seen, STANDING) == [seam]
    assert cells_with(seen, NEAR) == around
    assert seen[seam, NEARNESS] == pytest.approx(0.8)


def test_on_a_grid_with_a_gap_surroundings_end_where_it_ends(belief_of):
    """Columns of a degree from -60 to 60: the last is no neighbour of column 0."""
    grid = AngularGrid(120, 5, 0.2, -0.2, field_of_view=np.pi * 2 / 3)
    scan = np.zeros(grid.shape, np.float32)
    scan[2, 0] = 10.0
    marks = CellInputs(Rig(grid)).of(belief_of(ranges=scan), []).rows(np.arange(grid.size))
    assert cells_with(marks, STANDING) == [240]
    assert {cell % 120 for cell in cells_with(marks, NEAR)} == {0, 1, 2}


def test_the_road_a_hull_and_no_return_do_not_stand(seen_of, car):
    _, seen = seen_of((), [car(1, 12.0)], {DOWN: 6.7, AHEAD + 100: GRID.range_m, AHEAD: 12.0})
    assert cells_with(seen, FIRED) == sorted([DOWN, AHEAD + 100, AHEAD])
    assert cells_with(seen, NEARNESS) == sorted([DOWN, AHEAD])
    assert seen[AHEAD, HULL] == 1
    assert not seen[:, [STANDING, NEAR]].any()


def test_the_inputs_of_the_rig_are_those_of_the_ray():
    elevation, ground, cosine, sine, covered = CellInputs(RIG).rig_inputs.T.reshape(
        len(RIG_INPUTS), *GRID.shape
    )
    assert elevation[:, 0] == pytest.approx(np.linspace(GRID.top, GRID.bottom, 32) / 0.5, abs=1e-6)
    assert ground[7, 3] == 0
    assert ground[20, 3] == pytest.approx(1 - 1.84 / np.sin(np.deg2rad(16)) / 50, abs=1e-3)
    assert cosine[0, 256] == pytest.approx(1, abs=1e-4)
    assert cosine[0, 0] == pytest.approx(-1, abs=1e-4)
    assert sine == pytest.approx(sine[:, ::-1], abs=1e-6)
    assert covered[8].all()


INPUTS = SCAN_INPUTS + len(RIG_INPUTS)
CARD = Card("learned-scorer", asdict(AngularGrid()))


@pytest.fixture
def drawn(tmp_path):
    """Weights with no sense."""
    rng = np.random.default_rng(3)
    arrays = {
        "layer": rng.normal(size=(INPUTS, 5)),
        "bias": rng.normal(size=5),
        "out": rng.normal(size=5),
    }
    save_weights(tmp_path / "drawn.npz", arrays, CARD)
    return tmp_path / "drawn.npz"


@given(arrays(np.float32, st.integers(1, 60), elements=st.floats(-3, 3, width=16)), st.data())
def test_the_highest_are_those_of_a_stable_sort(scores, data):
    count = data.draw(st.integers(0, len(scores)))
    expected = np.argsort(-scores, kind="stable")[:count]
    assert highest(scores, count).tolist() == sorted(expected.tolist())


def test_every_cell_is_scored_as_a_plain_network_does(drawn, encounter, environment):
    weights = load_weights(drawn)
    cell_inputs = CellInputs(environment.unwrapped.rig)
    network = CellNetwork(weights, cell_inputs.rig_inputs)
    layer, bias, out = (weights.arrays[name].astype(float) for name in ("layer", "bias", "out"))
    for observation in encounter[::8]:
        belief = Belief.from_observation(observation)
        seen = cell_inputs.of(belief, cell_inputs.rig.hulls(belief.tracks.boxes))
        inputs = np.hstack(
            [seen.rows(np.arange(cell_inputs.rig.grid.size)), cell_inputs.rig_inputs]
        )
        expected = np.maximum(inputs @ layer + bias, 0) @ out
        np.testing.assert_allclose(network.scores(seen), expected, rtol=1e-4, atol=1e-4)


def test_the_reserve_and_no_more_goes_to_the_highest_scores_and_the_rest_is_history(
    encounter, environment
):
    scorer, history = (
        care_sim.make_policy(name, environment) for name in ("learned-scorer", "history")
    )
    for observation in encounter[::4]:
        belief = Belief.from_observation(observation)
        asked = scorer.demand(belief)
        hulls = history.demand(belief).exploitation
        ((reserve,),) = asked.layers
        assert [cells.tolist() for cells in asked.exploitation] == [
            cells.tolist() for cells in hulls
        ]
        assert len(np.unique(reserve)) == len(reserve) == 819 - round(0.7 * 819)
        # The one set of the reserve fits in whole, so that the order of its cells changes nothing.
        backwards = Demand(asked.exploitation, [[reserve[::-1]]])
        fired, other = (set(allocate(demand, 819, 0.3).tolist()) for demand in (asked, backwards))
        assert fired == other


def test_the_shipped_weights_look_where_the_camera_sees_someone_new(encounter, environment):
    """In the dense street at 5% they find the person as soon as CARE does."""
    found = {}
    for name in ("learned-scorer", "care"):
        policy = care_sim.make_policy(name, environment)
        observation, _ = environment.reset(seed=0)
        policy.reset()
        ended = False
        while not ended:
            observation, _, terminated, truncated, info = environment.step(policy(observation))
            ended = terminated or truncated
        found[name] = info["outcome"]["detection_distance_m"]
    assert found["learned-scorer"] >= found["care"] - 1.0
