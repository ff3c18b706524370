"""The layers of `care-sightlines`, on real observations round an encounter."""

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.belief import MAX_DETECTIONS
from care_sim.core.residual import camera_layers
from care_sim.core.types import ImageDetections
from care_sim.policies.controls.patterns import cells_by_row
from care_sim.policies.own.care import CORE_FIRST


def blind(observation):
    """The same observation without a camera detection."""
    padding = np.zeros((MAX_DETECTIONS, len(ImageDetections.COLUMNS)), np.float32)
    padding[:, 0] = -1
    return {**observation, "detections": padding}


def test_without_camera_detections_it_plays_as_without_a_camera(environment, encounter):
    seeing, unseeing = (
        care_sim.make_policy("care-sightlines", environment, camera=camera)
        for camera in (True, False)
    )
    differing = 0
    for observation in encounter:
        differing += not np.array_equal(seeing(observation), unseeing(observation))
    assert differing
    for policy in (seeing, unseeing):
        policy.reset()
    for observation in encounter:
        assert np.array_equal(seeing(blind(observation)), unseeing(observation))


@pytest.mark.parametrize(
    ("idea", "layer"),
    [("ahead", 1), ("explained", 3), ("sight_lines", 4), ("rows", 6), ("rows", 8)],
)
def test_an_idea_can_be_switched_off(idea, layer, environment, encounter):
    policies = [
        care_sim.make_policy("care-sightlines", environment, **{idea: on}) for on in (True, False)
    ]
    asked = [0, 0]
    for observation in encounter:
        for number, policy in enumerate(policies):
            policy(observation)
            asked[number] += sum(map(len, policy.demanded.layers[layer]))
    assert asked[0] > 0
    assert asked[1] == 0


def test_the_budget_is_spent_without_the_floor(environment, encounter):
    policy = care_sim.make_policy("care-sightlines", environment)
    for observation in encounter:
        assert np.count_nonzero(policy(observation)) == policy.rig.budget


def test_every_layer_gives_its_part_of_a_set(environment, encounter):
    """Three returns make a detection: 6 cells of a hull and 9 of a wedge are a round."""
    policy = care_sim.make_policy("care-sightlines", environment)
    rig = policy.rig
    pattern = cells_by_row(rig)
    longest = np.zeros(3, int)
    for observation in encounter:
        belief = rig.read(observation)
        groups = [*camera_layers(belief, rig), rig.hulls(belief.tracks.boxes)]
        wedges, known, hulls = (rig.listed(group, CORE_FIRST) for group in groups)
        layers = policy.demand(belief).layers
        expected = {
            0: [cells[:9] for cells in wedges],
            2: [cells[:6] for cells in hulls],
            3: [cells[:6] for cells in known],
            5: [cells[9:36] for cells in wedges],
            6: [pattern[: rig.grid.columns]],
            7: [cells[6:15] for cells in hulls],
            8: [pattern[: rig.budget]],
        }
        for number, sets in expected.items():
            for cells, wanted in zip(layers[number], sets, strict=True):
                assert np.array_equal(cells, wanted)
        longest = np.maximum(longest, [max(map(len, sets), default=0) for sets in groups])
    assert (longest > 36).all()


@pytest.mark.parametrize(("newest", "is_late"), [(0.049, False), (0.051, True)])
def test_the_newest_picture_decides_whether_pictures_are_late(
    newest, is_late, environment, encounter
):
    """Keyframes are 0.1 s apart. The other pictures are older."""
    policy = care_sim.make_policy("care-sightlines", environment)
    asked = 0
    for observation in encounter:
        detections = observation["detections"].copy()
        detections[:, ImageDetections.AGE] = 0.2
        detections[0, ImageDetections.AGE] = newest
        layers = policy.demand(policy.rig.read({**observation, "detections": detections})).layers
        asked += sum(map(len, layers[5]))
    assert (asked == 0) == is_late


def test_a_late_picture_gets_one_round_of_its_wedges(environment, encounter):
    policy = care_sim.make_policy("care-sightlines", environment)
    rest = {}
    for age in (0.0, 0.1):
        asked = []
        for observation in encounter:
            detections = observation["detections"].copy()
            detections[:, ImageDetections.AGE] = age
            policy({**observation, "detections": detections})
            first, more = policy.demanded.layers[0], policy.demanded.layers[5]
            asked.append((sum(map(len, first)), sum(map(len, more))))
        rest[age] = np.sum(asked, axis=0)
    assert rest[0.0][0] == rest[0.1][0] > 0
    assert rest[0.0][1] > 0
    assert rest[0.1][1] == 0


def test_a_wedge_gets_as_many_rounds_as_asked_for(environment, encounter):
    policy = care_sim.make_policy("care-sightlines", environment, wedge_rounds=2)
    longest = 0
    for observation in encounter:
        policy(observation)
        longest = max([longest, *map(len, policy.demanded.layers[5])])
    assert longest == 9


def test_one_round_of_wedges_leaves_hulls_their_second(environment, encounter):
    policy = care_sim.make_policy("care-sightlines", environment, wedge_rounds=1)
    longest = np.zeros(2, int)
    for observation in encounter:
        layers = policy.demand(policy.rig.read(observation)).layers
        found = [max(map(len, layers[number]), default=0) for number in (5, 7)]
        longest = np.maximum(longest, found)
    assert longest.tolist() == [0, 9]


def test_the_last_layer_is_as_much_of_the_pattern_rows_as_may_fire(environment, encounter):
    policy = care_sim.make_policy("care-sightlines", environment)
    policy(encounter[0])
    ((cells,),) = policy.demanded.layers[-1:]
    assert np.array_equal(cells, cells_by_row(policy.rig)[: policy.rig.budget])


@pytest.mark.parametrize("idea", ["camera", "ahead", "explained", "sight_lines", "rows"])
def test_a_switch_is_true_or_false(idea):
    with (
        gymnasium.make("CARE-Dense-v0") as env,
        pytest.raises(InvalidInput, match=f"{idea} must be True or False"),
    ):
        care_sim.make_policy("care-sightlines", env, **{idea: 0.5})
