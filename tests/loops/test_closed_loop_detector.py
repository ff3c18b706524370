"""A detector that sees points alone in the closed loop: what it is handed, and what it finds."""

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim import InvalidInput
from care_sim.core.sensor_setup import LIDAR_POSITION
from care_sim.perception import detectors
from care_sim.perception.matching import MATCH_M


def play(name="CARE-Dartout-v0", seed=0, policy="full", keyframes=60, **arguments):
    budget = 1.0 if policy == "full" else 0.1
    with gymnasium.make(name, budget=budget, **arguments) as env:
        chosen = care_sim.make_policy(policy, env)
        observation, _ = env.reset(seed=seed)
        infos = []
        ended = False
        while not ended and len(infos) < keyframes:
            observation, _, terminated, truncated, info = env.step(chosen(observation))
            infos.append(info)
            ended = terminated or truncated
        return infos, observation


def test_a_clustering_detector_finds_the_person_and_the_car_brakes():
    infos, _ = play(detector="cluster")
    outcome = infos[-1]["outcome"]
    assert outcome["detection_distance_m"] is not None
    assert outcome["braked"]
    # Two returns of the person and one of the lorry beside make a group, so it may be earlier than
    # the proxy, by no more than a box may be off.
    (*_, proxy), _ = play()
    gap = outcome["detection_distance_m"] - proxy["outcome"]["detection_distance_m"]
    assert abs(gap) <= MATCH_M


def test_a_box_beside_somebody_hidden_has_not_found_them(monkeypatch):
    class Guesser:
        """Says where the person waits, whatever the points say."""

        def detect(self, points, sensor_height_m):
            person = loop().world.first_sighting
            box = loop().sensor.boxes_to_local(loop().world.boxes([person]))
            return care_sim.Detections(np.array([4]), box, np.array([0]), None)

    monkeypatch.setitem(detectors.DETECTORS.built_in, "guesser", Guesser)
    env = gymnasium.make("CARE-Dartout-v0", budget=0.01, detector="guesser")
    loop = lambda: env.unwrapped.loop  # noqa: E731
    env.reset(seed=0)
    nothing = np.zeros(env.action_space.shape, np.float32)
    assert not env.step(nothing)[4]["detected"]
    env.close()


class Recorder:
    """Finds nothing, and keeps the points that it was handed."""

    handed: list[np.ndarray]

    def __init__(self):
        type(self).handed = []

    def detect(self, points, sensor_height_m):
        assert sensor_height_m == LIDAR_POSITION[2]
        self.handed.append(points.copy())
        return care_sim.Detections(
            np.zeros(0, np.int64), np.zeros((0, 7)), np.zeros(0, np.int64), None
        )


@pytest.fixture
def recorder(monkeypatch):
    monkeypatch.setitem(detectors.DETECTORS.built_in, "recorder", Recorder)
    return Recorder


def test_it_is_handed_the_returns_of_the_fired_cells_and_nothing_else(recorder):
    infos, observation = play(policy="care", detector="recorder", keyframes=5)
    ranges = observation["ranges"].ravel()
    returned = (ranges > 0) & (ranges < 50.0)
    assert returned[infos[-1]["fired"]].sum() == returned.sum() == len(recorder.handed[-1])
    assert np.linalg.norm(recorder.handed[-1], axis=1) == pytest.approx(ranges[returned], rel=1e-6)


def test_a_detector_that_finds_nothing_leaves_no_track_and_no_brake(recorder):
    infos, observation = play(detector="recorder")
    assert not infos[-1]["outcome"]["braked"]
    assert infos[-1]["outcome"]["detection_distance_m"] is None
    assert (observation["tracks"][:, 0] == -1).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"detector": "radar"}, "radar"),
        ({"detector": "cluster", "min_returns": 5}, "min_returns is of the detector returns"),
        ({"detector_parameters": 3}, "detector_parameters must map"),
        ({"detector_parameters": {"min_returns": 40}}, "min_returns is a condition"),
        ({"detector": "cluster", "detector_parameters": {"reach": 1}}, "reach"),
    ],
)
def test_bad_arguments_are_named(arguments, message):
    with pytest.raises(InvalidInput, match=message):
        gymnasium.make("CARE-Dartout-v0", **arguments)


def test_a_box_is_of_whom_it_has_returns_though_somebody_hidden_is_nearer(monkeypatch):
    class Between:
        """One box of a person between one who is seen and one who is hidden."""

        def detect(self, points, sensor_height_m):
            seen, hidden = boxes()
            box = seen.copy()
            box[:2] += 0.6 * (hidden[:2] - seen[:2])
            box[3:5] = 3.0
            return care_sim.Detections(np.array([4]), box[None], np.array([1]), None)

    monkeypatch.setitem(detectors.DETECTORS.built_in, "between", Between)
    env = gymnasium.make("CARE-Dartout-v0", budget=1.0, detector="between")
    build = env.unwrapped.scenario.build

    def with_two(rng):
        world = build(rng)
        world.add("hidden", "pedestrian", (10.0, 0.0, 0.0))
        world.first_sighting = world.add("seen", "pedestrian", (9.0, 0.0, 0.0))
        return world

    object.__setattr__(env.unwrapped.scenario, "build", with_two)

    def boxes():
        loop = env.unwrapped.loop
        hidden, seen = loop.world.actors[-2:]
        return loop.sensor.boxes_to_local(loop.world.boxes([seen, hidden]))

    env.reset(seed=0)
    assert env.step(np.ones(env.action_space.shape, np.float32))[4]["detected"]
    env.close()
