"""Cells that are fired several times, in both loops."""

import gymnasium
import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.firing.actions import scores_of
from care_sim.envs.scenes import FilmEnv

LOOPS = ("CARE-Dense-v0", "CARE-Street-v0")
FAINT = {"lidar_stated_range_m": 15.0, "visibility_m": 200.0}
CELLS = np.arange(512 * 6, 512 * 14, 3)
"""Around the horizon, where bodies stand."""


@pytest.fixture(scope="module", params=LOOPS)
def loop(request, short_streets):
    return request.param


def seen(loop, shots, firing="energy:4", **settings):
    """Ranges (E, A) and info after `CELLS` were fired so many times."""
    budget = shots * len(CELLS) / (32 * 512)
    with gymnasium.make(loop, budget=budget, floor=False, firing=firing, **settings) as env:
        env.reset(seed=3)
        observation, *_, info = env.step(scores_of(CELLS, (32, 512)))
        return observation["ranges"].ravel()[CELLS], info


def test_more_shots_return_more_and_what_returned_before_stays(loop):
    once, some, most = (seen(loop, shots, **FAINT)[0] for shots in (1, 2, 4))
    for few, many in ((once, some), (some, most)):
        returned = few < 50
        assert np.array_equal(few[returned], many[returned])
        assert (many < 50).sum() > returned.sum() > 0


def test_every_shot_stands_in_info_and_tells_the_same(loop):
    ranges, info = seen(loop, 4, **FAINT)
    assert info["fired"] == np.repeat(CELLS, 4).tolist()
    told = np.array(info["intensities"]).reshape(-1, 4)
    assert (told == told[:, :1]).all()
    assert np.array_equal(told[:, 0] > 0, ranges < 50)


@pytest.mark.parametrize("kept", ["last", "both"])
def test_a_street_that_one_film_cannot_tell_is_refused_in_one_line(kept):
    settings = {"lidar_divergence_mrad": 3.0, "lidar_returns": kept, **FAINT}
    with pytest.raises(InvalidInput, match="lidar_returns must be strongest on a street"):
        gymnasium.make("CARE-Street-v0", firing="energy", **settings)


def test_a_film_of_fewer_shots_is_refused_in_one_line(short_streets):
    with gymnasium.make("CARE-Street-v0", firing="energy:2", **FAINT) as env:
        env.reset(seed=0)
        film = env.unwrapped.loop.film
    with FilmEnv(film, firing="cells", **FAINT) as env:
        assert env.rig.hardware.most_shots == 1
    with pytest.raises(InvalidInput, match="holds what returns to 2 shots of a cell at most"):
        FilmEnv(film, firing="energy:3", **FAINT)
