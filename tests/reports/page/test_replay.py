"""A page shows of an episode what happened in it."""

import json
import signal

import numpy as np
import pytest

from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.reports.page.episodes import Episode, episodes_to_watch, replay_episodes
from care_sim.reports.page.played_rows import config_of
from care_sim.reports.page.replay import replayed
from care_sim.reports.page.story import SECTORS, fullness, sightlines
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import run_episode, trace
from care_sim.study.executors import processes

CONFIG = EpisodeConfig("dartout", "care", 0.1, seed=3)


@pytest.fixture(scope="module")
def replay():
    return replayed(CONFIG)


@pytest.fixture(scope="module")
def played():
    return trace(CONFIG)


def test_the_replay_is_the_episode(replay, played):
    row, keyframes = played
    assert replay.row["episode_hash"] == row["episode_hash"]
    assert replay.story["found"] == "".join(str(int(frame.detected)) for frame in keyframes)
    assert (
        replay.story["in_view"].index("1")
        <= replay.story["found"].index("1")
        < replay.story["brake"].index("1")
    )
    assert replay.story["distance"] == [round(100 * frame.distance_m) for frame in keyframes]
    assert replay.story["contact"] is None


@pytest.mark.parametrize("scenario", ["dense", "drive", "r157"])
def test_an_episode_of_every_world_is_played_again_as_it_was(scenario):
    config = EpisodeConfig(
        scenario, "care", 0.03, 2, camera_latency=1, scenario_parameters=(("duration_s", 1.0),)
    )
    row = run_episode(config)
    assert config_of(row) == config
    watched = replayed(config)
    assert Episode(row, watched).identical
    assert len(watched.story["rays"]) == 10
    json.dumps([watched.story, watched.bodies], allow_nan=False)


def test_there_is_a_moment_before_every_keyframe_and_one_after_the_last(replay, played):
    _, keyframes = played
    assert replay.story["time"] == [10 * n for n in range(len(keyframes) + 1)]
    assert replay.story["speed"][:-1] == [round(100 * frame.speed_mps) for frame in keyframes]
    assert {len(replay.story[name]) for name in ("place", "tracks", "camera", "seen")} == {
        len(keyframes) + 1
    }
    assert len(replay.story["rays"]) == len(keyframes)


def test_what_stands_has_one_pose_and_what_moves_has_many(replay):
    (person,) = (body for body in replay.story["moving"] if body["sought"])
    assert (person["kind"], person["reported"]) == ("pedestrian", True)
    assert len(person["poses"]) == len(replay.story["time"])
    (trailer,) = (body for body in replay.bodies if body["kind"] == "trailer")
    assert trailer["size"] == [1201, 255]
    assert not trailer["reported"]
    assert len(trailer["pose"]) == 3


def test_distances_are_those_of_the_drawn_places(replay):
    (person,) = (body for body in replay.story["moving"] if body["sought"])
    for k, distance in enumerate(replay.story["distance"]):
        x, y, yaw = replay.story["place"][k]
        ahead, _ = replay.story["ego"]["sensor"]
        sensor = x + ahead * np.cos(yaw / 1000), y + ahead * np.sin(yaw / 1000)
        assert np.hypot(
            person["poses"][k][0] - sensor[0], person["poses"][k][1] - sensor[1]
        ) == pytest.approx(distance, abs=2)


def test_a_drive_tells_whom_it_lets_the_car_meet_its_way_and_whom_it_hit():
    config = EpisodeConfig("drive", "care", 0.01, seed=105)
    row, keyframes = trace(config)
    story = replayed(config).story
    assert len(story["sought"]) == len(keyframes[0].sights) == 3
    for number, (_, states) in enumerate(story["sought"]):
        sights = [frame.sights[number] for frame in keyframes]
        assert states == "".join(
            "2" if sight.detected else "1" if sight.in_view else "0" for sight in sights
        )
    # The way goes on as far as the LiDAR reaches, also where the drive ends early.
    (x, y), (end_x, end_y) = story["place"][-1][:2], story["way"][-1]
    assert 4800 <= np.hypot(end_x - x, end_y - y) <= 5000
    assert row["collision"]
    speed = round(100 * row["impact_speed_mps"])
    assert story["hit"] == {"kind": "bicycle", "at_front": True, "speed": speed}
    assert story["about"] == "bicycle"


def test_a_track_lies_where_the_person_is_and_moves_as_the_person_does(replay):
    (person,) = (body for body in replay.story["moving"] if body["sought"])
    k = replay.story["found"].index("1") + 3
    ((track, x, y, _, vx, vy, coasting),) = replay.story["tracks"][k]
    assert (x, y) == pytest.approx(person["poses"][k][:2], abs=3)
    walked = np.subtract(person["poses"][k + 1][:2], person["poses"][k][:2])
    assert (vx / 10, vy / 10) == pytest.approx(walked, abs=3)
    assert coasting == 0
    assert replay.story["tracked"][track][0] == "pedestrian"


