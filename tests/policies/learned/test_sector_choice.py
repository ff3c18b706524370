"""Sectors of several worlds at once, held to the shared allocator and to each world alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.actions import scores_of
from care_sim.core.allocation import allocate
from care_sim.core.belief import Belief
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES, Ego, ImageDetections, Tracks
from care_sim.policies.learned.beliefs import Beliefs
from care_sim.policies.learned.grid_features import GridFeatures
from care_sim.policies.learned.sector_choice import SectorChoice
from care_sim.policies.learned.tiling import Tiling, reserve_demand, sector_demand
from care_sim.sensors.camera import FRONT_CAMERA


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


RIGS = {
    "3%": Rig(cameras=(FRONT_CAMERA,), budget=492),
    "no reserve": Rig(cameras=(FRONT_CAMERA,), budget=200, reserve_fraction=0.0),
    "ordered": Rig(cameras=(FRONT_CAMERA,), budget=492, cell_order="core-spread"),
    "full": Rig(AngularGrid(columns=64, rows=8), (FRONT_CAMERA,), budget=512),
}


@pytest.mark.parametrize("name", RIGS)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5))
def test_every_world_acts_and_sees_as_if_it_were_alone(name, seed, worlds):
    rng = np.random.default_rng(seed)
    rig = RIGS[name]
    sectors, features = Tiling(rig.grid, 32, 4), GridFeatures(rig, 32, 4)
    choice = SectorChoice(rig, sectors)
    alone = [a_belief(rng, rig) for _ in range(worlds)]
    scores = np.round(rng.uniform(-1, 1, (worlds, 4, 32)), 1).astype(np.float32)
    scores[0] *= rng.integers(-1, 2)

    together = Beliefs.read(stacked(alone), rig)
    pictures = features.of_all(together)
    reserved, only = choice.reserve(together, scores), choice.alone(scores)
    for world, belief in enumerate(alone):
        for drawn, rows in pictures.items():
            assert features(belief)[drawn].tobytes() == rows[world].tobytes()
        for demand, actions in (
            (reserve_demand(belief, rig, sectors, scores[world]), reserved),
            (sector_demand(rig, sectors, scores[world]), only),
        ):
            cells = allocate(rig.in_cell_order(demand), rig.budget, rig.reserve_fraction)
            assert scores_of(cells, rig.grid.shape).tobytes() == actions[world].tobytes()


def test_a_forecast_of_another_world_explains_nothing():
    rig = RIGS["3%"]
    rng = np.random.default_rng(0)
    beliefs = [a_belief(rng, rig) for _ in range(200)]
    together = Beliefs.read(stacked(beliefs), rig)
    ends = together.detection_ends
    found = [Beliefs.of(belief, rig).explained.tolist() for belief in beliefs]
    assert np.concatenate(found).tolist() == together.explained.tolist()
    assert together.explained.any()
    assert ends[-1] == len(together.explained)
