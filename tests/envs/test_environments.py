"""Every environment of the closed loop through the same checks."""

import pickle
import warnings
from dataclasses import dataclass, fields

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import ClosedLoopConditions
from care_sim.envs import CLOSED_LOOP
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.reward import REWARD_WEIGHTS
from care_sim.loops.records import DriveOutcome, Outcome
from care_sim.scenarios.base import Scenario
from care_sim.scenarios.dartout import Dartout
from care_sim.world.bodies import CATALOGUE
from care_sim.world.traffic import Traffic
from care_sim.world.world import World

EXPLAINED = (
    "symmetric and normalized Box action space",  # scores are shares of attention: 0 to 1
    "unconventional shape",  # tables and the grid are 2D on purpose
)

NOTHING = np.zeros((32, 512), np.float32)
EVERYTHING = np.ones((32, 512), np.float32)
ONE_STREET = {
    "ego_speed_mps": (8.3, 8.3),
    "crossing_m": (39.0, 39.0),
    "gap_m": (1.0, 1.0),
    "run_mps": (2.7, 2.7),
    "kerb_offset_m": (0.0, 0.0),
    "encroachment_s": (0.45, 0.45),
    "place_jitter_m": (0.0, 0.0),
}
"""A dense street that is the same for every seed."""


@dataclass(frozen=True)
class BusAhead(Scenario):
    """A bus stands in the way of a car at 10 m/s, too near to stop for."""

    gap_m: float = 6.85

    def build(self, rng):
        world = World(Traffic((1,), 0, 3.5, 14.0), ego_speed=10.0)
        place = (CATALOGUE["ego"].size[0] + CATALOGUE["bus"].size[0]) / 2 + self.gap_m
        world.first_sighting = world.add("bus", "bus", (place, 0.0, 0.0))
        return world


def make(name, **arguments):
    return gymnasium.make(name, disable_env_checker=True, **arguments)


def unexplained(caught):
    messages = [str(warning.message) for warning in caught]
    return [message for message in messages if not any(known in message for known in EXPLAINED)]


@pytest.mark.parametrize("name", CLOSED_LOOP)
def test_gymnasium_finds_nothing_to_complain_about(name):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        env = make(name, render_mode="rgb_array", duration_s=1.0)
        check_env(env.unwrapped)
        env.close()
    assert unexplained(caught) == []


@pytest.mark.parametrize("name", CLOSED_LOOP)
def test_stable_baselines3_finds_nothing_to_complain_about(name):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        env = make(name, duration_s=1.0)
        checker.check_env(env.unwrapped)
        env.close()
    assert unexplained(caught) == []


@pytest.mark.smoke
@pytest.mark.parametrize("name", CLOSED_LOOP)
def test_an_episode_stays_inside_its_spaces_and_ends(name):
    env = make(name, duration_s=2.0)
    observation, info = env.reset(seed=3)
    assert info.pop("seed") == 3
    # What a seed may draw of a scenario's parameters is told too.
    assert set(info) <= {"drawn"}
    ended = False
    while not ended:
        assert env.observation_space.contains(observation)
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        assert reward <= 0.0
        assert set(info["reward_terms"]) == set(REWARD_WEIGHTS)
        assert len(info["fired"]) == env.unwrapped.rig.budget
        ended = terminated or truncated
    assert env.observation_space.contains(observation)
    outcome = info["outcome"]
    assert outcome["rays_fired"] == 20 * env.unwrapped.rig.budget
    of_a_drive = {field.name for field in fields(DriveOutcome)} - {
        field.name for field in fields(Outcome)
    }
    assert set(outcome) - (of_a_drive if name == "CARE-Drive-v0" else set()) == {
        "detection_distance_m",
        "undetected_to_m",
        "braked",
        "min_distance_m",
        "clearance_m",
        "collision",
        "impact_speed_mps",
        "rays_fired",
        "braked_before_view",
        "closing_speed_mps",
        "hit_kind",
        "hit_at_front",
    }
    env.close()


@pytest.mark.parametrize("name", CLOSED_LOOP)
def test_the_import_name_makes_the_environment_too(name):
    env = gymnasium.make(f"care_sim:{name}", disable_env_checker=True)
    again = gymnasium.make(pickle.loads(pickle.dumps(env.spec)), disable_env_checker=True)
    assert isinstance(again.unwrapped, ClosedLoopEnv)
    assert again.unwrapped.scenario == env.unwrapped.scenario


def test_it_documents_itself():
    for name in CLOSED_LOOP:
        text = type(make(name).unwrapped).__doc__
        assert name in text
        for heading in (
            "### Action",
            "### Observation",
            "### Reward",
            "### Episode end",
            "### Arguments",
        ):
            assert heading in text


