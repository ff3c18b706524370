"""A recording of a play of the open loop, held against the play itself."""

import numpy as np
import pytest

from care_sim.core.actions import EXPLOITATION, FLOOR, RESERVE
from care_sim.envs.wrappers.record_rerun import RecordRerun
from care_sim.loops.film_watcher import FilmWatcher
from care_sim.sources.named import source_of
from care_sim.study.play_config import play_grid
from care_sim.study.scene_trace import trace_scene
from care_sim.viewer.recording import entities


@pytest.fixture(scope="module")
def play(drive):
    """Configuration, film and what was played without a recording."""
    source = source_of(f"argoverse2:{drive}")
    faults = {"false_negative_rate": 0.3, "false_positive_rate": 0.5}
    (config,) = play_grid(source, source.scenes(), ["care"], [0.05], **faults)
    film = config.film()
    return config, film, trace_scene(config, film)


@pytest.fixture(scope="module")
def recorded(play, tmp_path_factory, read):
    """What was played under a recording, and what was recorded."""
    config, film, _ = play
    path = tmp_path_factory.mktemp("recordings") / "out.rrd"
    played = trace_scene(config, film, wrap=lambda env, policy: RecordRerun(env, path, policy))
    return played, read(path)


def test_recording_changes_nothing(play, recorded):
    assert recorded[0].row["episode_hash"] == play[2].row["episode_hash"]


def test_every_entity_is_documented_and_every_documented_one_is_there(recorded):
    found = recorded[1]
    names = {name.removeprefix("care/") for name in {*found.rows, *found.fixed} if "/" in name}
    assert {name for name in names if not name.startswith("__")} == set(entities.SCENE_ENTITIES)
    (about,) = found.fixed["about"]["TextDocument:text"]
    assert all(f"`{name}` | {told}" in about for name, told in entities.SCENE_ENTITIES.items())


def test_measures_and_events_are_those_of_the_keyframes(recorded):
    played, found = recorded
    assert found.numbers("care/measures/found") == [f.objects_found for f in played.keyframes]
    assert found.numbers("care/measures/objects") == [f.objects for f in played.keyframes]
    parts = np.sum([found.numbers(f"care/budget/{share}") for share in _SHARES], axis=0)
    assert parts == pytest.approx([100.0] * len(played.keyframes))
    (event,) = [text for row in found.rows["care/events"].values() for text in row["TextLog:text"]]
    assert event.startswith("pedestrian ")
    (text,) = found.fixed["care/outcome"]["TextDocument:text"]
    assert f"| overall_recall | {played.row['overall_recall']} |" in text


_SHARES = ("exploitation", "reserve", "floor")


def test_what_is_watched_is_how_the_film_stands(play):
    config, film, _ = play
    with config.make_env(film) as env:
        policy = config.make_policy(env)
        observation, _ = env.reset(seed=0)
        policy.reset()
        watcher = FilmWatcher(env.loop, env.conditions.camera_confidence)
        for shot in film.shots:
            situation = watcher.situation()
            local = shot.sensor.boxes_to_local(situation.bodies)
            assert local == pytest.approx(shot.annotations.boxes, abs=1e-6)
            # The LiDAR stands where the film says on the car.
            ego = shot.sensor.boxes_to_local(situation.ego[None])[0]
            assert ego[:2] == pytest.approx([-film.place[0], -film.place[1]], abs=1e-6)
            assert ego[2] - ego[5] / 2 == pytest.approx(-film.sensor_height_m)
            # Of what the camera showed, each object is either in the belief or missed.
            behind = env.loop.true_detected_objects()
            assert (situation.false == (behind < 0)).all()
            given = int((behind >= 0).sum())
            assert len(situation.missed) + given == len(shot.seen.detections)
            observation, *_ = env.step(policy(observation))
            watched = watcher.watched(situation, env.acted, policy.demanded, env.last)
            assert (watched.shares.ravel()[env.last.fired] > 0).all()
            cells, points = watched.returned(film.grid)
            assert {*cells.tolist()} <= {*env.last.fired.tolist()}
            assert np.isin(cells, shot.cloud.cells).all()
            assert len(points) == len(cells)
    shares = {*np.unique(watched.shares).tolist()}
    assert shares <= {0, EXPLOITATION, RESERVE, FLOOR}