def test_the_camera_sees_the_person_where_the_person_is(replay):
    (person,) = (body for body in replay.story["moving"] if body["sought"])
    k = replay.story["in_view"].index("1")
    assert replay.story["seen"][k][person["n"]] == "1"
    assert replay.story["seen"][0][person["n"]] == "0"
    ((left, right, explained),) = replay.story["camera"][k]
    x, y, _ = replay.story["place"][k]
    azimuth = 1000 * np.arctan2(
        person["poses"][k][1] - y, person["poses"][k][0] - x - replay.story["ego"]["sensor"][0]
    )
    assert right < azimuth + 15
    assert azimuth - 15 < left
    assert left - right < 60
    assert explained == 0


def test_fullness_counts_the_cells_of_a_sector_in_all_rows():
    grid = AngularGrid()
    width = grid.columns // SECTORS
    third = [
        row * grid.columns + 2 * width + column
        for row in range(grid.rows)
        for column in range(width)
    ]
    assert fullness(np.array(third), grid) == "00z" + "0" * (SECTORS - 3)
    assert fullness(np.arange(grid.size), grid) == "z" * SECTORS
    assert fullness(np.repeat(np.arange(grid.size), 4), grid) == "z" * SECTORS
    assert fullness(np.array(third[: len(third) // 7]), grid)[2] == "5"


def test_a_box_in_the_middle_of_the_picture_is_straight_ahead(seen):
    from care_sim.sensors.pictures import FRONT_CAMERA

    detections = seen(
        ("car", 160.0, 80.0, 320.0, 100.0), ("car", 0.0, 80.0, 160.0, 100.0), yaw_change=0.1
    )
    lines = sightlines(detections, np.array([True, False]), Rig(cameras=(FRONT_CAMERA,)))
    assert lines == [[-100, -885, 1], [685, -100, 0]]


@pytest.mark.parametrize(
    "config",
    [
        CONFIG,
        EpisodeConfig(
            "dense",
            "care-sbf",
            0.05,
            1,
            scenario_parameters=(("vehicles", 9),),
            policy_parameters=(("k_safe", 0.5),),
            lidar_dead_rows=(10, 11),
        ),
        EpisodeConfig("dense", "care", driver="careful-human", comfort_mps2=2.0, firing="tiles"),
        EpisodeConfig("dense", "care", detector="graded"),
    ],
)
def test_a_row_gives_its_configuration_back(config):
    other = EpisodeConfig("dense", "care").row()
    assert (
        config_of({**dict.fromkeys(["policy.rate", "scenario.gap_m"]), **other, **config.row()})
        == config
    )


def test_seeds_are_watched_one_after_the_other():
    rows = [{"policy": policy, "seed": seed} for policy in ("history", "care") for seed in (0, 1)]
    assert [(row["policy"], row["seed"]) for row in episodes_to_watch(rows, 3)] == [
        ("history", 0),
        ("care", 0),
        ("history", 1),
    ]
    assert episodes_to_watch(rows, 0) == []


def test_an_episode_that_ends_otherwise_is_told_from_one_that_does_not(replay):
    same = Episode(replay.row, replay)
    assert same.identical
    assert same.differences == []
    wobbling = Episode(
        replay.row | {"episode_hash": "0", "clearance_m": replay.row["clearance_m"] + 1e-9}, replay
    )
    assert not wobbling.identical
    assert wobbling.differences == []
    other = Episode(replay.row | {"detection_distance_m": None, "braked": False}, replay)
    distance = replay.row["detection_distance_m"]
    assert other.differences == [
        f"detection_distance_m none → {distance:.2f}",
        "braked False → True",
    ]
    assert Episode(replay.row, "gone").differences == []
    assert not Episode({}, "gone").identical


@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_does_not_wait_for_episodes_that_have_not_begun():
    rows, handed = [CONFIG.row() | {"scenario.duration_s": 0.2}] * 20, []

    def interrupted(workers):
        executor = processes(workers)
        submit = executor.submit

        def submit_and_interrupt(*arguments):
            handed.append(submit(*arguments))
            if len(handed) == len(rows):
                signal.raise_signal(signal.SIGINT)
            return handed[-1]

        executor.submit = submit_and_interrupt
        return executor

    with pytest.raises(KeyboardInterrupt):
        replay_episodes(rows, 1, interrupted)
    assert all(future.done() for future in handed)
    assert sum(future.cancelled() for future in handed) >= 15


def test_what_cannot_be_played_says_why():
    row = CONFIG.row() | {"scenario.duration_s": 0.2}
    good, unknown = replay_episodes([row, row | {"policy": "forgotten"}], workers=1)
    assert good.replay is not None
    assert good.replay.row["keyframes"] == 2
    assert unknown.replay is None
    assert "unknown policy 'forgotten'" in unknown.ending
