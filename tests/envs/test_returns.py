"""Rules that every switch of the returns keeps in every loop."""

import gymnasium
import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import RETURN_SETTINGS
from tests.envs.test_causality import BEHIND, observe
from tests.helpers.short_streets import few_and_short

STATED = {"lidar_stated_range_m": 40.0}
SWITCHES = {
    "signal": STATED,
    "weather": {
        "lidar_stated_range_m": 100.0,
        "lidar_stated_reflectance": 0.8,
        "visibility_m": 60.0,
        "rain_mm_h": 20.0,
    },
    "rolling": {"lidar_sweep_s": 0.1, "lidar_compensated": True},
    "wide": {"lidar_divergence_mrad": 6.0, "lidar_returns": "both"},
    "crosstalk": {"lidar_crosstalk": 0.2},
}
LOOPS = ("CARE-Dense-v0", "CARE-Street-v0")
every_switch = pytest.mark.parametrize("switch", SWITCHES)
every_filmed_switch = pytest.mark.parametrize("switch", [n for n in SWITCHES if n != "crosstalk"])


ALL = {name: value for settings in SWITCHES.values() for name, value in settings.items()}


@pytest.fixture(scope="module", params=LOOPS)
def loop(request):
    with few_and_short(keyframes=4):
        yield request.param


def masks(seed=0, share=0.05):
    rng = np.random.default_rng(seed)
    return [(rng.random((32, 512)) < share).astype(np.float32) for _ in range(3)]


def seen(loop, actions, **settings):
    """Ranges and info of each keyframe."""
    with gymnasium.make(loop, budget=0.1, floor=False, **settings) as env:
        env.reset(seed=3)
        steps = [env.step(action) for action in actions]
        return [(observation["ranges"].copy(), info) for observation, *_, info in steps]


def test_every_setting_is_switched_on_here():
    assert {*ALL} == {*RETURN_SETTINGS}


@every_switch
def test_a_switch_changes_what_returns_and_not_what_fires(loop, switch):
    plain = seen(loop, masks())
    switched = seen(loop, masks(), **SWITCHES[switch])
    assert any(not np.array_equal(a, b) for (a, _), (b, _) in zip(plain, switched, strict=True))
    for (a, before), (b, after) in zip(plain, switched, strict=True):
        assert before["fired"] == after["fired"]
        assert np.array_equal(a > 0, b > 0)


@every_switch
def test_a_cell_returns_the_same_whichever_others_fire(loop, switch):
    """Common random numbers, where any are drawn."""
    few, more = masks(), [np.maximum(a, b) for a, b in zip(masks(), masks(1), strict=True)]
    ((one, _),) = seen(loop, few[:1], **SWITCHES[switch])
    ((other, _),) = seen(loop, more[:1], **SWITCHES[switch])
    fired = few[0] > 0
    assert np.array_equal(one[fired], other[fired])


@every_filmed_switch
def test_cells_tell_intensities_beside_what_fired(loop, switch):
    for ranges, info in seen(loop, masks(), **SWITCHES[switch]):
        returned = ranges.ravel()[info["fired"]] < 50
        told = np.array(info["intensities"])
        assert 0 < returned.sum() < len(returned)
        assert np.array_equal(told > 0, returned)
        assert told.max() <= 1
        if "times_s" in info:
            assert np.array_equal(np.array(info["times_s"]) < 0, returned)
        assert ("times_s" in info) == (switch == "rolling")
    assert not {"intensities", "times_s"} & {*seen(loop, masks()[:1])[0][1]}


@every_switch
def test_moving_what_nobody_looks_at_changes_nothing(switch):
    forward = np.zeros((32, 512), bool)
    forward[:, 192:320] = True
    near, far = (
        observe("CARE-Dense-v0", pose, forward, **SWITCHES[switch])[0]
        for pose in (BEHIND, (-30.0, -1.0, 0.5))
    )
    for before, after in zip(near, far, strict=True):
        for key in before:
            np.testing.assert_array_equal(before[key], after[key])


@every_switch
def test_both_engines_return_alike(switch):
    fast, bullet = (
        seen("CARE-Dense-v0", masks(), engine=engine, **SWITCHES[switch])
        for engine in ("fast", "bullet")
    )
    for (a, _), (b, _) in zip(fast, bullet, strict=True):
        assert (np.abs(a - b) > 0.01).mean() < 1e-3


def test_recordings_take_crosstalk(drive):
    """A ghost needs no surface."""
    source = f"argoverse2:{drive.parent}"
    plain, haunted = (
        seen("CARE-Replay-v0", masks(), source=source, **given)
        for given in ({}, SWITCHES["crosstalk"])
    )
    assert all((a != b).any() for (a, _), (b, _) in zip(plain, haunted, strict=True))


def test_a_sweep_that_outlasts_a_keyframe_is_refused():
    with pytest.raises(InvalidInput, match=r"lidar_sweep_s must be at most the 0\.1 s between"):
        gymnasium.make("CARE-Dense-v0", lidar_sweep_s=0.2)
    gymnasium.make("CARE-Street-v0", lidar_sweep_s=0.2).close()
