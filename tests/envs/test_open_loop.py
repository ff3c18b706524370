"""The environments of the open loop: what Gymnasium asks, what the film decides, and what nothing
may leak.
"""

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.envs import OPEN_LOOP
from care_sim.envs.open_loop import FilmEnv
from care_sim.loops.film import Film
from tests.helpers.av2_log import at, box, write
from tests.helpers.episodes import played

NOTHING = np.zeros((32, 512), np.float32)


@pytest.fixture(params=OPEN_LOOP, scope="module")
def make(request, drive):
    """Makes an environment of the open loop; its streets are short."""
    if request.param == "CARE-Street-v0":
        request.getfixturevalue("short_streets")
    place = {"source": f"argoverse2:{drive}"} if request.param == "CARE-Replay-v0" else {}
    return lambda **arguments: gymnasium.make(
        request.param, disable_env_checker=True, **place, **arguments
    )


@pytest.fixture
def replay(drive):
    """Makes the environment of the hand-built drive."""

    def make(**arguments):
        return gymnasium.make(
            "CARE-Replay-v0", disable_env_checker=True, source=f"argoverse2:{drive}", **arguments
        )

    return make


def infos(env, policy, seed=0):
    """The infos and rewards of an episode."""
    _, *steps = played(env, policy, seed)
    return [info for *_, info in steps], [reward for _, reward, *_ in steps]


@pytest.mark.smoke
def test_an_episode_shows_every_keyframe_once_and_ends_with_the_recalls(make):
    env = make(budget=0.1)
    told, rewards = infos(env, "care")
    film = env.unwrapped.loop.film
    assert [info["time_s"] for info in told] == [shot.time_s for shot in film.shots]
    assert all(len(set(info["fired"].tolist())) == 1638 for info in told)
    outcome = told[-1]["outcome"]
    objects, found = (sum(info[name] for info in told) for name in ("objects", "found"))
    assert (outcome["object_frames"], outcome["overall_recall"]) == (objects, found / objects)
    assert rewards == [
        info["found"] / info["objects"] - 1 if info["objects"] else 0.0 for info in told
    ]
    tally = env.unwrapped.score.tally()
    assert outcome["first_sightings"] == tally.events > 0
    assert 0 < outcome["first_sighting_recall"] == tally.sighted / tally.events <= 1
    assert outcome["ttfd_keyframes"] == tally.delay / tally.events
    with pytest.raises(gymnasium.error.ResetNeeded, match="over"):
        env.step(NOTHING)


def test_the_person_at_the_house_is_the_one_event_and_the_camera_finds_it(replay):
    outcomes = {}
    for policy, budget in (("history", 0.05), ("care", 0.05), ("full", 1.0)):
        told, _ = infos(replay(budget=budget), policy)
        outcomes[policy] = told[-1]["outcome"]
    assert {outcome["first_sightings"] for outcome in outcomes.values()} == {1}
    assert [
        outcomes[policy]["first_sighting_recall"] for policy in ("history", "care", "full")
    ] == [
        0.0,
        1.0,
        1.0,
    ]
    assert outcomes["history"]["ttfd_keyframes"] > outcomes["care"]["ttfd_keyframes"] == 0


def test_who_waits_hidden_from_the_start_is_an_event_by_presence_visible_alone(tmp_path):
    """A person is annotated behind a van from the first sweep on, without a point until it walks
    out at the fifth.
    """
    van = box("BOX_TRUCK", (20.0, -4.0, 0.9), (6.0, 2.2, 2.6), track="van")
    waits = [box("PEDESTRIAN", (20.0, -7.0, 0.6), (0.6, 0.7, 1.8), track="p", points=0)] * 5
    walks = [box("PEDESTRIAN", (14.0, -3.0, 0.6), (0.6, 0.7, 1.8), track="p")] * 6
    log = write(tmp_path / "log", [[van, person] for person in (*waits, *walks)], [at()] * 11)
    outcomes = {}
    for presence in ("annotated", "visible"):
        env = gymnasium.make(
            "CARE-Replay-v0", source=f"argoverse2:{log}", presence=presence, budget=1.0
        )
        told, rewards = infos(env, "full")
        outcomes[presence] = told[-1]["outcome"]
        assert rewards == [0.0] * 3, "what is scored is the same"
    # Without an event there is no recall of events.
    assert list(outcomes["annotated"].values()) == [0, None, None, 5, 1.0]
    assert list(outcomes["visible"].values()) == [1, 1.0, 0.0, 5, 1.0]
    with pytest.raises(InvalidInput, match="presence must be 'annotated' or 'visible', got 'seen'"):
        gymnasium.make("CARE-Replay-v0", source=f"argoverse2:{log}", presence="seen")


