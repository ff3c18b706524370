import numpy as np
import pytest

from care_sim.core.belief import Belief
from care_sim.core.residual import explained
from care_sim.core.rig import Rig
from care_sim.envs.spaces import observation_space
from care_sim.measure.bench.choices import TRACKS, choices, observation
from care_sim.measure.bench.config import BenchConfig
from care_sim.policies.paper.care import Care
from care_sim.sensors.camera import FRONT_CAMERA

RIG = Rig(cameras=(FRONT_CAMERA,))


@pytest.mark.parametrize("seed", range(5))
def test_the_belief_is_one_that_an_environment_could_show(seed):
    shown = observation(RIG, seed)
    assert observation_space(RIG).contains(shown)
    belief = Belief.from_observation(shown)
    assert len(belief.tracks) == TRACKS == len(set(belief.tracks.ids.tolist()))
    assert np.all(np.diff(belief.tracks.ranges) >= 0)
    assert belief.budget == RIG.budget
    known = explained(belief.detections, belief.tracks, RIG)
    assert known.any()
    assert not known.all()


def test_the_policy_spends_the_budget_on_it():
    assert np.count_nonzero(Care(RIG)(observation(RIG, 0))) == RIG.budget


def test_the_parts_lie_within_the_whole_and_the_policy_is_left_as_it_was():
    kept = Care.demand
    figures = choices(BenchConfig(samples=30, repeats=2))
    assert Care.demand is kept
    assert all(len(values) == 2 for values in figures.values())
    for p50, p99, demand, allocation in zip(
        *(figures[k] for k in ("p50", "p99", "demand", "allocation")), strict=True
    ):
        assert 0 < max(demand, allocation) < p50 <= p99
