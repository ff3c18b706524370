"""Reserves that do not look at the camera, and care-priority, on beliefs with known answers."""

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.core.belief import Belief
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.residual import camera_layers
from care_sim.core.types import Ego
from care_sim.policies.paper.blind import horizon_rows
from care_sim.policies.paper.tracks import uniform_pattern

GRID = AngularGrid()


def layers_of(demand):
    return [[cells.tolist() for cells in layer] for layer in demand.layers]


@pytest.mark.parametrize("count", [0, 1, 5, 31, 246, 491, 8192, 16000, 16384])
def test_the_uniform_pattern_has_exactly_its_size_and_is_even(count):
    cells = uniform_pattern(GRID, count)
    rows = np.bincount(cells // GRID.columns, minlength=GRID.rows)
    assert len(np.unique(cells)) == len(cells) == count
    assert ((cells >= 0) & (cells < GRID.size)).all()
    assert rows.max() - rows.min() <= 1
    for row in np.flatnonzero(rows > 1):
        columns = np.sort(cells[cells // GRID.columns == row] % GRID.columns)
        gaps = np.diff(columns, append=columns[0] + GRID.columns)
        assert gaps.max() - gaps.min() <= 1


def test_every_block_of_the_grid_gets_its_part_of_the_uniform_pattern():
    """491 cells over 64 blocks of 8 rows and 32 columns: 7.7 each."""
    rows, columns = np.divmod(uniform_pattern(GRID, 491), GRID.columns)
    counts = np.bincount(rows // 8 * 16 + columns // 32, minlength=64)
    assert counts.min() >= 6
    assert counts.max() <= 10


def test_history_uniform_spends_exactly_the_reserve_the_same_at_every_keyframe(
    environment, encounter
):
    policy = care_sim.make_policy("history-uniform", environment)
    beliefs = [Belief.from_observation(observation) for observation in encounter]
    patterns = [layers_of(policy.demand(belief)) for belief in beliefs]
    assert len(patterns[0][0][0]) == 819 - round(0.7 * 819)
    assert all(pattern == patterns[0] for pattern in patterns)
    hulls = policy.rig.hulls(beliefs[0].tracks.boxes)
    assert [s.tolist() for s in policy.demand(beliefs[0]).exploitation] == [
        hull.tolist() for hull in hulls
    ]


def test_beam_reduction_keeps_the_rows_nearest_the_horizon():
    """Rows 8, 9, 7, 10 stand at 0.00, -1.33, 1.34 and -2.67 degrees."""
    layers = horizon_rows(GRID, 3 * 512 + 102)
    assert [np.unique(cells // 512).tolist() for cells in layers] == [[8], [9], [7], [10]]
    assert [len(cells) for cells in layers] == [512, 512, 512, 102]
    gaps = np.diff(layers[3], append=layers[3][0] + 512)
    assert set(gaps.tolist()) == {5, 6}


@pytest.mark.parametrize("count", [1, 511, 512, 1638, 16384])
def test_beam_reduction_asks_for_exactly_the_budget(count):
    cells = np.concatenate(horizon_rows(GRID, count))
    assert len(np.unique(cells)) == len(cells) == count


def test_beam_reduction_exploits_nothing(environment, encounter):
    demand = care_sim.make_policy("beam-reduce", environment).demand(
        Belief.from_observation(encounter[0])
    )
    assert list(demand.exploitation) == []
    assert sum(len(cells) for (cells,) in demand.layers) == 819


def test_care_priority_adds_the_explained_wedges_as_a_second_layer(environment, encounter):
    priority, care = (care_sim.make_policy(name, environment) for name in ("care-priority", "care"))
    for observation in encounter:
        belief = Belief.from_observation(observation)
        _, explained = camera_layers(belief, priority.rig)
        expected = [*layers_of(care.demand(belief)), [wedge.tolist() for wedge in explained]]
        assert layers_of(priority.demand(belief)) == expected
    assert any(not np.array_equal(priority(o), care(o)) for o in encounter)


def scan_of(*points):
    """A last scan with returns (x, y, z) in the sensor frame, moved to the middle of their cells;
    and the cells.
    """
    picture = np.zeros(GRID.size, np.float32)
    cells = GRID.cells_of(points)
    picture[cells] = np.linalg.norm(points, axis=1)
    return picture.reshape(GRID.shape), cells.tolist()


@pytest.fixture
def uncertainty(environment):
    return care_sim.make_policy("uncertainty", environment)


def test_unexplained_returns_are_served_in_shells_the_nearest_first(uncertainty, belief_of):
    ranges, (far, near, beside) = scan_of((20.5, 3, 0), (7.5, -2, 0), (7.4, 2.1, 0))
    assert layers_of(uncertainty.demand(belief_of(ranges=ranges))) == [
        [sorted([near, beside])],
        [[far]],
    ]


def test_cells_that_did_not_fire_or_return_are_no_uncertainty(uncertainty, belief_of):
    ranges = np.zeros(GRID.shape, np.float32)
    ranges[8] = 50.0
    assert layers_of(uncertainty.demand(belief_of(ranges=ranges))) == []


def test_ground_is_no_uncertainty(uncertainty, belief_of):
    """The sensor stands 1.84 m above the road; a return 0.2 m above it is ground, one at 0.5 m is
    not.
    """
    ranges, (_, kerb) = scan_of((4, 0, -1.64), (4, 2, -1.34))
    assert layers_of(uncertainty.demand(belief_of(ranges=ranges))) == [[[kerb]]]


def test_returns_of_a_detected_car_are_explained_and_those_beside_it_are_not(
    uncertainty, belief_of, car
):
    """Its near side stands at 17.7 m, its flank at 0.975 m."""
    ranges, (_, beside) = scan_of((17.7, 0, -1), (17.7, 1.6, -1))
    belief = belief_of([car(0, 20)], ranges=ranges)
    assert layers_of(uncertainty.demand(belief)) == [[[beside]]]


def test_a_track_that_was_not_detected_explains_nothing(uncertainty, belief_of, car):
    ranges, (missed,) = scan_of((17.7, 0, -1))
    assert layers_of(uncertainty.demand(belief_of([car(0, 20, misses=1)], ranges=ranges))) == [
        [[missed]]
    ]


def test_boxes_are_moved_back_to_the_last_scan(uncertainty, belief_of, car):
    """A car crosses at 20 m/s, the ego came 1.1 m nearer: its far side stood at (23.4, -2)."""
    ranges, _ = scan_of((23.3, -2, -1))
    crossing = car(0, 20, vy=20.0)
    assert layers_of(uncertainty.demand(belief_of([crossing], Ego(10.5, 0, -10), ranges))) == []
    assert layers_of(uncertainty.demand(belief_of([crossing], Ego(0), ranges))) != []
    assert layers_of(uncertainty.demand(belief_of([car(0, 20)], Ego(10.5, 0, -10), ranges))) != []


def test_boxes_are_turned_back_to_the_last_scan(uncertainty, belief_of, car):
    """The ego has turned left by 0.1 rad: what is dead ahead was 0.1 rad to the left."""
    ranges, _ = scan_of((17.7 * np.cos(0.1), 17.7 * np.sin(0.1), -1))
    assert layers_of(uncertainty.demand(belief_of([car(0, 20)], Ego(0, 1.0), ranges))) == []
    assert layers_of(uncertainty.demand(belief_of([car(0, 20)], Ego(0, 0.0), ranges))) != []


@pytest.mark.parametrize("scenario", ["CARE-Dense-v0", "CARE-CutIn-v0"])
def test_in_a_drive_no_unexplained_return_lies_on_a_detected_vehicle(scenario):
    """The true boxes at the last scan, before and while the car brakes."""
    env = gymnasium.make(scenario, budget=0.1)
    policy = care_sim.make_policy("uncertainty", env)
    observation, _ = env.reset(seed=0)
    loop = env.unwrapped.loop
    rig = env.unwrapped.rig
    reported = [actor for actor in loop.world.actors if actor.label is not None]
    found = 0
    accelerations = set()
    for _ in range(50):
        boxes = loop.sensor.boxes_to_local(loop.world.boxes(reported))
        detections = [box for box in boxes if np.hypot(*box[:2]) < 20]
        observation, *_ = env.step(policy(observation))
        belief = Belief.from_observation(observation)
        accelerations.add(round(belief.ego.acceleration))
        seen = belief.tracks.take(belief.tracks.misses == 0)
        demand = policy.demand(belief)
        for cells in (cells for (cells,) in demand.layers):
            points = rig.grid.directions[cells] * observation["ranges"].ravel()[cells, None]
            for box in detections:
                near = np.hypot(*(seen.boxes[:, :2] - box[:2]).T) < 3
                if near.any() and on_box(points, box).any():
                    found += 1
    env.close()
    assert len(accelerations) > 1
    assert found == 0


def on_box(points, box):
    local = Frame(*box[:3], box[6]).boxes_to_local(
        np.column_stack([points, np.zeros((len(points), 4))])
    )[:, :3]
    return (np.abs(local) <= box[3:6] / 2 + 0.01).all(axis=1)
