"""What all policies of our own keep to."""

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput

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


def test_no_cell_of_a_set_is_asked_for_twice_in_a_round(environment, encounter):
    for name in HULL_LAYERS:
        policy = care_sim.make_policy(name, environment)
        for observation in encounter:
            policy(observation)
            for layer in policy.demanded.layers:
                for cells in layer:
                    assert len(np.unique(cells)) == len(cells)


@pytest.mark.parametrize("name", HULL_LAYERS)
@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"min_returns": 0}, "min_returns must be a whole number"),
        ({"min_returns": 2.5}, "min_returns must be a whole number"),
    ],
)
def test_bad_parameters_are_named(name, parameters, message):
    with (
        gymnasium.make("CARE-Dense-v0") as env,
        pytest.raises(InvalidInput, match=message),
    ):
        care_sim.make_policy(name, env, **parameters)
