"""Points of several sweeps that a detector is given, in a film and in the closed loop, and reports
that become tracks.
"""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import Sensing
from care_sim.core.frames import Frame
from care_sim.core.rig import Rig
from care_sim.core.types import Detections
from care_sim.loops.episode import SensorSeeds
from care_sim.loops.film import Sweep
from care_sim.loops.gathering import Gathering
from care_sim.loops.open_loop import OpenLoop
from care_sim.perception import detectors
from care_sim.perception.points_only import BrokenDetector, PointsOnly
from care_sim.sensors.annotated import NO_OBJECT, Cloud
from care_sim.sensors.surround import SURROUND_CAMERAS
from tests.helpers.handmade_film import AHEAD, GRID, OBJECTS, handmade_film

HEIGHT = 1.84


class Listens:
    """Keeps what it was handed, and reports what it was told to."""

    def __init__(self, found=None, **told):
        self.found = found or Detections([], [], [])
        vars(self).update(told)
        self.given = []

    def detect(self, points, sensor_height_m, poses=None):
        self.given.append(points)
        self.poses = poses
        return self.found


def cloud(x, y=0.0):
    """A return of one cell, on nobody."""
    point = np.array([[x, y, -1.0]])
    return Cloud(GRID.cells_of(point), point, np.array([NO_OBJECT]))


def swept_film():
    """The handmade film, whose second keyframe has a sweep before it, from 2 m behind: it returned
    from the cell ahead and from the one behind.
    """
    film = handmade_film()
    points = np.array([[22.0, 0.0, -1.0], [-18.0, 0.0, -1.0]])
    cells = GRID.cells_of(points)
    order = np.argsort(cells)
    sweep = Sweep(
        0.4, Frame(-2.0, 0.0, HEIGHT, 0.0), Cloud(cells[order], points[order], np.full(2, -1))
    )
    first, second, *rest = film.shots
    return replace(film, shots=(first, replace(second, sweeps=(sweep,)), *rest))


def loop_of(film, detector, **sensing):
    seeds = SensorSeeds(*map(np.random.SeedSequence, range(4)))
    rig = Rig(cameras=SURROUND_CAMERAS, keyframe_s=0.5)
    return OpenLoop(film, rig, Sensing(**sensing), seeds, PointsOnly("mine", detector, HEIGHT))


@pytest.mark.parametrize(("sweep_mask", "places"), [("before", [-20.0]), ("coming", [20.0])])
def test_a_sweep_fires_the_mask_before_or_the_coming_one(sweep_mask, places):
    detector = Listens(fields=("x", "time_lag"), wants_poses=True)
    loop = loop_of(swept_film(), detector, sweep_mask=sweep_mask)
    ahead, behind = GRID.cells_of(np.array([[22.0, 0.0, -1.0], [-18.0, 0.0, -1.0]]))
    loop.keyframe(np.array([behind]))
    loop.keyframe(np.array([ahead]))
    earlier = detector.given[-1][detector.given[-1][:, 1] > 0]
    # 0.1 s before the keyframe, seen from where the car stands at the keyframe, 2 m further on.
    assert earlier[:, 0] == pytest.approx(places)
    assert earlier[:, 1] == pytest.approx([0.1])
    (_, now), (lag_s, moved) = detector.poses
    assert np.array_equal(now, np.eye(4))
    assert lag_s == pytest.approx(0.1)
    assert moved @ [22.0, 0.0, -1.0, 1.0] == pytest.approx([20.0, 0.0, -1.0, 1.0])


def test_the_closed_loop_gathers_as_many_sweeps_as_are_asked_for():
    gathering = Gathering(3, 0.1)
    frames = [Frame(float(n), 0.0, HEIGHT, 0.0) for n in range(4)]
    for n, frame in enumerate(frames):
        seen = gathering.add(cloud(10.0 - n), frame)
    # A point that stands at 10 m in the world is 7 m ahead in each of the last three.
    assert seen.points[:, 0] == pytest.approx([7.0, 7.0, 7.0])
    assert sorted(seen.times) == pytest.approx([-0.2, -0.1, 0.0])
    assert [pose.lag_s for pose in seen.poses] == pytest.approx([0.0, 0.1, 0.2])


def test_a_turn_of_the_car_is_undone():
    gathering = Gathering(2, 0.1)
    gathering.add(cloud(10.0), Frame(0.0, 0.0, HEIGHT, 0.0))
    seen = gathering.add(cloud(0.1, -10.0), Frame(0.0, 0.0, HEIGHT, np.pi / 2))
    earlier = seen.points[seen.times < 0]
    assert earlier == pytest.approx(np.array([[0.0, -10.0, -1.0]]), abs=1e-9)
    moved = seen.poses[1].matrix @ [10.0, 0.0, -1.0, 1.0]
    assert moved == pytest.approx([0.0, -10.0, -1.0, 1.0], abs=1e-9)