def test_fewer_scores_than_cells_are_topped_up_from_the_floor_or_left_unspent():
    mask = np.zeros((32, 512), bool)
    mask[10, :100] = True
    fired = {}
    for floor in (True, False):
        env = make("CARE-Dartout-v0", budget=0.1, floor=floor)
        env.reset(seed=0)
        fired[floor] = env.step(mask)[-1]["fired"]
        env.close()
    chosen = np.flatnonzero(mask)
    np.testing.assert_array_equal(fired[False], chosen)
    assert len(fired[True]) == 1638
    assert set(chosen) <= set(fired[True])


def test_policies_meet_the_same_floor_world_and_misses():
    fired = []
    seen = []
    for name in ("random", "history"):
        env = make("CARE-Dartout-v0", false_negative_rate=0.5)
        policy = care_sim.make_policy(name, env)
        observation, _ = env.reset(seed=5)
        for _ in range(5):
            seen.append(observation["detections"])
            observation, *_, info = env.step(policy(observation))
            fired.append(info["fired"])
        env.close()
    np.testing.assert_array_equal(fired[:5], fired[5:])
    np.testing.assert_array_equal(seen[:5], seen[5:])


def floors(seed, *actions):
    """What fires at three keyframes without a score, after the keyframes of `actions`."""
    env = make("CARE-Dartout-v0", budget=0.01)
    env.reset(seed=seed)
    for action in actions:
        env.step(action)
    fired = [env.step(NOTHING)[-1]["fired"].tolist() for _ in range(3)]
    env.close()
    return fired


def test_the_floor_is_another_at_every_keyframe_and_for_every_seed():
    cells = [tuple(fired) for seed in (0, 1) for fired in floors(seed)]
    assert len(set(cells)) == 6
    assert all(len(set(fired)) == 164 for fired in cells)


def test_the_floor_of_a_seed_and_keyframe_is_the_same_whatever_was_fired_before():
    some = np.zeros((32, 512), np.float32)
    some[5, :30] = 1.0
    after_nothing = floors(4, NOTHING, NOTHING)
    assert floors(4, some, EVERYTHING) == after_nothing
    assert floors(4)[2] == after_nothing[0]


@pytest.mark.parametrize("scored", [0, 163, 164, 165])
def test_the_floor_spends_what_an_action_leaves(scored):
    env = make("CARE-Dartout-v0", budget=0.01)
    env.reset(seed=0)
    action = np.zeros((32, 512), np.float32)
    action.ravel()[:scored] = 1.0
    fired = env.step(action)[-1]["fired"]
    env.close()
    assert len(fired) == 164
    assert np.count_nonzero(fired < 164) >= min(scored, 164)


def test_the_next_episode_of_an_environment_has_another_floor():
    env = make("CARE-Dartout-v0", budget=0.01)
    fired = []
    for seed in (3, None, None, 3):
        env.reset(seed=seed)
        fired.append(env.step(NOTHING)[-1]["fired"].tolist())
    env.close()
    assert fired[0] == fired[3]
    assert len({tuple(cells) for cells in fired}) == 3


def seen_and_scanned(seed):
    env = make(
        "CARE-Dense-v0", budget=1.0, false_negative_rate=0.5, lidar_dropout=0.5, **ONE_STREET
    )
    observation, _ = env.reset(seed=seed)
    seen = [observation["detections"].tolist()]
    for _ in range(2):
        observation, *_ = env.step(EVERYTHING)
        seen.append(observation["detections"].tolist())
    env.close()
    return seen, observation["ranges"].tolist()


def test_misses_and_losses_are_the_seeds_own_even_where_the_street_is_not():
    (seen, scan), (other_seen, other_scan) = (seen_and_scanned(seed) for seed in (0, 1))
    assert seen != other_seen
    assert scan != other_scan
    assert seen_and_scanned(0) == (seen, scan)


def test_arguments_of_the_sensing_arrive():
    arguments = {
        "min_returns": 9,
        "false_negative_rate": 0.2,
        "camera_latency": 2,
        "lidar_dropout": 0.1,
    }
    env = make("CARE-Dartout-v0", **arguments).unwrapped
    assert env.conditions == ClosedLoopConditions(**arguments)


def braked_by(**driver):
    """When the brake is on and how fast the car is, keyframe by keyframe, behind a standing bus
    15 m ahead.
    """
    env = make("CARE-Dartout-v0", budget=1.0, **driver).unwrapped
    env.scenario = BusAhead(gap_m=15.0)
    env.reset(seed=0)
    over = False
    while not over:
        _, _, terminated, truncated, _ = env.step(EVERYTHING)
        over = terminated or truncated
    env.close()
    return [frame.braking for frame in env.keyframes], [frame.speed_mps for frame in env.keyframes]


