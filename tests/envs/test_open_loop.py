"""The environments of the open loop: what Gymnasium asks, what the film decides, and what nothing
may leak.
"""

import pickle
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.envs import OPEN_LOOP
from care_sim.envs.open_loop import FilmEnv
from care_sim.evaluation.recall import SceneScore
from care_sim.evaluation.sightings import Sightings
from care_sim.loops.film import Film
from care_sim.perception.matching import found_objects
from care_sim.sources import street_films
from care_sim.sources.street_films import street_film
from tests.helpers.av2_log import at, box, write

EXPLAINED = ("symmetric and normalized Box action space", "unconventional shape")
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


def played(env, policy, seed=0, **parameters):
    """The infos and rewards of an episode."""
    chooses = care_sim.make_policy(policy, env, **parameters)
    observation, _ = env.reset(seed=seed)
    chooses.reset()
    infos = []
    rewards = []
    over = False
    while not over:
        assert env.observation_space.contains(observation)
        observation, reward, terminated, over, info = env.step(chooses(observation))
        assert not terminated
        infos.append(info)
        rewards.append(reward)
    assert env.observation_space.contains(observation)
    return infos, rewards


def complaints(check, env):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check(env.unwrapped)
    messages = [str(warning.message) for warning in caught]
    return [message for message in messages if not any(known in message for known in EXPLAINED)]


@pytest.mark.slow
def test_gymnasium_finds_nothing_to_complain_about(make):
    assert complaints(check_env, make()) == []


def test_stable_baselines3_finds_nothing_to_complain_about(replay):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    assert complaints(checker.check_env, replay()) == []


def test_it_documents_itself_and_travels(make):
    env = make(budget=0.2)
    for heading in (
        env.spec.id,
        "### Action",
        "### Observation",
        "### Reward",
        "### Episode end",
        "### Arguments",
    ):
        assert heading in type(env.unwrapped).__doc__
    again = gymnasium.make(pickle.loads(pickle.dumps(env.spec)), disable_env_checker=True)
    assert again.unwrapped.rig.budget == env.unwrapped.rig.budget == 3277


@pytest.mark.smoke
def test_an_episode_shows_every_keyframe_once_and_ends_with_the_recalls(make):
    env = make(budget=0.1)
    infos, rewards = played(env, "care")
    film = env.unwrapped.loop.film
    assert [info["time_s"] for info in infos] == [shot.time_s for shot in film.shots]
    assert all(len(set(info["fired"].tolist())) == 1638 for info in infos)
    outcome = infos[-1]["outcome"]
    objects, found = (sum(info[name] for info in infos) for name in ("objects", "found"))
    assert (outcome["object_frames"], outcome["overall_recall"]) == (objects, found / objects)
    assert rewards == [
        info["found"] / info["objects"] - 1 if info["objects"] else 0.0 for info in infos
    ]
    tally = env.unwrapped.score.tally()
    assert outcome["first_sightings"] == tally.events > 0
    assert 0 < outcome["first_sighting_recall"] == tally.sighted / tally.events <= 1
    assert outcome["ttfd_keyframes"] == tally.delay / tally.events
    with pytest.raises(gymnasium.error.ResetNeeded, match="over"):
        env.step(NOTHING)


def test_the_score_is_that_of_what_the_detector_reported(make):
    env = make(budget=0.2)
    played(env, "history")
    film = env.unwrapped.loop.film
    keyframes = env.unwrapped.keyframes
    sightings = Sightings.of(
        film.name, [shot.annotations for shot in film.shots], hidden=film.hidden
    )
    pairs = zip(film.shots, keyframes, strict=True)
    found = [found_objects(shot.annotations, record.detections) for shot, record in pairs]
    again = SceneScore.of(sightings, found)
    assert again.tally() == env.unwrapped.score.tally()
    assert again.event_rows() == env.unwrapped.score.event_rows()


def test_the_person_at_the_house_is_the_one_event_and_the_camera_finds_it(replay):
    outcomes = {}
    for policy, budget in (("history", 0.05), ("care", 0.05), ("full", 1.0)):
        infos, _ = played(replay(budget=budget), policy)
        outcomes[policy] = infos[-1]["outcome"]
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
        infos, rewards = played(env, "full")
        outcomes[presence] = infos[-1]["outcome"]
        assert rewards == [0.0] * 3, "what is scored is the same"
    # Without an event there is no recall of events.
    assert list(outcomes["annotated"].values()) == [0, None, None, 5, 1.0]
    assert list(outcomes["visible"].values()) == [1, 1.0, 0.0, 5, 1.0]
    with pytest.raises(InvalidInput, match="presence must be 'annotated' or 'visible', got 'seen'"):
        gymnasium.make("CARE-Replay-v0", source=f"argoverse2:{log}", presence="seen")


def test_only_fired_cells_return(replay):
    env = replay(budget=0.02)
    env.reset(seed=0)
    full = env.unwrapped.film.shots[0].cloud
    observation, *_, info = env.step(NOTHING)
    silent = np.ones(observation["ranges"].size, bool)
    silent[info["fired"]] = False
    assert not observation["ranges"].ravel()[silent].any()
    returned = np.isin(info["fired"], full.cells)
    assert (observation["ranges"].ravel()[info["fired"][returned]] < 50).all()
    assert (observation["ranges"].ravel()[info["fired"][~returned]] == 50).all()


