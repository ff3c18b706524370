"""What every policy keeps to with other sensors than the default, in both loops."""

from itertools import product

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.grid import AngularGrid
from care_sim.core.sensor_setup import SensorSetup
from care_sim.policies import BUILT_IN
from tests.helpers.lidars import CORNERS
from tests.helpers.played_keyframes import played

SMALL = SensorSetup(
    "small",
    AngularGrid.of_elevations(
        np.deg2rad([4.0, 1.0, 0.0, -0.7, -1.5, -4.0, -12.0]),
        150,
        field_of_view=np.deg2rad(300.0),
        heading=0.5,
    ),
    (1.8, 0.4, 0.7),
)
"""Listed rows and a gap behind on the right, from a corner of the bumper."""
SETUPS = {"m1-forward": "m1-forward", "os1-64": "os1-64", "small": SMALL, "corners": CORNERS}
OF_A_GRID = (
    "place",
    "place-hulls",
    "history-place",
    "learned-scorer",
    "learned-sets",
    *(name for name in BUILT_IN if name.startswith("ppo")),
)
"""Their weights fit the default grid alone."""
SLOW = ("learned-place", "history-learned-place", "seed-finder", "farthest-points")
"""They take seconds on large grids: all but the last play whole episodes first."""
KEYFRAMES = 3
# A film of a street takes seconds on a large grid, too.
CASES = [
    pytest.param(environment, setup, name, id=f"{environment}-{setup}-{name}")
    for environment, setup in [
        *product(["CARE-Street-v0"], ["small", "corners"]),
        *product(["CARE-Dense-v0"], SETUPS),
    ]
    for name in BUILT_IN
    if name not in OF_A_GRID and (setup == "small" or name not in SLOW)
]


@pytest.fixture(scope="module")
def environments(short_streets):
    """One environment per set-up and budget, made when it is first asked for."""
    made = {}

    def environment(name, setup, budget):
        key = name, setup, budget
        if key not in made:
            made[key] = gymnasium.make(name, sensor=SETUPS[setup], budget=budget)
        return made[key]

    yield environment
    for env in made.values():
        env.close()


@pytest.mark.parametrize(("environment", "setup", "name"), CASES)
def test_within_the_budget_and_the_same_after_reset(
    environments, request, environment, setup, name
):
    if name in ("farthest-points", "random-points"):
        request.getfixturevalue("open3d")
    env = environments(environment, setup, 1.0 if name == "full" else 0.05)
    policy = care_sim.make_policy(name, env)
    first, again = (list(played(env, policy, KEYFRAMES)) for _ in range(2))
    budget = env.unwrapped.rig.budget
    for (observation, action, fired), (_, same, _) in zip(first, again, strict=True):
        assert env.observation_space.contains(observation)
        assert env.action_space.contains(action)
        asked = np.flatnonzero(action)
        assert len(asked) <= budget
        assert len(set(fired.tolist())) == len(fired) == budget
        assert set(asked.tolist()) <= set(fired.tolist())
        assert np.array_equal(action, same)


@pytest.mark.parametrize("name", OF_A_GRID)
@pytest.mark.parametrize(
    ("setup", "needed"), [("os1-64", "columns 1024"), ("corners", "3 LiDARs: columns 64")]
)
def test_weights_of_another_grid_are_refused_in_one_line(environments, name, setup, needed):
    env = environments("CARE-Dense-v0", setup, 0.05)
    way_on = "belongs to the cells of that grid: play the sensor set-up that has it, or a policy"
    told = rf"grid is columns 512 .*needed is {needed}.*{way_on}"
    with pytest.raises(InvalidInput, match=told):
        care_sim.make_policy(name, env)


def test_the_person_is_found_from_the_bumper_too():
    """The full scan of the dense street sees whoever steps out, two metres further ahead."""
    found = []
    for sensor in ("hdl-32e", SMALL):
        with gymnasium.make("CARE-Dense-v0", sensor=sensor, budget=1.0) as env:
            policy = care_sim.make_policy("full", env)
            observation, _ = env.reset(seed=0)
            over = False
            while not over:
                observation, _, terminated, truncated, info = env.step(policy(observation))
                over = terminated or truncated
            found.append(info["outcome"]["detection_distance_m"])
    usual, bumper = found
    assert bumper == pytest.approx(usual - 1.8 - 0.445, abs=1.5)