def test_the_seed_draws_floor_and_faults_and_the_same_seed_the_same_episode(make):
    def fired(seed, **conditions):
        told, _ = infos(make(budget=0.02, **conditions), "random", seed)
        return [info["fired"].tolist() for info in told[:3]]

    assert fired(3) == fired(3)
    assert fired(3) != fired(4)
    assert fired(3, floor_seed=1) != fired(3)


def test_an_oracle_is_handed_where_tracked_objects_are_now(replay):
    env = replay(budget=1.0)
    observation, _ = env.reset(seed=0)
    for _ in range(2):
        observation, *_ = env.step(np.ones_like(NOTHING))
    belief = care_sim.Belief.from_observation(observation)
    shot = env.unwrapped.loop.shot
    truth = env.unwrapped.truth.boxes(belief.tracks)
    present = shot.annotations.boxes[:, :2]
    nearest = np.linalg.norm(truth[:, None, :2] - present, axis=-1).min(axis=1)
    assert len(truth) == len(present) == 3
    np.testing.assert_allclose(nearest, 0, atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ({"engine": "bullet"}, "engine is no argument of the open loop"),
        (
            {"camera_rotation_sigma_deg": 1.0},
            "camera_rotation_sigma_deg is no argument of the open loop",
        ),
        (
            {"scoring_inf": False},
            "unknown argument of .*Env 'scoring_inf', the nearest is scoring_info; known: ",
        ),
        ({"detector": "cluster", "min_returns": 5}, "min_returns is of the detector returns"),
        ({"render_mode": "ansi"}, "render_mode must be None or 'rgb_array'"),
    ],
)
def test_what_the_open_loop_does_not_take_is_named(make, arguments, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        make(**arguments)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ({"source": ""}, "source must be argoverse2:FOLDER, nuscenes:FOLDER, .*, got ''"),
        ({"source": "argoverse2:nowhere"}, "source argoverse2:nowhere: nowhere is no folder"),
        (
            {"source": "argoverse2:{drive}", "scene": "other"},
            "unknown log in .* 'other'; known: drive",
        ),
    ],
)
def test_recordings_that_are_not_there_are_named(drive, arguments, complaint):
    arguments = arguments | {"source": arguments["source"].format(drive=drive)}
    with pytest.raises(InvalidInput, match=complaint):
        gymnasium.make("CARE-Replay-v0", disable_env_checker=True, **arguments)


def test_a_film_without_cameras_is_refused_in_one_line():
    with pytest.raises(InvalidInput, match="cameras must be at least one, got none"):
        FilmEnv(Film("bare", (), 1.8, 0.5, ()))


@pytest.mark.parametrize("floor", [True, False])
def test_what_an_action_would_fire_is_what_it_fires_and_asking_changes_nothing(replay, floor):
    with replay(floor=floor) as env, replay(floor=floor) as unasked:
        env.reset(seed=3)
        unasked.reset(seed=3)
        rng = np.random.default_rng(0)
        for _ in range(3):
            asked, action = rng.random((2, 32, 512), np.float32) - np.float32(0.95)
            asked_cells = env.unwrapped.would_fire(asked)
            expected = env.unwrapped.would_fire(action)
            assert not np.array_equal(asked_cells, expected)
            fired = env.step(action)[-1]["fired"]
            assert np.array_equal(fired, expected)
            assert np.array_equal(unasked.step(action)[-1]["fired"], fired)
