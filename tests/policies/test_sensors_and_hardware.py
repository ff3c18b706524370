"""Rules that every policy keeps with other sensors and hardware than the default: each on one of
them in turn, and every one with four policies.
"""

from itertools import product

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.certify.design import AS_LISTED
from care_sim.core.firing.listing import HARDWARE
from care_sim.core.grid import AngularGrid
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.sensor_setup import SensorSetup
from care_sim.policies import BUILT_IN
from tests.helpers.lidars import CORNERS
from tests.helpers.played_keyframes import played

DEGREE = np.pi / 180
TILTED = SensorSetup(
    "tilted",
    AngularGrid(128, 16, 8 * DEGREE, -22 * DEGREE, pitch=-4 * DEGREE, roll=3 * DEGREE),
    (1.2, -0.3, 1.5),
)
"""All round, on the roof, leaning to its right front."""
FORWARD = SensorSetup(
    "forward",
    AngularGrid.of_elevations(
        [angle * DEGREE for angle in (6, 3, 1, 0.4, 0, -0.4, -1, -3, -6, -12)],
        90,
        field_of_view=120 * DEGREE,
        heading=0.2,
    ),
    (1.8, 0.4, 0.7),
    (PinholeCamera(position=(-0.4, 0.0, 0.8)),),
)
"""Ten rows that are not equally spaced, from a corner of the bumper, with a camera of its own."""
SETUPS = {"hdl-32e": "hdl-32e", "tilted": TILTED, "forward": FORWARD, "corners": CORNERS}
FIRINGS = (*HARDWARE, "tiles:2x5")
UNFIT = {
    ("tilted", "tiles:2x5"): "tiles must divide the 128 of the grid, got 5; .* is 4",
    ("hdl-32e", "tiles:2x5"): "columns of firing tiles must divide the 512 of the grid, got 5",
    ("forward", "tiles"): "must divide the 10 of the grid, got 4; the nearest that does is 5",
    ("forward", "segments"): "must divide the 90 of the grid, got 16; the nearest that does is 15",
    ("forward", "azimuth-window"): "firing azimuth-window turns all round, and the grid has no",
    ("corners", "tiles:2x5"): "columns of firing tiles must divide the 64 of the grid, got 5",
    ("corners", "columns"): "firing columns needs LiDARs of as many rows each, got 4 and 8",
    ("corners", "vertical-window"): "window of one LiDAR, and the set-up has 3",
    ("corners", "azimuth-window"): "window of one LiDAR, and the set-up has 3",
}
"""Hardware that does not fit the grid, with its refusal."""
OF_A_GRID = (
    "place",
    "tuned-place",
    "place-hulls",
    "history-place",
    "learned-scorer",
    "learned-sets",
    *(name for name in BUILT_IN if name.startswith("ppo")),
)
"""Their weights fit the default grid alone."""
FOUR = ("care", "care-sbf", "care-units", "uncertainty")
FITTING = [pair for pair in product(SETUPS, FIRINGS) if pair not in UNFIT]
OTHERS = [pair for pair in FITTING if pair[0] != "hdl-32e"]
ANY_GRID = [name for name in BUILT_IN if name not in (*OF_A_GRID, "full")]
TURNS = [(*OTHERS[n % len(OTHERS)], (name,)) for n, name in enumerate(ANY_GRID)]
CASES = [*((*pair, FOUR) for pair in FITTING), *TURNS]


@pytest.mark.parametrize(("setup", "firing", "names"), CASES)
def test_whole_units_of_the_budget_and_the_same_after_reset(setup, firing, names, request):
    if names == ("farthest-points",):
        request.getfixturevalue("open3d")
    with gymnasium.make("CARE-Dense-v0", sensor=SETUPS[setup], budget=0.1, firing=firing) as env:
        rig = env.unwrapped.rig
        for name in names:
            policy = care_sim.make_policy(name, env, **AS_LISTED.get(name, {}))
            first, again = (list(played(env, policy, 2)) for _ in range(2))
            for (observation, action, fired), (_, same, _) in zip(first, again, strict=True):
                assert env.observation_space.contains(observation), name
                assert env.action_space.contains(action), name
                assert len(fired) == rig.budget, name
                cells, shots = np.unique(fired, return_counts=True)
                assert shots.max() <= rig.hardware.most_shots, name
                units = np.bincount(rig.hardware.unit_of[cells])
                assert {*units.tolist()} <= {0, rig.hardware.unit_cells}, name
                assert np.array_equal(action, same), name


@pytest.mark.parametrize(("setup", "firing"), UNFIT)
def test_hardware_that_does_not_fit_a_grid_is_refused_in_one_line(setup, firing):
    with pytest.raises(InvalidInput, match=UNFIT[setup, firing]) as refused:
        gymnasium.make("CARE-Dense-v0", sensor=SETUPS[setup], firing=firing)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("setup", [FORWARD, CORNERS], ids=["forward", "corners"])
def test_a_street_is_played_too(setup, short_streets):
    with gymnasium.make("CARE-Street-v0", sensor=setup, budget=0.05) as env:
        for name in ("care", "care-sightlines", "history-uniform", "rows"):
            for *_, action, fired in played(env, care_sim.make_policy(name, env), 2):
                assert {*np.flatnonzero(action).tolist()} <= {*fired.tolist()}


@pytest.mark.parametrize("name", OF_A_GRID)
@pytest.mark.parametrize(
    ("setup", "needed"), [(TILTED, "columns 128"), (CORNERS, "3 LiDARs: columns 64")]
)
def test_weights_of_another_grid_are_refused_in_one_line(name, setup, needed):
    way_on = "belongs to the cells of that grid: play the sensor set-up that has it, or a policy"
    told = rf"grid is columns 512 .*needed is {needed}.*{way_on}"
    with (
        gymnasium.make("CARE-Dense-v0", sensor=setup, firing="rows", budget=0.1) as env,
        pytest.raises(InvalidInput, match=told) as refused,
    ):
        care_sim.make_policy(name, env)
    assert "\n" not in str(refused.value)


def test_the_full_scan_fires_everything_and_finds_the_person_from_the_bumper_too():
    """The person who steps out is two metres further ahead of the roof than of the bumper."""
    found = []
    for sensor in ("hdl-32e", FORWARD):
        with gymnasium.make("CARE-Dense-v0", sensor=sensor, budget=1.0, firing="rows") as env:
            policy = care_sim.make_policy("full", env)
            observation, _ = env.reset(seed=0)
            over = False
            while not over:
                observation, _, terminated, truncated, info = env.step(policy(observation))
                over = terminated or truncated
                assert len(info["fired"]) == env.unwrapped.rig.grid.size
            found.append(info["outcome"]["detection_distance_m"])
    usual, bumper = found
    assert bumper == pytest.approx(usual - 1.8 - 0.445, abs=1.5)
