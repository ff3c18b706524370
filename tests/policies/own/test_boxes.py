"""The rule of boxes: every camera box alike, then one row straight ahead first."""

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.grid import AngularGrid
from care_sim.core.residual import wedges
from care_sim.core.rig import Rig
from care_sim.policies.own.boxes import Boxes
from care_sim.policies.own.care import CORE_FIRST


def test_every_box_has_its_first_cells_whether_it_is_explained_or_not(environment, encounter):
    policy = care_sim.make_policy("boxes", environment)
    served = 0
    for observation in encounter:
        belief = policy.rig.read(observation)
        boxes, _ = policy.demand(belief).layers
        every = policy.rig.listed(wedges(belief.detections, policy.rig), CORE_FIRST)
        assert [cells.tolist() for cells in boxes] == [cells[:4].tolist() for cells in every]
        served += len(every)
    assert served


def test_tracks_get_nothing_and_the_row_begins_straight_ahead(belief_of, car):
    """Row 9, at -1.33 degrees, is where things enter the range; columns 255 and 256 lie ahead."""
    boxes, (row,) = Boxes(Rig()).demand(belief_of([car(1, 12, 0)])).layers
    assert not len(boxes)
    assert (row[:4] - 9 * 512).tolist() == [255, 256, 254, 257]
    assert sorted(row) == [*range(9 * 512, 10 * 512)]
    off_ahead = np.abs(AngularGrid().azimuths[row % 512])
    assert (np.diff(off_ahead) >= -1e-12).all()


def test_what_boxes_and_row_leave_goes_to_the_floor():
    with gymnasium.make("CARE-Dense-v0", budget=0.1) as env:
        policy = care_sim.make_policy("boxes", env)
        observation, _ = env.reset(seed=0)
        action = policy(observation)
        *_, info = env.step(action)
    assert 512 <= np.count_nonzero(action) < 1638 == len(info["fired"])


def test_the_cells_of_a_box_can_be_chosen(environment, encounter):
    policy = care_sim.make_policy("boxes", environment, cells=7)
    longest = [
        max(map(len, policy.demand(policy.rig.read(seen)).layers[0]), default=0)
        for seen in encounter
    ]
    assert max(longest) == 7
    with pytest.raises(InvalidInput, match="cells must be"):
        Boxes(Rig(), cells=0)
