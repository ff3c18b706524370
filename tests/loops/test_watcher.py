"""Reports of a watcher on an episode whose camera errs, and on a film."""

from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.core.firing.actions import EXPLOITATION, FLOOR, RESERVE
from care_sim.core.sensor_setup import LIDAR_POSITION
from care_sim.envs.wrappers.record_rerun import Watching
from care_sim.loops.watcher import WAY_M, Watcher
from care_sim.sources.named import source_of
from care_sim.study.play_config import play_grid


class Notes(Watching):
    """Keeps the moments, and how many bodies the camera showed at each."""

    def begin(self, loop, episode):
        self.moments, self.shown = [], []

    def look(self, loop):
        labelled = [actor.body for actor in loop.world.actors if actor.label is not None]
        self.shown.append(sum(map(loop.shows, labelled)))

    def keep(self, watched):
        self.moments.append(watched)

    def end(self, outcome):
        self.outcome = outcome


def watch(name="CARE-Dense-v0", seed=0, keyframes=30, **conditions):
    env = gymnasium.make(name, budget=0.05, **conditions)
    policy = care_sim.make_policy("care", env)
    with Notes(env, policy) as notes:
        observation, _ = notes.reset(seed=seed)
        for _ in range(keyframes):
            observation, *_ = notes.step(policy(observation))
    return notes


def counts(notes):
    """Counts per keyframe: detections that arrived, false ones among them, missed ones."""
    situations = [watched.situation for watched in notes.moments]
    return [
        SimpleNamespace(given=len(s.belief.detections), false=s.false.sum(), missed=len(s.missed))
        for s in situations
    ]


def test_a_camera_without_faults_misses_nothing_and_invents_nothing():
    notes = watch()
    assert [(c.given, c.false, c.missed) for c in counts(notes)] == [
        (shown, 0, 0) for shown in notes.shown
    ]
    assert sum(notes.shown) > 60


@pytest.mark.parametrize(
    "fault",
    [
        {"false_negative_rate": 0.4},
        {"false_negative_rate": 0.4, "camera_rotation_sigma_deg": 1.0},
    ],
    ids=["misses", "misses of a crooked camera"],
)
def test_what_is_missed_and_what_is_given_are_all_there_is_to_see(fault):
    notes = watch(**fault)
    found = counts(notes)
    assert all(c.false == 0 for c in found)
    if "camera_rotation_sigma_deg" not in fault:  # which may move an object out of its picture
        assert [c.given + c.missed for c in found] == notes.shown
    assert sum(c.missed for c in found) > 20


def test_ghosts_are_false_and_hide_nothing():
    notes = watch(false_positive_rate=1.0)
    found = counts(notes)
    assert [c.given - c.false for c in found] == notes.shown
    assert sum(c.false for c in found) > 10
    assert all(c.missed == 0 for c in found)


def test_a_moment_holds_the_truth_of_its_keyframe():
    notes = watch("CARE-Dartout-v0", seed=3)
    for watched in notes.moments:
        situation, frame = watched.situation, watched.record
        assert situation.time_s == frame.time_s
        assert situation.names[situation.target] == "person"
        x, y = situation.bodies[situation.target, :2]
        assert np.hypot(x - situation.sensor.x, y - situation.sensor.y) == pytest.approx(
            frame.distance_m
        )
        np.testing.assert_array_equal(np.flatnonzero(watched.shares), frame.fired)
        np.testing.assert_array_equal(np.flatnonzero(watched.ranges), frame.fired)
    first, last = notes.moments[0].situation, notes.moments[-1].situation
    travelled = sum(watched.record.speed_mps * 0.1 for watched in notes.moments[:-1])
    assert last.ego[0] - first.ego[0] == pytest.approx(travelled, abs=0.5)
    assert notes.outcome is None


def ways(name, seed):
    """The way at the start, in the sensor frame."""
    with gymnasium.make(name, disable_env_checker=True) as env:
        env.reset(seed=seed)
        situation = Watcher(env.unwrapped.loop, 0.0).situation()
        boxes = np.zeros((len(situation.way), 7))
        boxes[:, [0, 1, 6]] = situation.way
        return situation.sensor.boxes_to_local(boxes)


def test_the_way_straight_ahead_is_one_piece():
    ((x, y, *_, yaw),) = ways("CARE-Dartout-v0", 0)
    assert (x, y, yaw) == pytest.approx((WAY_M / 2, 0.0, 0.0))


def test_the_way_follows_the_turn_of_the_route():
    # The car of this drive turns left after 33.67 m, with a radius of 10 m.
    way = ways("CARE-Drive-v0", 122)
    steps = np.hypot(*np.diff(way[:, :2], axis=0).T)
    assert steps == pytest.approx(np.full(len(way) - 1, WAY_M / len(way)), abs=0.01)
    assert way[-1, 0] > 35
    assert way[-1, 6] == pytest.approx((LIDAR_POSITION[0] + WAY_M - 0.5 - 33.671) / 10.0, abs=1e-3)
    assert way[-1, 1] > 0.5


def test_what_is_watched_is_how_the_film_stands(drive):
    source = source_of(f"argoverse2:{drive}")
    faults = {"false_negative_rate": 0.3, "false_positive_rate": 0.5}
    (config,) = play_grid(source, source.scenes(), ["care"], [0.05], **faults)
    film = config.film()
    with config.make_env(film) as env:
        policy = config.make_policy(env)
        observation, _ = env.reset(seed=0)
        policy.reset()
        watcher = Watcher(env.loop, env.conditions.camera_confidence)
        for shot in film.shots:
            situation = watcher.situation()
            local = shot.sensor.boxes_to_local(situation.bodies)
            assert local == pytest.approx(shot.annotations.boxes, abs=1e-6)
            # The LiDAR stands where the film says on the car.
            ego = shot.sensor.boxes_to_local(situation.ego[None])[0]
            assert ego[:2] == pytest.approx([-film.place[0], -film.place[1]], abs=1e-6)
            assert ego[2] - ego[5] / 2 == pytest.approx(-film.sensor_height_m)
            # Each object that the camera showed is either in the belief or missed.
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