def test_the_seed_draws_floor_and_faults_and_the_same_seed_the_same_episode(make):
    def fired(seed, **conditions):
        infos, _ = played(make(budget=0.02, **conditions), "random", seed)
        return [info["fired"].tolist() for info in infos[:3]]

    assert fired(3) == fired(3)
    assert fired(3) != fired(4)
    assert fired(3, floor_seed=1) != fired(3)


def test_policies_meet_the_same_floor_and_misses(replay):
    seen = []
    floors = []
    for action in (NOTHING, np.eye(32, 512, dtype=np.float32)):
        env = replay(false_negative_rate=0.5)
        observation, _ = env.reset(seed=2)
        for _ in range(4):
            seen.append(observation["detections"])
            observation, *_, info = env.step(action)
            floors.append(set(info["fired"].tolist()) - set(np.flatnonzero(action).tolist()))
    np.testing.assert_array_equal(seen[:4], seen[4:])
    assert all(after < alone for alone, after in zip(floors[:4], floors[4:], strict=True))
    unimpaired, _ = replay().reset(seed=2)
    assert not np.array_equal(seen[0], unimpaired["detections"])


def test_a_camera_one_keyframe_old_shows_the_keyframe_before(replay):
    fresh, late = replay(), replay(camera_latency=1)
    before, _ = fresh.reset(seed=0)
    late.reset(seed=0)
    delayed, *_ = late.step(NOTHING)
    np.testing.assert_array_equal(delayed["detections"][:, :6], before["detections"][:, :6])
    assert set(delayed["detections"][delayed["detections"][:, 0] >= 0, 7]) == {0.5}


def test_a_street_is_drawn_by_the_seed_and_filmed_once(monkeypatch, short_streets):
    drawn = []
    filmed = []
    make_street = street_films.make_street
    record = street_films.record
    monkeypatch.setattr(
        street_films, "make_street", lambda seed: drawn.append(seed) or make_street(seed)
    )
    monkeypatch.setattr(
        street_films,
        "record",
        lambda street, *taken: filmed.append(street.name) or record(street, *taken),
    )
    street_films._street_film.cache_clear()
    for budget in (0.1, 0.2):
        env = gymnasium.make("CARE-Street-v0", disable_env_checker=True, budget=budget)
        _, info = env.reset(seed=7)
        assert (info["seed"], info["scene"]) == (7, env.unwrapped.loop.film.name)
    assert env.unwrapped.loop.film is street_film(7)
    assert (drawn, filmed) == ([7], [info["scene"]])


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
            {"duration_s": 3.0},
            "unknown argument of .*Env 'duration_s'; known: .*budget, .*scoring_info, secret",
        ),
        (
            {"scoring_inf": False},
            "unknown argument of .*Env 'scoring_inf', the nearest is scoring_info; known: ",
        ),
        ({"secret": ""}, "secret must not be empty"),
        ({"detector": "yolo"}, "unknown detector 'yolo'"),
        ({"detector_parameters": {"size": 3}}, "unknown parameter of detector returns 'size'"),
        ({"detector": "cluster", "min_returns": 5}, "min_returns is of the detector returns"),
        ({"render_mode": "ansi"}, "render_mode must be None or 'rgb_array'"),
        ({"budget": 0.0}, "budget"),
    ],
)
def test_what_the_open_loop_does_not_take_is_named(make, arguments, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        make(**arguments)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (
            {"source": ""},
            "source must be argoverse2:FOLDER, nuscenes:FOLDER, kitti:FOLDER, sweeps:FOLDER, "
            "boreas, or one of your own, MODULE:CLASS, got ''",
        ),
        (
            {"source": "waymo:."},
            "source must be argoverse2:FOLDER, nuscenes:FOLDER, kitti:FOLDER, sweeps:FOLDER, "
            "boreas, or one of your own, MODULE:CLASS, got 'waymo:.'",
        ),
        ({"source": "argoverse2:nowhere"}, "source argoverse2:nowhere: nowhere is no folder"),
        (
            {"source": "argoverse2:{drive}", "scene": "other"},
            "unknown log in .* 'other'; known: drive",
        ),
        (
            {"source": "argoverse2:{drive}", "split": "val"},
            "unknown split in .*drive 'val'; known: none",
        ),
        (
            {"source": "argoverse2:{drive}", "version": "v1.0-mini"},
            "version has no meaning for argoverse2 recordings",
        ),
    ],
)
def test_recordings_that_are_not_there_are_named(drive, arguments, complaint):
    arguments = arguments | {"source": arguments["source"].format(drive=drive)}
    with pytest.raises(InvalidInput, match=complaint):
        gymnasium.make("CARE-Replay-v0", disable_env_checker=True, **arguments)


def test_a_misspelt_argument_of_a_recording_is_told_the_nearest():
    with pytest.raises(
        InvalidInput, match=r"of ReplayEnv 'sorce', the nearest is source; known: .* scene, "
    ):
        gymnasium.make("CARE-Replay-v0", disable_env_checker=True, sorce="argoverse2:.")


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


def test_the_floor_that_is_asked_for_is_another_at_every_keyframe(replay):
    with replay() as env:
        env.reset(seed=0)
        first = env.unwrapped.would_fire(NOTHING)
        assert np.array_equal(env.unwrapped.would_fire(NOTHING), first)
        assert np.array_equal(env.step(NOTHING)[-1]["fired"], first)
        assert not np.array_equal(env.unwrapped.would_fire(NOTHING), first)


def test_what_is_no_action_would_fire_nothing(replay):
    with replay() as env:
        env.reset(seed=0)
        with pytest.raises(InvalidInput, match="action"):
            env.unwrapped.would_fire(np.zeros((2, 2), np.float32))
