"""Sets of boxes and tracks: what is told of them, the network against plain loops, and which cells
are chosen.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import care_sim
from care_sim.core.belief import Belief
from care_sim.core.cells.sets import CellSets
from care_sim.core.grid import AngularGrid
from care_sim.core.types import Ego, Tracks
from care_sim.policies.learned.learned_sets import STEPS, SetNetwork
from care_sim.policies.learned.set_items import ITEM_INPUTS, MIRRORED, STRIP_INPUTS, ItemReader
from care_sim.policies.learned.set_kernels import best_cells, needed_cells
from care_sim.policies.learned.weights import Card, load_weights, save_weights

CARD = Card("learned-sets", AngularGrid())
PLACES = 13 * 32


def drawn_arrays(seed=3, units=5, width=3):
    rng = np.random.default_rng(seed)
    items, strips, answers = len(ITEM_INPUTS), len(STRIP_INPUTS), len(STEPS) + 1
    shapes = {
        "first": (items, units),
        "first_bias": (units,),
        "query": (units, width),
        "key": (units, width),
        "value": (units, units),
        "second": (2 * units, units),
        "second_bias": (units,),
        "out": (units, answers),
        "out_bias": (answers,),
        "map": (PLACES,),
        "strip": (strips, 4),
        "strip_bias": (4,),
        "strip_out": (4,),
    }
    return {name: rng.normal(size=shape) / 2 for name, shape in shapes.items()}


@pytest.fixture
def drawn(tmp_path):
    """Weights with no sense."""
    save_weights(tmp_path / "drawn.npz", drawn_arrays(), CARD)
    return tmp_path / "drawn.npz"


def softmax(scores):
    powers = np.exp(np.array(scores) - max(scores))
    return powers / powers.sum()


def test_chances_are_those_of_a_plain_network(drawn, encounter, environment):
    of = {name: array.astype(float) for name, array in load_weights(drawn).arrays.items()}
    network = SetNetwork(load_weights(drawn), PLACES)
    reader = ItemReader(environment.unwrapped.rig, 48)
    seen = 0
    for observation in encounter[::8]:
        items = reader.of(Belief.from_observation(observation))
        units = np.maximum(items.inputs @ of["first"] + of["first_bias"], 0)
        for row, told in enumerate(network.chances(items)):
            heard = softmax([(units[row] @ of["query"]) @ (u @ of["key"]) / 3**0.5 for u in units])
            both = np.concatenate(
                [units[row], sum(h * (u @ of["value"]) for h, u in zip(heard, units, strict=True))]
            )
            last = np.maximum(both @ of["second"] + of["second_bias"], 0)
            expected = np.cumsum(softmax(last @ of["out"] + of["out_bias"]))[:-1]
            np.testing.assert_allclose(told, expected, atol=1e-6)
            seen += 1
        units = np.maximum(items.strips @ of["strip"] + of["strip_bias"], 0)
        expected = 1 / (1 + np.exp(-(units @ of["strip_out"] + of["map"][reader.places])))
        np.testing.assert_allclose(network.strip_chances(items, reader.places), expected, atol=1e-6)
    assert seen > 5


def test_the_order_of_a_sum_changes_no_chance(drawn, tmp_path, encounter, environment):
    """Processors and libraries sum in orders of their own, as does a network whose units are named
    in another order.
    """
    of, turned = load_weights(drawn).arrays, np.arange(5)[::-1]
    columns = {name: of[name][..., turned] for name in ("first", "first_bias", "second_bias")}
    rows = {name: of[name][turned] for name in ("query", "key", "out")}
    both = np.concatenate([turned, 5 + turned])
    crossed = {"value": of["value"][turned][:, turned], "second": of["second"][both][:, turned]}
    strips = {name: of[name][..., ::-1] for name in ("strip", "strip_bias", "strip_out")}
    save_weights(tmp_path / "turned.npz", of | columns | rows | crossed | strips, CARD)
    network, other = (
        SetNetwork(load_weights(tmp_path / f"{n}.npz"), PLACES) for n in ("drawn", "turned")
    )
    reader = ItemReader(environment.unwrapped.rig, 48)
    for observation in encounter[::8]:
        items = reader.of(Belief.from_observation(observation))
        np.testing.assert_array_equal(other.chances(items), network.chances(items))
        told = (each.strip_chances(items, reader.places) for each in (network, other))
        np.testing.assert_array_equal(*told)


def test_of_a_mirrored_street_the_same_is_told(environment, belief_of, car):
    """But for the signs of what tells left from right."""
    reader = ItemReader(environment.unwrapped.rig, 48)
    there, mirrored = (
        reader.of(belief_of([car(1, 12, side * 9, 3, side * 2)], Ego(8.0, side * 0.1)))
        for side in (1, -1)
    )
    signs = np.where(MIRRORED, -1, 1)
    np.testing.assert_allclose(mirrored.inputs * signs, there.inputs, atol=1e-6)
    assert (there.inputs[:, MIRRORED] != 0).all()
    across = there.strips.reshape(13, 64, -1)
    np.testing.assert_allclose(mirrored.strips.reshape(13, 64, -1)[:, ::-1], across, atol=1e-6)
    assert across[..., 0].max() > 0
    folded = reader.places.reshape(13, 64)
    assert (folded == folded[:, ::-1]).all()
    assert len(np.unique(folded)) == PLACES


def test_a_track_is_told_as_it_is(environment, belief_of, car):
    """A car 12 m ahead and 9 m to the left, missed twice, at 10 Hz."""
    reader = ItemReader(environment.unwrapped.rig, 48)
    items = reader.of(belief_of([car(1, 12, 9, 3, 2, misses=2)], Ego(7.5)))
    told = dict(zip(ITEM_INPUTS, items.inputs[0].tolist(), strict=True))
    assert (told["is a camera box"], told["is a car"], told["is a bus"]) == (0, 1, 0)
    assert told["sin azimuth"] == pytest.approx(0.6)
    assert told["range"] == pytest.approx(0.3)
    assert told["unseen"] == pytest.approx(0.3)
    assert told["velocity ahead"] == pytest.approx(0.2)
    assert told["speed of the car"] == pytest.approx(0.5)
    assert (told["fired"], told["shown"], told["covered"]) == (0, 0, 0)


def test_the_last_scan_is_told(environment, belief_of, car):
    """All cells fired at the car and half of them met it 10 m away, at sensor height or above."""
    reader = ItemReader(environment.unwrapped.rig, 48)
    cells = reader.of(belief_of([car(1, 12, 9)])).sets[0][:24]
    ranges = np.zeros(32 * 512, np.float32)
    ranges[cells] = 50
    ranges[cells[::2]] = 1
    items = reader.of(belief_of([car(1, 12, 9)], ranges=ranges.reshape(32, 512)))
    told = dict(zip(ITEM_INPUTS, items.inputs[0].tolist(), strict=True))
    assert (told["fired"], told["returned"], told["standing"]) == (1, 0.5, 1)
    assert told["nearness of returns"] == pytest.approx(0.98)


def chosen(sets, gains, strips=(), strip_gains=(), budget=100, steps=(1, 2, 4)):
    given_sets = CellSets.of([np.array(cells, np.int64) for cells in sets])
    return best_cells(
        given_sets.cells,
        given_sets.sizes,
        np.array(steps),
        np.array(gains, np.float32).reshape(len(sets), len(steps)),
        np.array(strips, np.int64).reshape(len(strips), 2),
        np.array(strip_gains, np.float32),
        budget,
        np.zeros(100, np.bool_),
    ).tolist()


def test_who_gains_most_per_cell_is_served_first():
    """The first set gains 0.8 by four cells and nothing before, the second less and less."""
    gains = [[0.0, 0.0, 0.8], [0.5, 0.6, 0.6]]
    sets = [[1, 2, 3, 4], [10, 11, 12, 13]]
    assert chosen(sets, gains) == [10, 1, 2, 3, 4, 11]
    assert chosen(sets, gains, budget=3) == [10, 1, 2]
    assert chosen(sets, gains, [[3, 50]], [0.42]) == [10, 3, 50, 1, 2, 4, 11]
    assert chosen([[1, 2]], [[0.0, 0.0, 0.8]]) == []


@given(st.data())
def test_never_more_than_the_budget_no_cell_twice_and_as_good_as_any_order(data):
    count = data.draw(st.integers(0, 4))
    sets = [
        data.draw(st.lists(st.integers(0, 60), min_size=4, max_size=6, unique=True))
        for _ in range(count)
    ]
    chances = st.lists(st.floats(0, 1, width=16), min_size=3, max_size=3)
    gains = [np.cumsum(data.draw(chances)) / 3 for _ in range(count)]
    budget = data.draw(st.integers(0, 12))
    cells = chosen(sets, gains, [[70, 71]], [data.draw(st.floats(0, 1, width=16))], budget)
    assert len(cells) == len(set(cells)) <= budget
    assert set(cells) <= {70, 71}.union(*sets)
    assert cells == chosen(sets, gains, [[70, 71]], [0.0], 100)[:budget] or {70, 71} & {*cells}


def test_after_how_many_cells_an_object_has_returned_often_enough():
    behind = np.full(20, -1)
    behind[[2, 4, 6, 8]] = 0
    behind[[3, 5]] = 1
    sets = CellSets.of([np.arange(2, 10), np.array([8, 7, 6]), np.array([3, 4, 5])])
    needed = needed_cells(sets.cells, sets.sizes, behind, 2, 2)
    assert needed.tolist() == [[3, 4], [3, 0], [0, 3]]


def test_more_returns_ask_for_more_cells(drawn, environment):
    usual, double = (
        care_sim.make_policy("learned-sets", environment, path=drawn, min_returns=count)
        for count in (3, 6)
    )
    assert (2 * usual._steps).tolist() == double._steps.tolist() == [2 * step for step in STEPS]


def test_a_track_that_was_just_seen_is_worth_less(environment, belief_of, car):
    """If two tracks are alike, the one that was missed longer is served first; with nothing for
    either none is."""
    rows = [car(1, 12, 9, misses=0), car(2, 12, -9, misses=9)]
    belief = replace(belief_of(rows), budget=6)
    policy = care_sim.make_policy("learned-sets", environment)
    ((cells,),) = policy.demand(belief).layers
    fresh, old = (len({*hull} & {*cells}) for hull in policy.rig.hulls(belief.tracks.boxes))
    assert old > fresh
    without = care_sim.make_policy("learned-sets", environment, refresh_per_s=0)
    ((cells,),) = without.demand(belief).layers
    assert set(cells) <= {*policy._items.strips.ravel()}


def test_items_follow_the_cell_order_of_the_rig(environment, belief_of, car):
    rig = replace(environment.unwrapped.rig, cell_order="rows-down")
    (cells,) = ItemReader(rig, 48).of(belief_of([car(1, 12, -9)])).sets
    (hull,) = rig.hulls(Tracks.from_rows(np.array([car(1, 12, -9)], float)).boxes)
    assert cells.tolist() == sorted(hull)[:48]
