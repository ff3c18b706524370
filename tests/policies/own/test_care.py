"""The demands of our own policies: rounds, layers, cores."""

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.belief import MAX_DETECTIONS, Belief
from care_sim.core.grid import AngularGrid
from care_sim.core.residual import camera_layers, wedges
from care_sim.core.rig import Rig
from care_sim.core.types import ImageDetections
from care_sim.policies.controls.patterns import cells_by_row
from care_sim.policies.own.care import CORE_FIRST, CareSector
from care_sim.policies.own.sight_lines import columns_ahead

HULL_LAYERS = {"care-spread": 1, "care-sightlines": 2, "care-sector": 2, "place-hulls": 1}
"""The policies of our own and the control that lists hulls as they do, and the layer of each in
which its hulls come first.
"""


@pytest.mark.parametrize(("name", "layer"), HULL_LAYERS.items())
@pytest.mark.parametrize("returns", [1, 3, 5])
def test_rounds_are_multiples_of_what_a_detection_needs(name, layer, returns, belief_of, car):
    """The environment tells the policy what its detector needs."""
    with gymnasium.make("CARE-Dense-v0", min_returns=returns) as env:
        demand = care_sim.make_policy(name, env).demand(belief_of([car(1, 5, 0), car(2, 9, 5)]))
    assert [len(cells) for cells in demand.layers[layer]] == [2 * returns] * 2


@pytest.mark.parametrize(("name", "layer"), HULL_LAYERS.items())
def test_hulls_and_wedges_follow_the_cell_order_of_the_rig(name, layer, belief_of, car):
    belief = belief_of([car(1, 12, -9)])
    with gymnasium.make("CARE-Dense-v0", cell_order="rows-down") as env:
        policy = care_sim.make_policy(name, env)
        (hull,) = policy.demand(belief).layers[layer]
        (whole,) = policy.rig.hulls(belief.tracks.boxes)
    assert hull.tolist() == sorted(whole)[:6]


def assert_same(sets, expected):
    for cells, wanted in zip(sets, expected, strict=True):
        assert np.array_equal(cells, wanted)


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


def test_the_sector_is_as_wide_as_a_street_at_50_m():
    """14.6 degrees to either side: of columns of 0.703 degrees, whose first middle lies 0.35
    degrees off, 21 to the right (below 256) and 21 to the left.
    """
    columns = columns_ahead(AngularGrid())
    assert sorted(columns) == [*range(235, 277)]
    assert columns[:4].tolist() == [255, 256, 254, 257]


@pytest.mark.parametrize(("columns", "ahead"), [(5, [2]), (36, [17, 18]), (12, [])])
def test_the_sector_of_a_coarse_grid(columns, ahead):
    """Odd: one column lies straight ahead. The first middles of 36 columns lie 5 degrees off and
    the next 15; the first of 12 already lie 15 off.
    """
    assert sorted(columns_ahead(AngularGrid(columns, 16))) == ahead


def test_without_camera_and_tracks_it_is_the_sector_then_rows(belief_of):
    """Row 9, at -1.33 degrees, is where things enter the range."""
    layers = CareSector(Rig()).demand(belief_of()).layers
    asked = [[cells.tolist() for cells in layer] for layer in layers]
    sector = (9 * 512 + columns_ahead(AngularGrid())).tolist()
    rows = cells_by_row(Rig()).tolist()
    assert asked == [[], [sector], [], [], [], [rows[:512]], [], [rows[:819]]]


def test_wedges_and_hulls_are_served_in_rounds(environment, encounter):
    policy = care_sim.make_policy("care-sector", environment)
    served = np.zeros(5, int)
    for observation in encounter:
        belief = policy.rig.read(observation)
        unexplained, known = (
            policy.rig.listed(sets, CORE_FIRST) for sets in camera_layers(belief, policy.rig)
        )
        hulls = policy.rig.listed(policy.rig.hulls(belief.tracks.boxes), CORE_FIRST)
        layers = policy.demand(belief).layers
        expected = {
            0: [cells[:9] for cells in unexplained],
            2: [cells[:6] for cells in hulls],
            3: [cells[:6] for cells in known],
            4: [cells[9:36] for cells in unexplained],
            6: [cells[6:15] for cells in hulls],
        }
        for number, sets in expected.items():
            assert [cells.tolist() for cells in layers[number]] == [s.tolist() for s in sets]
        served += [sum(map(len, sets)) for sets in expected.values()]
    assert served.min() > 0


def test_without_the_residual_every_wedge_counts_as_unexplained(environment, encounter):
    """All wedges in the order of their boxes; nothing else moves."""
    policy, usual = (
        care_sim.make_policy("care-sector", environment, residual=residual)
        for residual in (False, True)
    )
    explained = 0
    for observation in encounter:
        belief = policy.rig.read(observation)
        _, known = camera_layers(belief, policy.rig)
        every = policy.rig.listed(wedges(belief.detections, policy.rig), CORE_FIRST)
        layers, usual_layers = policy.demand(belief).layers, usual.demand(belief).layers
        assert_same(layers[0], [cells[:9] for cells in every])
        assert_same(layers[4], [cells[9:36] for cells in every])
        assert not len(layers[3])
        for number in (1, 2, 5, 6, 7):
            assert_same(layers[number], usual_layers[number])
        explained += len(known)
    assert explained


@pytest.mark.parametrize("idea", ["residual", "camera", "tracks", "explained", "sector", "rows"])
def test_an_idea_is_a_switch(idea):
    with pytest.raises(InvalidInput, match=idea):
        CareSector(Rig(), **{idea: 1})


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
    ("name", "idea", "layers"),
    [
        ("care-sightlines", "ahead", [1]),
        ("care-sightlines", "explained", [3]),
        ("care-sightlines", "sight_lines", [4]),
        ("care-sightlines", "rows", [6, 8]),
        ("care-sector", "camera", [0, 3, 4]),
        ("care-sector", "sector", [1]),
        ("care-sector", "tracks", [2, 6]),
        ("care-sector", "explained", [3]),
        ("care-sector", "rows", [5, 7]),
    ],
)
def test_an_idea_can_be_switched_off(name, idea, layers, environment, encounter):
    """Its layers are empty, and the others stay."""
    policies = [care_sim.make_policy(name, environment, **{idea: on}) for on in (True, False)]
    asked = np.zeros((2, 9), int)
    for observation in encounter:
        for number, policy in enumerate(policies):
            policy(observation)
            sizes = [sum(map(len, layer)) for layer in policy.demanded.layers]
            asked[number, : len(sizes)] += sizes
    usual, without = asked
    assert usual[layers].all()
    usual[layers] = 0
    assert without.tolist() == usual.tolist()


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