def test_the_driver_and_its_rules_are_arguments():
    """The controller brakes at once, 15 m being its stopping distance. The careful human evaluates
    for 0.4 s, since the bus is a danger from the start, and brakes 0.75 s later.
    """
    braking, speeds = braked_by()
    assert (braking[0], speeds[:5]) == (True, pytest.approx([10, 10, 10, 10, 9.5]))
    _, harder = braked_by(brake_mps2=8.0, brake_reaction_s=0.1, brake_standstill_m=8.0)
    assert harder[:3] == pytest.approx([10, 10, 9.2])
    braking, speeds = braked_by(driver="careful-human")
    assert braking[:5] == [False] * 4 + [True]
    assert min(speeds[:12]) == 10.0 > speeds[12]


def test_every_condition_stands_on_the_page_of_the_environments():
    names = [field.name for field in fields(ClosedLoopConditions)]
    assert [name for name in names if f"`{name}`" not in ClosedLoopEnv.__doc__] == []


def test_a_contact_ends_the_episode_with_the_speed_it_happened_at():
    """Braking from 0.3 s on covers 3.65 m by 0.70 s, 4.05 m by 0.75 s; 7.75 m/s are left."""
    env = make("CARE-Dartout-v0", budget=1.0).unwrapped
    env.scenario = BusAhead()
    env.reset(seed=0)
    steps = [env.step(EVERYTHING) for _ in range(8)]
    env.close()
    assert [step[2:4] for step in steps] == [(False, False)] * 7 + [(True, False)]
    assert ["outcome" in step[4] for step in steps] == [False] * 7 + [True]
    outcome = steps[-1][4]["outcome"]
    assert (outcome["collision"], outcome["braked"]) == (True, True)
    assert outcome["impact_speed_mps"] == pytest.approx(7.75)
    assert outcome["rays_fired"] == 8 * 16384
    assert [step[4]["reward_terms"]["collision"] < 0 for step in steps] == [False] * 7 + [True]


def test_a_person_who_is_run_into_ends_the_episode():
    """A detector that never speaks, and a person who would need the car to come a quarter second
    later.
    """
    env = make("CARE-Dartout-v0", min_returns=10**6).unwrapped
    env.scenario = Dartout(encroachment_s=(-0.3, -0.2), crossing_m=(20.0, 20.0))
    env.reset(seed=0)
    terminated = truncated = False
    while not (terminated or truncated):
        *_, terminated, truncated, info = env.step(NOTHING)
    env.close()
    assert (terminated, truncated) == (True, False)
    assert info["speed_mps"] * info["time_s"] == pytest.approx(20.0, abs=3.3)
    outcome = info["outcome"]
    assert (outcome["collision"], outcome["braked"], outcome["detection_distance_m"]) == (
        True,
        False,
        None,
    )
    assert outcome["impact_speed_mps"] == pytest.approx(info["speed_mps"])
    assert outcome["clearance_m"] <= 0.0


def test_a_drive_ends_at_its_goal():
    drive = make("CARE-Drive-v0", budget=0.01).unwrapped
    drive.reset(seed=0)
    world = drive.loop.world
    world.ego.along = world.goal_m - 1.5 * drive.rig.keyframe_s * world.ego.speed
    first, second = (drive.step(NOTHING) for _ in range(2))
    assert (first[2:4], second[2:4]) == ((False, False), (True, False))
    assert second[4]["outcome"]["progress"] >= 1.0
    drive.close()


@pytest.mark.parametrize(
    ("duration", "keyframe", "steps"),
    [(0.1, 0.1, 1), (0.3, 0.1, 3), (0.7, 0.1, 7), (0.6, 0.2, 3), (0.25, 0.1, 3)],
)
def test_an_episode_is_cut_off_at_its_duration_and_not_a_step_later(duration, keyframe, steps):
    env = make("CARE-Dartout-v0", budget=0.01, duration_s=duration, keyframe_s=keyframe)
    env.reset(seed=0)
    ends = [env.step(NOTHING)[2:] for _ in range(steps)]
    env.close()
    assert [(terminated, truncated) for terminated, truncated, _ in ends] == [(False, False)] * (
        steps - 1
    ) + [(False, True)]
    assert ["outcome" in info for *_, info in ends] == [False] * (steps - 1) + [True]
    assert ends[-1][2]["outcome"]["collision"] is False


def test_a_vector_of_environments_without_a_floor_fires_what_each_was_told():
    masks = np.zeros((2, 32, 512), np.float32)
    masks[0, 10, :10] = masks[1, 10, :20] = 1.0
    envs = gymnasium.make_vec(
        "CARE-Dartout-v0",
        num_envs=2,
        vectorization_mode="sync",
        vector_kwargs={"copy": True},
        floor=False,
    )
    envs.reset(seed=0)
    for _ in range(2):
        observation, *_ = envs.step(masks)
        assert [np.count_nonzero(scan) for scan in observation["ranges"]] == [10, 20]
    envs.close()


