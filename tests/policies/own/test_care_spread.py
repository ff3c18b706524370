"""The rounds of `care-spread`, on beliefs with known answers."""

import numpy as np

import care_sim
from care_sim.core.belief import Belief
from care_sim.core.residual import camera_layers
from care_sim.core.rig import Rig
from care_sim.policies.own.care import CORE_FIRST, CareSpread


def assert_same(sets, expected):
    for cells, wanted in zip(sets, expected, strict=True):
        assert np.array_equal(cells, wanted)


def test_every_hull_begins_with_its_core(belief_of, car):
    rig = Rig()
    belief = belief_of([car(1, 20, 3), car(2, 12, -9), car(3, -30, 2)])
    demand = CareSpread(rig).demand(belief)
    for first, bare, whole in zip(
        demand.layers[1],
        rig.grid.hulls(belief.tracks.boxes, 0, 0),
        rig.hulls(belief.tracks.boxes),
        strict=True,
    ):
        count = min(len(first), len(bare))
        assert set(first[:count]) <= set(bare)
        assert set(first) <= set(whole)
        assert len(first) == min(6, len(whole))


def test_an_unexplained_wedge_is_served_before_any_hull(environment, encounter):
    policy = care_sim.make_policy("care-spread", environment)
    served = 0
    for observation in encounter:
        belief = Belief.from_observation(observation)
        unexplained, _ = camera_layers(belief, policy.rig)
        policy(observation)
        assert [len(cells) for cells in policy.demanded.layers[0]] == [
            min(9, len(cells)) for cells in unexplained
        ]
        served += len(unexplained)
    assert served


def test_the_second_round_goes_on_where_the_first_stopped(environment, encounter):
    policy = care_sim.make_policy("care-spread", environment)
    served = [0, 0]
    for observation in encounter:
        belief = policy.rig.read(observation)
        unexplained, _ = camera_layers(belief, policy.rig)
        wedges = policy.rig.listed(unexplained, CORE_FIRST)
        hulls = policy.rig.listed(policy.rig.hulls(belief.tracks.boxes), CORE_FIRST)
        layers = policy.demand(belief).layers
        assert_same(layers[2], [cells[9:18] for cells in wedges])
        assert_same(layers[3], [cells[6:12] for cells in hulls])
        served[0] += sum(map(len, layers[2]))
        served[1] += sum(map(len, layers[3]))
    assert min(served) > 0
