"""What every policy keeps to with every hardware on sensors of three kinds, in the closed loop."""

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
from tests.policies.test_sensor_setups import OF_A_GRID

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
    ),
    (2.0, 0.0, 0.6),
    (PinholeCamera(position=(-0.4, 0.0, 0.8)),),
)
"""Ten rows that are not equally spaced, in the bumper, with a camera of its own."""
SETUPS = {"hdl-32e": "hdl-32e", "tilted": TILTED, "forward": FORWARD, "corners": CORNERS}
FIRINGS = (*HARDWARE, "tiles:2x5")
UNFIT = {
    (
        "tilted",
        "tiles:2x5",
    ): "tiles must divide the 128 of the grid, got 5; .* is 4",
    ("hdl-32e", "tiles:2x5"): "columns of firing tiles must divide the 512 of the grid, got 5",
    ("forward", "tiles"): "must divide the 10 of the grid, got 4; the nearest that does is 5",
    ("forward", "segments"): "must divide the 90 of the grid, got 16; the nearest that does is 15",
    ("forward", "azimuth-window"): "firing azimuth-window turns all round, and the grid has no",
    ("corners", "tiles:2x5"): "columns of firing tiles must divide the 64 of the grid, got 5",
    ("corners", "columns"): "firing columns needs LiDARs of as many rows each, got 4 and 8",
    ("corners", "vertical-window"): "window of one LiDAR, and the set-up has 3",
    ("corners", "azimuth-window"): "window of one LiDAR, and the set-up has 3",
}
"""What does not divide the grid."""
OF_ANOTHER_BUDGET = ("full",)
OF_AN_EXTRA = ("farthest-points", "random-points")
"""They need Open3D; the common checks play them where it is installed."""
KEYFRAMES = 2


def policies(setup, firing):
    """All that can be played. Those that rehearse whole episodes first are, on small grids, with
    one hardware.
    """
    left_out = {*OF_ANOTHER_BUDGET, *OF_AN_EXTRA}
    if setup != "hdl-32e":
        left_out |= {*OF_A_GRID}
    if setup == "hdl-32e" or firing != "rows":
        left_out |= {*AS_LISTED}
    return [name for name in BUILT_IN if name not in left_out]


@pytest.mark.parametrize("firing", FIRINGS)
@pytest.mark.parametrize("setup", SETUPS)
def test_whole_units_of_the_budget_and_the_same_after_reset(setup, firing):
    if (setup, firing) in UNFIT:
        with pytest.raises(InvalidInput, match=UNFIT[setup, firing]) as refused:
            gymnasium.make("CARE-Dense-v0", sensor=SETUPS[setup], firing=firing)
        assert "\n" not in str(refused.value)
        return
    with gymnasium.make("CARE-Dense-v0", sensor=SETUPS[setup], budget=0.1, firing=firing) as env:
        rig = env.unwrapped.rig
        for name in policies(setup, firing):
            policy = care_sim.make_policy(name, env, **AS_LISTED.get(name, {}))
            first, again = (list(played(env, policy, KEYFRAMES)) for _ in range(2))
            for (observation, action, fired), (_, same, _) in zip(first, again, strict=True):
                assert env.observation_space.contains(observation), name
                assert env.action_space.contains(action), name
                assert len(fired) == rig.budget, name
                cells, shots = np.unique(fired, return_counts=True)
                assert shots.max() <= rig.hardware.most_shots, name
                units = np.bincount(rig.hardware.unit_of[cells])
                assert {*units.tolist()} <= {0, rig.hardware.unit_cells}, name
                assert np.array_equal(action, same), name


@pytest.mark.parametrize("firing", HARDWARE)
def test_the_full_scan_fires_everything_with_any_hardware(firing):
    with gymnasium.make("CARE-Dense-v0", sensor=TILTED, budget=1.0, firing=firing) as env:
        for *_, fired in played(env, care_sim.make_policy("full", env), KEYFRAMES):
            assert len(fired) == TILTED.grid.size


@pytest.mark.parametrize("name", OF_A_GRID)
@pytest.mark.parametrize("setup", ["tilted", "corners"])
def test_weights_of_another_grid_are_refused_in_one_line(setup, name):
    with (
        gymnasium.make("CARE-Dense-v0", sensor=SETUPS[setup], firing="rows", budget=0.1) as env,
        pytest.raises(
            InvalidInput, match=r"grid is columns 512 .*needed is (3 LiDARs: )?columns"
        ) as refused,
    ):
        care_sim.make_policy(name, env)
    assert "\n" not in str(refused.value)
