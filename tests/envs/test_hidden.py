"""Knowledge that an agent must not have: episodes looked up by their seed."""

import gymnasium
import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.envs import CLOSED_LOOP
from care_sim.streets.street import make_street

SECRET = "6d0f5b7e"


@pytest.mark.parametrize("name", CLOSED_LOOP)
def test_a_secret_makes_another_world_of_a_seed(name):
    places = []
    for text in (False, SECRET, SECRET, SECRET[::-1]):
        with gymnasium.make(name, disable_env_checker=True, secret=text) as env:
            env.reset(seed=0)
            actors = env.unwrapped.loop.world.actors
            places.append([actor.pose_at(time) for actor in actors for time in (0.0, 3.5, 4.0)])
    assert places[1] == places[2]
    assert places[0] != places[1] != places[3]


def test_a_secret_makes_another_street_whose_name_does_not_tell_its_seed():
    with gymnasium.make("CARE-Street-v0", disable_env_checker=True, secret=SECRET) as env:
        _, info = env.reset(seed=7)
        film = env.unwrapped.loop.film
    assert len(film.shots) == 40
    assert film.name == info["scene"] == "street-0007-secret"
    assert {shot.token.partition("/")[0] for shot in film.shots} == {film.name}
    ways = [[(shot.sensor.x, shot.sensor.y) for shot in film.shots], make_street(7).ego[:, :2]]
    assert not np.allclose(*ways, atol=2.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"secret": None}, "secret must be a text"),
        ({"scoring_info": 1}, "scoring_info must be True or False, got 1"),
    ],
)
@pytest.mark.parametrize("name", ["CARE-Dense-v0", "CARE-Street-v0"])
def test_another_value_is_refused_in_one_line(name, arguments, message):
    with pytest.raises(InvalidInput, match=message):
        gymnasium.make(name, disable_env_checker=True, **arguments)
