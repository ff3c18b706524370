"""The learned scorer: its network against plain NumPy, its reserve, its files."""

from dataclasses import asdict, replace

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.allocation import allocate
from care_sim.core.belief import Belief
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.learned.cell_inputs import RIG_INPUTS, SCAN_INPUTS, CellInputs
from care_sim.policies.learned.learned_scorer import CellNetwork, LearnedScorer, highest
from care_sim.policies.learned.weights import Card, load_weights, save_weights, shipped_weights

INPUTS = SCAN_INPUTS + len(RIG_INPUTS)
CARD = Card("learned-scorer", asdict(AngularGrid()))


@pytest.fixture
def drawn(tmp_path):
    """Weights with no sense."""
    rng = np.random.default_rng(3)
    arrays = {
        "layer": rng.normal(size=(INPUTS, 5)),
        "bias": rng.normal(size=5),
        "out": rng.normal(size=5),
    }
    save_weights(tmp_path / "drawn.npz", arrays, CARD)
    return tmp_path / "drawn.npz"


@given(arrays(np.float32, st.integers(1, 60), elements=st.floats(-3, 3, width=16)), st.data())
def test_the_highest_are_those_of_a_stable_sort(scores, data):
    count = data.draw(st.integers(0, len(scores)))
    expected = np.argsort(-scores, kind="stable")[:count]
    assert highest(scores, count).tolist() == sorted(expected.tolist())


def test_every_cell_is_scored_as_a_plain_network_does(drawn, encounter, environment):
    weights = load_weights(drawn)
    cell_inputs = CellInputs(environment.unwrapped.rig)
    network = CellNetwork(weights, cell_inputs.rig_inputs)
    layer, bias, out = (weights.arrays[name].astype(float) for name in ("layer", "bias", "out"))
    for observation in encounter[::8]:
        belief = Belief.from_observation(observation)
        seen = cell_inputs.of(belief, cell_inputs.rig.hulls(belief.tracks.boxes))
        inputs = np.hstack(
            [seen.rows(np.arange(cell_inputs.rig.grid.size)), cell_inputs.rig_inputs]
        )
        expected = np.maximum(inputs @ layer + bias, 0) @ out
        np.testing.assert_allclose(network.scores(seen), expected, rtol=1e-4, atol=1e-4)


def test_the_reserve_and_no_more_goes_to_the_highest_scores_and_the_rest_is_history(
    encounter, environment
):
    scorer, history = (
        care_sim.make_policy(name, environment) for name in ("learned-scorer", "history")
    )
    for observation in encounter[::4]:
        belief = Belief.from_observation(observation)
        asked = scorer.demand(belief)
        hulls = history.demand(belief).exploitation
        ((reserve,),) = asked.layers
        assert [cells.tolist() for cells in asked.exploitation] == [
            cells.tolist() for cells in hulls
        ]
        assert len(np.unique(reserve)) == len(reserve) == 819 - round(0.7 * 819)
        # The one set of the reserve fits in whole, so that the order of its cells changes nothing.
        backwards = Demand(asked.exploitation, [[reserve[::-1]]])
        fired, other = (set(allocate(demand, 819, 0.3).tolist()) for demand in (asked, backwards))
        assert fired == other


def test_the_shipped_weights_look_where_the_camera_sees_someone_new(encounter, environment):
    """In the dense street at 5% they find the person as soon as CARE does."""
    found = {}
    for name in ("learned-scorer", "care"):
        policy = care_sim.make_policy(name, environment)
        observation, _ = environment.reset(seed=0)
        policy.reset()
        ended = False
        while not ended:
            observation, _, terminated, truncated, info = environment.step(policy(observation))
            ended = terminated or truncated
        found[name] = info["outcome"]["detection_distance_m"]
    assert found["learned-scorer"] >= found["care"] - 1.0


def test_shipped_weights_are_small_and_say_what_they_are():
    path = shipped_weights("learned-scorer")
    card = load_weights(path).card
    assert path.stat().st_size < 3e6
    assert (card.kind, card.budget, card.wrapper, card.scenario) == (
        "learned-scorer",
        None,
        None,
        "CARE-Street-v0",
    )
    assert card.seeds["calibration"] == list(range(1000, 1020))
    assert card.result["loss held out"] < np.log(2)


def test_weights_of_the_user_are_used(drawn, encounter, environment):
    own = care_sim.make_policy("learned-scorer", environment, path=str(drawn))
    usual = care_sim.make_policy("learned-scorer", environment)
    assert any(not np.array_equal(own(o), usual(o)) for o in encounter[::8])


@pytest.mark.parametrize(
    ("card", "arrays", "message"),
    [
        (replace(CARD, kind="ppo"), {}, "kind is 'ppo', needed is 'learned-scorer'"),
        (
            replace(CARD, grid={**CARD.grid, "columns": 256}),
            {},
            "grid is columns 256 .* needed is columns 512",
        ),
        (CARD, {}, "no array 'layer'"),
        (
            CARD,
            {"layer": np.zeros((3, 4))},
            f"array 'layer' has the shape .3, 4., needed is {INPUTS} x any",
        ),
        (
            CARD,
            {"layer": np.zeros((INPUTS, 4)), "bias": np.zeros(4), "out": np.zeros(5)},
            "array 'out' has the shape",
        ),
    ],
)
def test_weights_for_something_else_are_refused_in_one_line(
    tmp_path, environment, card, arrays, message
):
    save_weights(tmp_path / "w.npz", arrays, card)
    with pytest.raises(InvalidInput, match=message) as refusal:
        care_sim.make_policy("learned-scorer", environment, path=tmp_path / "w.npz")
    assert "\n" not in str(refusal.value)


def test_a_rig_with_another_grid_is_refused():
    with pytest.raises(InvalidInput, match=r"grid is .* rows 32 .* needed is .* rows 16 "):
        LearnedScorer(Rig(AngularGrid(rows=16)))


def test_it_plays_six_cameras_with_the_same_weights():
    env = gymnasium.make("CARE-Street-v0", budget=0.1)
    scorer = care_sim.make_policy("learned-scorer", env)
    assert scorer(env.reset(seed=2000)[0]).max() == 1
    env.close()