def test_an_environment_feeds_its_detector_several_sweeps(monkeypatch):
    listens = Listens(fields=("x", "y", "z", "ring", "time_lag"))
    monkeypatch.setitem(detectors.DETECTORS.built_in, "listens", lambda: listens)
    with gymnasium.make(
        "CARE-Dartout-v0", budget=0.1, detector="listens", detector_parameters={"sweeps": 3}
    ) as env:
        policy = care_sim.make_policy("care", env)
        observation, _ = env.reset(seed=0)
        for _ in range(4):
            observation, *_ = env.step(policy(observation))
    lags = [sorted({*np.round(points[:, 4], 6).tolist()}) for points in listens.given]
    assert lags == [[0.0], [0.0, 0.1], [0.0, 0.1, 0.2], [0.0, 0.1, 0.2]]
    # Rings count from the lowest row: those that point down come first.
    points = listens.given[0]
    assert set(points[:, 3]) <= {*range(32)}
    assert points[points[:, 3].argmin(), 2] < points[points[:, 3].argmax(), 2]


def reported():
    """The car ahead, surely, and another one beside it, perhaps."""
    box = OBJECTS[AHEAD][1]
    boxes = np.stack([box, box])
    boxes[1, 1] += 8.0
    return Detections(
        np.zeros(2, np.int64), boxes, np.zeros(2, np.int64), np.array([0.9, 0.2]), np.ones((2, 2))
    )


@pytest.mark.parametrize(("least", "tracks"), [(0.0, 2), (0.5, 1)])
def test_what_is_unsure_is_reported_and_becomes_no_track(least, tracks):
    loop = loop_of(handmade_film(), Listens(reported(), track_score=least))
    seen = loop.keyframe(np.array([], np.int64))
    assert len(seen.reported) == 2
    assert len(seen.detections) == len(loop.belief.tracks) == tracks
    assert seen.velocities.tolist() == [[1.0, 1.0]] * 2


def test_without_velocities_of_the_detector_those_of_the_tracks_count():
    told = replace(reported(), velocities=None)
    detector = Listens(told, track_score=0.5)
    loop = loop_of(handmade_film(), detector)
    loop.keyframe(np.array([], np.int64))
    ahead = told.boxes.copy()
    ahead[:, 0] += 1.0
    detector.found = replace(told, boxes=ahead)
    seen = loop.keyframe(np.array([], np.int64))
    assert seen.velocities == pytest.approx(np.array([[2.0, 0.0], [0.0, 0.0]]))


def test_far_points_reach_a_real_detector_and_nothing_else():
    film = handmade_film()
    cells = np.array([5, 9000])
    far = Cloud(cells, 80.0 * GRID.directions[cells], np.full(2, NO_OBJECT))
    shots = tuple(replace(shot, cloud=replace(shot.cloud, far=far)) for shot in film.shots)
    film = replace(film, shots=shots)
    whole, near = Listens(), Listens(far=False)
    loops = [loop_of(film, detector) for detector in (whole, near)]
    for loop in loops:
        loop.keyframe(np.array([5]))
    (all_points,), (near_points,) = whole.given, near.given
    assert len(all_points) == len(near_points) + 1
    assert np.linalg.norm(all_points, axis=1).max() == pytest.approx(80.0)
    # An observation knows no range beyond the reach.
    assert loops[0].belief.ranges.ravel()[5] == loops[0].rig.grid.range_m


@pytest.mark.parametrize(
    ("told", "fault"),
    [
        ({"fields": ("x", "colour")}, "unknown field of detector mine 'colour'"),
        ({"sweeps": 0}, "sweeps of detector mine must be a whole number"),
        ({"track_score": 2}, "track_score of detector mine"),
    ],
)
def test_wishes_that_cannot_be_met_are_named(told, fault):
    with pytest.raises(InvalidInput, match=fault) as refused:
        PointsOnly("mine", Listens(**told), HEIGHT)
    assert "fields" not in told or refused.type is BrokenDetector


def test_attributes_that_are_none_are_named():
    told = replace(reported(), attributes=["vehicle.moving", "car.blue"])
    loop = loop_of(handmade_film(), Listens(told))
    with pytest.raises(BrokenDetector, match=r"attributes must be of .*, got 'car.blue'"):
        loop.keyframe(np.array([], np.int64))
