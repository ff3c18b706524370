"""CARE with and without compensation of the turn since a late picture."""

import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.belief import Belief
from care_sim.core.types import Ego
from care_sim.policies.paper.reserves import Care

TURN = np.deg2rad(20.0)


@pytest.fixture
def late(environment, seen):
    """The belief of a box at the middle of the picture, since which the car has turned left."""
    rig = environment.unwrapped.rig
    box = ("pedestrian", 150.0, 80.0, 170.0, 120.0)
    ranges = np.zeros(rig.grid.shape, np.float32)

    def belief(tracks, yaw_change=TURN):
        return Belief(Ego(8.0), rig.budget, seen(box, yaw_change=yaw_change), tracks, ranges)

    return rig, belief


def wedge_of(policy, belief):
    ((wedge,),) = policy.demand(belief).layers
    return wedge.tolist()


def test_a_late_wedge_is_turned_back_unless_it_is_left(late, tracks_at):
    rig, belief = late
    nobody = tracks_at()
    now = wedge_of(Care(rig), belief(nobody, yaw_change=0.0))
    turned = wedge_of(Care(rig), belief(nobody))
    left = wedge_of(Care(rig, yaw_compensation=False), belief(nobody))
    assert left == now
    # The car has turned to the left: what was ahead is now to the right, at lower columns.
    columns = [np.mean(np.array(cells) % rig.grid.columns) for cells in (now, turned)]
    assert columns[0] - columns[1] == pytest.approx(TURN / rig.grid.column_width, abs=1.0)


def test_the_match_with_forecasts_follows_the_same_rule(late, tracks_at):
    """A forecast ahead explains the box as if it were new; one to the right explains the late
    box.
    """
    rig, belief = late
    ahead = tracks_at(("pedestrian", 15.0, 0.0, 0.0, 0.0))
    right = tracks_at(("pedestrian", 15.0 * np.cos(TURN), -15.0 * np.sin(TURN), 0.0, 0.0))
    compensated, plain = Care(rig), Care(rig, yaw_compensation=False)
    unexplained = {
        (name, place): len(policy.demand(belief(tracks)).layers[0])
        for name, policy in (("compensated", compensated), ("plain", plain))
        for place, tracks in (("ahead", ahead), ("right", right))
    }
    assert unexplained == {
        ("compensated", "ahead"): 1,
        ("compensated", "right"): 0,
        ("plain", "ahead"): 0,
        ("plain", "right"): 1,
    }


def test_another_value_is_refused(environment):
    with pytest.raises(InvalidInput, match="yaw_compensation"):
        care_sim.make_policy("care", environment, yaw_compensation="no")
