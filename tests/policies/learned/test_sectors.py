"""Sectors of several worlds at once, held to the shared allocator and to each world alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.allocation import allocate
from care_sim.core.belief import Belief
from care_sim.core.beliefs import Beliefs
from care_sim.core.firing.actions import scores_of
from care_sim.core.grid import AngularGrid
from care_sim.core.residual import explained, explained_of
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES, Demand, Ego, ImageDetections, Tracks
from care_sim.policies.learned.grid_features import GridFeatures
from care_sim.policies.learned.sectors import SectorActions, SectorChoice, Tiling, reserve_demand
from care_sim.sensors.pictures import FRONT_CAMERA


def a_belief(rng, rig):
    """Some tracks ahead, boxes around the pixels of some of them, and a scan."""
    count = rng.integers(0, 6)
    tracks = np.zeros((count, 13))
    tracks[:, 0] = np.arange(count)
    tracks[:, 1] = rng.integers(0, len(CLASSES), count)
    tracks[:, 2:5] = rng.uniform((4, -9, -1.5), (45, 9, 0), (count, 3))
    tracks[:, 5:9] = rng.uniform(0.4, 5, (count, 4))
    boxes = np.zeros((rng.integers(0, 5), 9))
    boxes[:, 0] = rng.integers(0, len(CLASSES), len(boxes))
    boxes[:, 1] = 0.9
    boxes[:, 2:4] = rng.uniform((0, 40), (250, 100), (len(boxes), 2))
    boxes[:, 4:6] = boxes[:, 2:4] + rng.uniform(5, 60, (len(boxes), 2))
    fires = rng.random(rig.grid.shape) < 0.05
    scan = np.where(fires, rng.uniform(1, rig.grid.range_m, rig.grid.shape), 0)
    return Belief(
        Ego(*rng.uniform(-5, 20, 3).astype(np.float32).tolist()),
        rig.budget,
        ImageDetections.from_rows(boxes.astype(np.float32)),
        Tracks.from_rows(tracks.astype(np.float32)),
        scan.astype(np.float32),
    )


def stacked(beliefs):
    rows = [belief.to_observation() for belief in beliefs]
    return {name: np.stack([row[name] for row in rows]) for name in rows[0]}


GRID = AngularGrid(columns=4, rows=4)
QUARTERS = Tiling(GRID, 2, 2)
NOTHING = Belief(
    Ego(),
    4,
    ImageDetections.from_rows(np.empty((0, 9))),
    Tracks.from_rows(np.empty((0, 13))),
    np.zeros((4, 4), np.float32),
)


FOUR = np.array([4])


def listed(stages):
    return [[cells.tolist() for cells in stage.sets] for stage in stages]


def test_sectors_follow_the_hulls_best_first():
    rig = Rig(GRID, budget=4)
    scores = np.array([[[0.1, 0.2], [0.3, 0.4]]])
    choice = SectorChoice(rig, QUARTERS)
    first, second = [10, 11, 14, 15], [8, 9, 12, 13]
    assert listed(choice.reserve(Beliefs.of(NOTHING, rig), scores)) == [[], [first + second]]
    assert listed(choice.alone(scores, FOUR)) == [[], [first]]
    assert listed(choice.alone(-scores, FOUR)) == [[], [[]]]


def test_each_world_has_its_own_sectors_up_to_its_budget():
    scores = np.array([[[0.5, -1], [-1, -1]], [[0.2, 0.3], [-1, -1]], [[-1, -1], [-1, 0]]])
    left, right = [0, 1, 4, 5], [2, 3, 6, 7]
    choice = SectorChoice(Rig(GRID, budget=8), QUARTERS)
    for budgets, second in (([8, 8, 8], right + left), ([8, 4, 8], right)):
        stages = choice.alone(scores, np.array(budgets))
        assert listed(stages) == [[], [left, second, []]]
        assert [stage.counts.tolist() for stage in stages] == [[0, 0, 0], [1, 1, 1]]


def test_equal_scores_go_by_ascending_sector():
    """Also where a network is so sure that its scores are equal in float32."""
    scores = np.tanh(np.array([[[12, 14], [13, 15]]], np.float32))
    assert len(np.unique(scores)) == 1
    assert listed(SectorChoice(Rig(GRID, budget=4), QUARTERS).alone(scores, FOUR))[1] == [
        [0, 1, 4, 5]
    ]


RIGS = {
    "3%": Rig(cameras=(FRONT_CAMERA,), budget=492),
    "no reserve": Rig(cameras=(FRONT_CAMERA,), budget=200, reserve_fraction=0.0),
    "ordered": Rig(cameras=(FRONT_CAMERA,), budget=492, cell_order="core-spread"),
    "tilted": Rig(AngularGrid(pitch=0.05, roll=-0.02), (FRONT_CAMERA,), budget=492),
    "full": Rig(AngularGrid(columns=64, rows=8), (FRONT_CAMERA,), budget=512),
}


@pytest.mark.parametrize("name", RIGS)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5))
def test_every_world_acts_and_sees_as_if_it_were_alone(name, seed, worlds):
    rng = np.random.default_rng(seed)
    rig = RIGS[name]
    sectors, features = Tiling(rig.grid, 32, 4), GridFeatures(rig, 32, 4)
    acting = SectorActions(rig, sectors, np.full(worlds, rig.budget))
    choice = SectorChoice(rig, sectors)
    alone = [a_belief(rng, rig) for _ in range(worlds)]
    scores = np.round(rng.uniform(-1, 1, (worlds, 4, 32)), 1).astype(np.float32)
    scores[0] *= rng.integers(-1, 2)

    together = Beliefs.from_observation(stacked(alone), rig)
    pictures = features.of_all(together)
    reserved, only = acting.reserve(together, scores).copy(), acting.alone(scores)
    for world, belief in enumerate(alone):
        for drawn, rows in pictures.items():
            assert features(belief)[drawn].tobytes() == rows[world].tobytes()
        own = scores[world : world + 1]
        exploitation, *layers = (stage.sets for stage in choice.alone(own, np.array([rig.budget])))
        for demand, actions in (
            (rig.in_cell_order(reserve_demand(belief, rig, sectors, scores[world])), reserved),
            (Demand(exploitation, layers), only),
        ):
            cells = allocate(demand, rig.budget, rig.reserve_fraction)
            assert scores_of(cells, rig.grid.shape).tobytes() == actions[world].tobytes()


def test_a_forecast_of_another_world_explains_nothing():
    rig = RIGS["3%"]
    rng = np.random.default_rng(0)
    beliefs = [a_belief(rng, rig) for _ in range(200)]
    together = Beliefs.from_observation(stacked(beliefs), rig)
    found = [explained(belief.detections, belief.tracks, rig) for belief in beliefs]
    known = explained_of(together)
    assert np.concatenate(found).tolist() == known.tolist()
    assert known.any()
    assert together.detected.sum() == len(known)


def test_tiles_are_counted_from_the_top_row_and_from_straight_behind():
    assert QUARTERS.cells.tolist() == [[0, 1, 4, 5], [2, 3, 6, 7], [8, 9, 12, 13], [10, 11, 14, 15]]
    assert QUARTERS.shape == (2, 2)
    assert QUARTERS.tile_shape == (2, 2)


def best(tiling, scores, enough):
    """The tiles that `Tiling.ranked` gives for one picture."""
    (ranked,), (count,) = tiling.ranked(np.array([scores]), enough)
    return ranked[:count].tolist()


def test_the_best_come_first_ties_by_index_and_none_that_is_not_positive():
    assert best(QUARTERS, [[0.2, -0.1], [0.9, 0.2]], 16) == [2, 0, 3]
    assert best(QUARTERS, np.zeros((2, 2)), 16) == []
    sectors = Tiling(AngularGrid())
    equal = best(sectors, np.tile([0.5, 0.25], 64), 10**6)
    assert equal == [*range(0, 128, 2), *range(1, 128, 2)]


def test_no_more_tiles_than_hold_enough():
    counts = [len(best(QUARTERS, np.ones((2, 2)), cells)) for cells in (0, 1, 4, 5, 100)]
    assert counts == [0, 1, 1, 2, 4]


@given(st.sampled_from([1, 2, 4, 8, 16, 512]), st.sampled_from([1, 2, 4, 32]))
def test_the_tiles_part_the_grid(azimuths, elevations):
    tiling = Tiling(AngularGrid(), azimuths, elevations)
    assert np.array_equal(np.sort(tiling.cells.ravel()), np.arange(AngularGrid().size))
    tall, wide = tiling.tile_shape
    rows, columns = np.divmod(tiling.cells, 512)
    assert np.array_equal(
        rows // tall * azimuths + columns // wide, np.indices(tiling.cells.shape)[0]
    )


@pytest.mark.parametrize(("azimuths", "elevations"), [(3, 4), (0, 4), (32, 5), (32, 64), (1.5, 4)])
def test_tiles_that_do_not_divide_the_grid_are_refused(azimuths, elevations):
    with pytest.raises(InvalidInput, match=r"azimuths|elevations"):
        Tiling(AngularGrid(), azimuths, elevations)
