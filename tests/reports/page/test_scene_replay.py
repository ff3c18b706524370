"""A page shows of a play of the open loop what happened in it."""

import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.evaluation.recall import CENSORED_AT
from care_sim.reports.page.episodes import Episode, episodes_to_watch, replay_episodes
from care_sim.reports.page.listing import episode_groups, replay_data
from care_sim.reports.page.played_rows import play_config_of
from care_sim.reports.page.replay import replayed
from care_sim.sources.named import source_of
from care_sim.study.play_config import play_grid
from care_sim.study.rows.reading import with_tags
from care_sim.study.scene_play import play_scene, trace_scene


@pytest.fixture(scope="module")
def logs(drive):
    return source_of(f"argoverse2:{drive.parent}")


@pytest.fixture(scope="module")
def plays(logs):
    return play_grid(logs, logs.scenes(), ["care", "history", "full"], [0.03, 0.1])


@pytest.fixture(scope="module")
def rows(plays):
    return with_tags(play_scene(plays))


@pytest.fixture(scope="module")
def replay(plays):
    return replayed(plays[0])


@pytest.fixture(scope="module")
def traced(plays):
    return trace_scene(plays[0], plays[0].film())


def named(replay, kind):
    return [body for body in replay.bodies if body["kind"] == kind]


def test_rows_are_played_again_as_they_were(rows, logs):
    assert play_config_of(rows[0], logs).digest() == rows[0]["digest"]
    again = replay_episodes(rows, 1, lambda _workers: ThreadPoolExecutor(1), logs)
    assert [episode.ending for episode in again if isinstance(episode.ending, str)] == []
    assert all(episode.identical for episode in again)
    otherwise = Episode(rows[0] | {"sighted": 40.0}, again[0].ending)
    assert otherwise.differences == [f"sighted 40.00 → {rows[0]['sighted']:.2f}"]


def test_who_is_found_is_who_the_scoring_found(replay, traced):
    states = replay.story["states"]
    assert [text.count("2") for text in states] == [k.objects_found for k in traced.keyframes]
    scored = [text.count("1") + text.count("2") for text in states]
    assert scored == [k.objects for k in traced.keyframes]
    entries = [(event["keyframe"], event["class"]) for event in traced.score.event_rows()]
    kinds = {body["n"]: body["kind"] for body in replay.bodies}
    assert [(first, kinds[n]) for n, first in replay.story["entries"]] == entries
    assert replay.story["censored"] == CENSORED_AT
    json.dumps([replay.story, replay.bodies], allow_nan=False)


def test_an_object_is_drawn_where_it_is_and_only_while_it_is_annotated(replay):
    (van,) = named(replay, "truck")
    # The van stands, 30 m ahead of the start and 4 m to the right.
    assert np.ptp([pose[:2] for pose in van["poses"]], axis=0) == pytest.approx([0, 0], abs=2)
    assert van["poses"][0][:2] == pytest.approx([3000, -400], abs=2)
    (person,) = named(replay, "pedestrian")
    there = [pose is not None for pose in person["poses"]]
    assert there == [state[person["n"]] != "." for state in replay.story["states"]]
    assert there == sorted(there)
    assert not there[0]
    assert there[-1]


def test_policies_of_a_scene_share_its_bodies(rows, logs):
    again = replay_episodes(rows, 1, lambda _workers: ThreadPoolExecutor(1), logs)
    data = replay_data(again)
    assert len(data["bodies"]) == 1
    assert {each["world"] for each in data["episodes"]} == {0}
    (group,) = episode_groups(rows, again)
    assert (group.worlds, group.watchable) == (["drive"], len(rows))
    first = next(iter(group.configurations.values()))[0]
    assert first.text == f"{int(rows[0]['sighted'])}/{int(rows[0]['events'])}"


def test_the_full_scan_is_watched_first_then_budget_by_budget_of_the_first_scene(rows):
    second = [row | {"scene": "later"} for row in rows]
    other_floor = [row | {"floor_seed": 1} for row in rows]
    chosen = episodes_to_watch([*other_floor, *rows, *second], len(rows) + 1)
    told = [(row["policy"], row["budget"]) for row in chosen]
    assert told[:3] == [("full", 1.0), ("care", 0.03), ("history", 0.03)]
    assert {row["scene"] for row in chosen[:-1]} == {"drive"}
    assert chosen[-1]["scene"] == "later"
    assert {row["floor_seed"] for row in chosen} == {0}


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({}, "their recordings are not at hand: --source argoverse2:FOLDER"),
        ({"scene": "gone"}, "argoverse2 holds no scene gone here"),
        ({"recording": "0"}, "the scene drive is another here: recording"),
    ],
)
def test_why_a_play_cannot_be_watched_is_said(changed, says, rows, logs):
    with pytest.raises(InvalidInput, match=says):
        play_config_of(rows[0] | changed, logs if changed else None)


def test_streets_are_found_by_the_name_of_the_scene():
    for split in ("evaluation", "calibration"):
        source = source_of("streets", split=split)
        (config,) = play_grid(source, source.scenes()[-1:], ["care"], [0.03], camera_latencies=[1])
        assert play_config_of(config.row(), None) == config


def test_what_returns_and_nobody_annotated_is_a_wall(short_streets):
    source = source_of("streets")
    (config,) = play_grid(source, source.scenes()[:1], ["history"], [0.03])
    film = config.film()
    walls = np.array(replayed(config).bodies[0]["squares"])
    assert len(walls) == len(np.unique(walls, axis=0)) > 50
    assert (walls % 50 == 0).all()
    # All of them lie within the reach of the LiDAR, and none in the lane of the car.
    way = np.array([[shot.sensor.x, shot.sensor.y] for shot in film.shots])
    apart = np.hypot(*(walls[:, None] / 100 + 0.25 - way).transpose(2, 0, 1)).min(axis=1)
    assert 2.0 < apart.min() < apart.max() <= film.grid.range_m + 0.5
