"""Allocators of others, by hand: beliefs of one thing, and small graphs with every path tried."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.grid import AngularGrid
from care_sim.core.residual import wedges
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES, Ego, ImageDetections
from care_sim.policies.paper.tracks import uniform_pattern
from care_sim.policies.peers.ensemble_variance import AfterGofer
from care_sim.policies.peers.light_curtains import PLACES, AfterAncha, _best_part, _best_path
from care_sim.policies.peers.predicted_regions import AfterShoouri
from care_sim.sensors.pictures import FRONT_CAMERA

GRID = AngularGrid()
RIG = Rig(budget=819)
WORTHS = st.lists(st.integers(0, 9), min_size=12, max_size=12)


def chosen(policy, belief):
    policy.remember(belief)
    return np.concatenate([cells for layer in policy.demand(belief).layers for cells in layer])


def walled(metres):
    """A full scan in which everything stands so far away."""
    return np.full(GRID.shape, metres, np.float32)


# Dense where an object is predicted, sparse elsewhere.


def test_a_predicted_region_is_dense_and_the_rest_sparse(belief_of, car):
    rig = Rig(cameras=(FRONT_CAMERA,), budget=819)
    box = [CLASSES.index("car"), 0.9, 20.0, 60.0, 80.0, 100.0, 0.0, 0.0, 0.0]
    seen = ImageDetections.from_rows(np.array([box]))
    belief = replace(belief_of([car(1, 20.0)]), detections=seen)
    sparse, regions, rest = AfterShoouri(rig, sparse=0.1).demand(belief).layers
    (wedge,) = wedges(seen, rig)
    assert len(regions) == 2
    assert np.array_equal(regions[1], wedge)
    assert np.array_equal(sparse[0], uniform_pattern(GRID, 82))
    assert np.array_equal(regions[0], RIG.hulls(belief.tracks.boxes)[0])
    assert len(rest[0]) == belief.budget


def test_a_share_that_is_none_is_refused():
    with pytest.raises(InvalidInput, match="sparse must lie in"):
        AfterShoouri(RIG, sparse=1.1)


# Where depths that are predicted differ.


def test_samples_go_where_ranges_differ(belief_of):
    ranges = walled(10.0)
    ranges[:, 256:] = 40.0
    policy = AfterGofer(RIG)
    policy.remember(belief_of(ranges=ranges))
    fired = np.zeros(GRID.size, bool)
    fired[chosen(policy, belief_of())] = True
    # Half of all cells are known to each member, so only next to the edge can they differ.
    by_column = fired.reshape(GRID.shape).mean(axis=0)
    assert by_column[254:258].mean() > 5 * by_column[:250].mean()


def test_where_all_agree_samples_lie_evenly(belief_of):
    policy = AfterGofer(RIG)
    policy.remember(belief_of(ranges=walled(10.0)))
    columns = chosen(policy, belief_of()) % GRID.columns
    counts = np.bincount(columns // 64, minlength=8)
    assert len(columns) == RIG.budget
    assert counts.min() > 0.7 * RIG.budget / 8


def test_what_was_measured_long_ago_is_forgotten(belief_of):
    ranges = walled(10.0)
    ranges[:, 256:] = 40.0
    policy, fresh = AfterGofer(RIG), AfterGofer(RIG)
    policy.remember(belief_of(ranges=ranges))
    for _ in range(11):
        policy.remember(belief_of())
    for _ in range(12):
        fresh.remember(belief_of())
    old, new = (one.demand(belief_of()).layers[0][0] for one in (policy, fresh))
    assert np.array_equal(old, new)


# Curtains.


@given(WORTHS, st.integers(0, 2))
def test_no_path_through_the_graph_is_worth_more(worths, step):
    worth = np.array(worths, float).reshape(4, 3)
    path = _best_path(worth, step)
    assert np.abs(np.diff(path)).max() <= step
    paths = [p for p in product(range(3), repeat=4) if np.abs(np.diff(p)).max() <= step]
    best = max(worth[range(4), one].sum() for one in paths)
    assert worth[range(4), path].sum() == best


@given(WORTHS, st.lists(st.integers(0, 4), min_size=12, max_size=12), st.integers(0, 20))
def test_no_part_that_can_be_paid_is_worth_more(worths, costs, budget):
    worth, costs = np.array(worths, float), np.array(costs)
    first, stop = _best_part(worth, costs, budget)
    parts = [(a, b) for a in range(13) for b in range(a, 13) if costs[a:b].sum() <= budget]
    assert (first, stop) in parts
    assert worth[first:stop].sum() == max(worth[a:b].sum() for a, b in parts)


def test_what_was_seen_is_certain_for_a_while_and_what_hides_is_not(belief_of):
    policy = AfterAncha(RIG)
    policy.remember(belief_of(ranges=walled(20.0)))
    (uncertain,) = policy._uncertain
    places = (np.arange(PLACES) + 0.5) * 2
    seen = uncertain[300]
    assert np.allclose(seen[places > 20], 1)
    # Between two rows, near the car, some places are never seen.
    assert np.allclose(seen[(places > 10) & (places < 20)], 1 - np.exp(-0.1))
    for _ in range(30):
        policy.remember(belief_of())
    assert policy._uncertain[0].min() > 0.9


def test_what_was_seen_moves_with_the_car(belief_of):
    policy = AfterAncha(RIG)
    policy.remember(belief_of(ranges=walled(30.0)))
    before = policy._uncertain[0][256]
    policy.remember(belief_of(ego=Ego(speed=40.0)))
    after = policy._uncertain[0][256]
    kept = np.exp(-0.1)
    assert np.allclose(after[5:-3], 1 - kept * (1 - before[7:-1]))


def test_a_curtain_looks_where_nothing_was_seen(belief_of):
    ranges = walled(50.0)
    ranges[:, 100:120] = 0.0
    policy = AfterAncha(RIG)
    policy.remember(belief_of(ranges=ranges))
    columns = chosen(policy, replace(belief_of(), budget=20)) % GRID.columns
    assert 10 < len(columns) <= 20
    assert columns.min() >= 100
    assert columns.max() < 120


@pytest.mark.parametrize("budget", [819, 3277])
def test_curtains_never_pay_twice_for_a_cell(belief_of, budget):
    cells = chosen(AfterAncha(RIG), replace(belief_of(), budget=budget))
    assert len(np.unique(cells)) == len(cells)
    assert 0.99 * budget < len(cells) <= budget