def test_rendering_changes_nothing():
    scans = []
    for mode in (None, "rgb_array"):
        env = make("CARE-Dense-v0", render_mode=mode)
        env.reset(seed=0)
        env.action_space.seed(0)
        for _ in range(3):
            observation, *_ = env.step(env.action_space.sample())
            picture = env.render()
        scans.append(observation["ranges"])
        env.close()
    np.testing.assert_array_equal(*scans)
    assert picture.dtype == np.uint8
    assert picture.ndim == 3


def test_close_then_reset_and_two_in_one_process():
    first, second = make("CARE-Dense-v0"), make("CARE-Dense-v0")
    before, _ = first.reset(seed=1)
    second.reset(seed=2)
    second.step(second.action_space.sample())
    first.close()
    after, _ = first.reset(seed=1)
    for key in before:
        np.testing.assert_array_equal(before[key], after[key])
    first.close()
    first.close()
    second.step(second.action_space.sample())
    second.close()


def test_step_before_reset_says_so():
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
        make("CARE-Dense-v0").unwrapped.step(np.zeros((32, 512), np.float32))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"budget": 0.0}, "budget must lie in"),
        ({"budget": 1.5}, "budget must lie in"),
        ({"budget": float("nan")}, "budget must lie in"),
        ({"budget": 1e-5}, "leaves no cell"),
        ({"reserve_fraction": -0.1}, "reserve_fraction must lie in"),
        ({"false_negative_rate": 1.2}, "false_negative_rate must lie in"),
        ({"camera_latency": -1}, "camera_latency must be"),
        ({"camera_latency": 0.5}, "camera_latency must be"),
        ({"min_returns": 0}, "min_returns must be"),
        ({"lidar_dropout": 2.0}, "dropout must lie in"),
        ({"lidar_range_sigma": -1.0}, "range_sigma"),
        ({"engine": "magic"}, "unknown engine 'magic'; known: bullet"),
        ({"cell_order": "magic"}, "unknown cell_order 'magic'; known: as-demanded, columns"),
        ({"driver": "magic"}, "unknown driver 'magic'; known: careful-human, fixed"),
        ({"brake_mps2": 0.0}, "brake_mps2 must lie in"),
        ({"keyframe_s": 0.12}, "multiple of the world step"),
        ({"render_mode": "ascii"}, "render_mode must be"),
        ({"occluder": "cloud"}, "unknown occluder"),
        ({"vehicles": 99}, "vehicles of dense must be a whole number >= 0 and <= 12"),
        (
            {"weather": "rain"},
            "unknown argument of DenseEnv 'weather'; known: .*budget, .*, secret, sensor, vehicles",
        ),
        ({"secrt": "x"}, "unknown argument of DenseEnv 'secrt', the nearest is secret; known: "),
        ({"bugdet": 0.1}, "the nearest is budget; known: "),
        ({"vehicle": 3}, "the nearest is vehicles; known: "),
        ({"camera_latncy": 1}, "the nearest is camera_latency; known: "),
        ({"secret": ""}, "secret must not be empty: leave it out, or give False"),
        ({"reward_weights": {"speed": 1.0}}, "unknown reward term"),
    ],
)
def test_bad_arguments_get_one_clear_line(arguments, message):
    with pytest.raises(care_sim.InvalidInput, match=message) as caught:
        make("CARE-Dense-v0", **arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (np.zeros((512, 32), np.float32), "shape"),
        (np.full((32, 512), np.nan, np.float32), "NaN"),
        (np.full((32, 512), "a"), "numbers"),
    ],
)
def test_bad_actions_get_one_clear_line_and_leave_the_episode_alone(action, message):
    env = make("CARE-Dartout-v0").unwrapped
    env.reset(seed=0)
    with pytest.raises(care_sim.InvalidInput, match=message):
        env.step(action)
    assert env.loop.index == 0
    env.close()


def test_reward_weights_can_be_changed():
    env = make("CARE-Dartout-v0", reward_weights={"delay": 7.0}).unwrapped
    assert env.reward_weights["delay"] == 7.0
    assert env.reward_weights["collision"] == REWARD_WEIGHTS["collision"]


@pytest.mark.parametrize("name", ["CARE-NCAP-v0", "CARE-Street-v0"])
def test_reset_takes_no_options(name):
    with (
        gymnasium.make(name, disable_env_checker=True) as env,
        pytest.raises(InvalidInput, match=r"reset takes no options, got \{'test': 'CPNA-25'\}"),
    ):
        env.reset(seed=0, options={"test": "CPNA-25"})
