"""The open loop on a film made by hand: the car drives 2 m a keyframe, in a bend if it is told to,
behind another car that may drive too, past a wall.
"""

import numpy as np
import pytest

from care_sim.core.conditions import Sensing
from care_sim.core.frames import Frame
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES, Detections, Ego, ImageDetections
from care_sim.driving.localisation import Localisation
from care_sim.loops.episode import SensorSeeds
from care_sim.loops.film import Film, Shot
from care_sim.loops.open_loop import OpenLoop
from care_sim.perception.points_only import PointsOnly
from care_sim.perception.proxy import ReturnsProxy
from care_sim.sensors.annotated import NO_OBJECT, Annotations, Cloud, IdentifiedDetections
from care_sim.sensors.surround import SURROUND_CAMERAS

RIG = Rig(cameras=SURROUND_CAMERAS, keyframe_s=0.5)
HEIGHT, OTHER = 1.84, 40
"""Height of the sensor; number of the other car."""
BOX = np.array([20.0, 3.0, 0.86, 4.61, 1.95, 1.72, 0.0])
WALL = np.array([5, 6, 7])
NOWHERE = np.array([], np.int64)


def shot(index, annotated, speed, bend):
    sensor = Frame(2.0 * index, 0.0, HEIGHT, bend * index)
    boxes = sensor.boxes_to_local(BOX[None] + [0.5 * speed * index, 0, 0, 0, 0, 0, 0])[
        : int(annotated)
    ]
    cells = RIG.grid.hulls(boxes, 0, 0)[0] if annotated else NOWHERE
    fired = np.concatenate([WALL, np.sort(cells)])
    ranges = np.concatenate([np.full(3, 30.0), np.full(len(cells), 10.0)])
    objects = np.concatenate([np.full(3, NO_OBJECT), np.full(len(cells), OTHER)])
    picture = np.array([[CLASSES.index("car"), 0.9, 100.0 + index, 80, 120, 95, 0, 0, 0]])[
        : int(annotated)
    ]
    return Shot(
        0.5 * index,
        f"shot {index}",
        sensor,
        Ego(4.0 + index),
        Annotations(np.full(len(boxes), OTHER), np.zeros(len(boxes), np.int64), boxes),
        IdentifiedDetections(ImageDetections.from_rows(picture), np.full(len(picture), OTHER)),
        Cloud(fired, RIG.grid.directions[fired] * ranges[:, None], objects),
    )


def film(*, annotated=(True, True, True, True), speed=0.0, bend=0.0):
    shots = tuple(shot(index, present, speed, bend) for index, present in enumerate(annotated))
    return Film("drive", SURROUND_CAMERAS, HEIGHT, 0.5, shots)


def loop_of(film, detector=None, seeds=(0, 1, 2), **sensing):
    children = SensorSeeds(*(np.random.SeedSequence(seed) for seed in (*seeds, 3)))
    return OpenLoop(film, RIG, Sensing(**sensing), children, detector or ReturnsProxy())


def on_the_car(loop):
    return RIG.grid.hulls(loop.shot.annotations.boxes, 0, 0)[0]


def test_before_the_first_scan_there_are_pictures_and_motion_and_no_more():
    belief = loop_of(film()).belief
    assert (belief.ego, belief.budget) == (Ego(4.0), RIG.budget)
    assert (belief.detections.boxes[0, 0], len(belief.tracks), belief.ranges.any()) == (
        100,
        0,
        False,
    )


@pytest.mark.parametrize(("speed", "bend"), [(0.0, 0.0), (3.0, 0.0), (3.0, 0.2)])
def test_what_is_fired_at_is_detected_and_tracked_over_ground(speed, bend):
    """At the third keyframe its forecast is where it is, and its velocity its own."""
    driven = film(speed=speed, bend=bend)
    loop = loop_of(driven)
    for index in range(2):
        fired = on_the_car(loop)
        seen = loop.keyframe(fired)
        assert (seen.index, seen.detections.returns.tolist()) == (index, [len(fired)])
        assert np.array_equal(seen.detections.boxes, driven.shots[index].annotations.boxes)
    assert loop.belief.tracks.boxes[0] == pytest.approx(loop.shot.annotations.boxes[0])
    assert loop.belief.tracks.velocities[0] == pytest.approx(
        [speed * np.cos(2 * bend), -speed * np.sin(2 * bend)]
    )
    assert loop.belief.ego == Ego(6.0)


def test_a_detector_meets_the_points_of_fired_cells_alone():
    class Keeps:
        def detect(self, points, sensor_height_m):
            self.points = points
            return Detections([], [], [])

    keeps = Keeps()
    loop = loop_of(film(), PointsOnly("keeps", keeps, HEIGHT))
    loop.keyframe(np.array([6, 0, 7]))
    assert keeps.points == pytest.approx(30.0 * RIG.grid.directions[[6, 7]])


def test_the_last_scan_is_shown_with_what_was_not_fired_and_what_did_not_return():
    loop = loop_of(film())
    loop.keyframe(np.array([0, 6]))
    ranges = loop.belief.ranges.ravel()
    assert (ranges[0], ranges[6]) == (RIG.grid.range_m, pytest.approx(30.0))
    assert np.count_nonzero(ranges) == 2
    loop.keyframe(NOWHERE)
    assert not loop.belief.ranges.any()


def test_a_picture_one_keyframe_old_is_the_one_before():
    """The strict-causal camera: nothing at the first keyframe, then what the one before saw, half a
    second old.
    """
    loop = loop_of(film(bend=0.1), camera_latency=1)
    assert len(loop.belief.detections) == 0
    for before in range(3):
        loop.keyframe(NOWHERE)
        assert loop.belief.detections.boxes[:, 0].tolist() == [100 + before]
        assert loop.belief.detections.ages.tolist() == [0.5]
        assert loop.belief.detections.yaw_changes == pytest.approx([0.1])


def test_truth_moves_a_forecast_to_its_object_while_that_is_annotated():
    loop = loop_of(film(annotated=(True, True, True, False)))
    loop.keyframe(on_the_car(loop))
    tracks = loop.belief.tracks
    tracks.boxes[0, :2] += 1.5
    assert loop.true_boxes(tracks)[0] == pytest.approx(loop.shot.annotations.boxes[0])
    loop.keyframe(NOWHERE)
    loop.keyframe(NOWHERE)
    assert np.array_equal(loop.true_boxes(tracks), tracks.boxes)


def errors_of(keyframes, **spreads):
    """(keyframes, 3) errors of the pose in x, y and yaw that loops of the usual seeds meet."""
    localisation = Localisation(Sensing(**spreads), 0.5, np.random.SeedSequence(2))
    origin, found = Frame(0.0, 0.0, 0.0, 0.0), []
    for _ in range(keyframes):
        taken = localisation.taken_for(origin)
        found.append((taken.x, taken.y, taken.yaw))
        localisation.advance()
    return np.array(found)


def test_a_wrong_pose_moves_the_forecast_of_what_stands():
    """Seen with the errors e0 and e1, and forecast with e2: off by 2 e1 - e0 - e2."""
    spread = {"ego_position_sigma_m": 0.2}
    loop = loop_of(film(), **spread)
    for _ in range(2):
        loop.keyframe(on_the_car(loop))
    e0, e1, e2 = errors_of(4, **spread)[1:, :2]
    off = loop.belief.tracks.boxes[0, :2] - loop.shot.annotations.boxes[0, :2]
    assert off == pytest.approx(2 * e1 - e0 - e2)


def test_of_three_keyframes_the_forecast_is_on_their_line():
    """It leads on from e0, e1 and e2 to (4 e2 + e1 - 2 e0) / 3."""
    spread = {"ego_position_sigma_m": 0.2}
    loop = loop_of(film(), velocity_keyframes=3, **spread)
    for _ in range(3):
        loop.keyframe(on_the_car(loop))
    e0, e1, e2, e3 = errors_of(5, **spread)[1:, :2]
    off = loop.belief.tracks.boxes[0, :2] - loop.shot.annotations.boxes[0, :2]
    assert off == pytest.approx((4 * e2 + e1 - 2 * e0) / 3 - e3)


def test_a_full_scan_is_read_without_a_draw():
    loop, other = loop_of(film(), lidar_dropout=0.5), loop_of(film(), lidar_dropout=0.5)
    scan = loop.full_scan()
    assert np.count_nonzero(np.isfinite(scan.ranges)) == len(film().shots[0].cloud)
    everything = np.arange(RIG.grid.size)
    assert (
        loop.keyframe(everything).detections.returns
        == other.keyframe(everything).detections.returns
    )


def test_policies_meet_the_same_faults_whatever_they_fire():
    faults = {"lidar_dropout": 0.4, "false_negative_rate": 0.5, "ego_speed_sigma": 0.3}
    one, other = loop_of(film(), **faults), loop_of(film(), **faults)
    one.keyframe(NOWHERE)
    other.keyframe(np.arange(RIG.grid.size))
    assert one.belief.ego == other.belief.ego != Ego(5.0)
    assert len(one.belief.detections) == len(other.belief.detections)
    fired = on_the_car(one)
    assert (
        one.keyframe(fired).detections.returns
        == other.keyframe(np.arange(RIG.grid.size)).detections.returns
    )


def test_an_appearance_is_missed_no_more_often_than_what_was_there_before():
    """At 1.5% a keyframe, in bursts of four, hardly one in forty; not by a burst that began while
    it was absent.
    """
    absent = (False, False, False, True)
    loops = [
        loop_of(
            film(annotated=absent),
            None,
            (seed, 1, 2),
            false_negative_per_m=0.001,
            false_negative_burst=4,
        )
        for seed in range(40)
    ]
    for _ in range(3):
        for loop in loops:
            loop.keyframe(NOWHERE)
    assert sum(len(loop.belief.detections) for loop in loops) >= 36


def test_a_late_box_is_still_of_the_object_that_is_gone():
    late = loop_of(film(annotated=(True, False)), camera_latency=1)
    assert len(late.true_detected_objects()) == 0
    late.keyframe(NOWHERE)
    assert late.true_detected_objects().tolist() == [OTHER]
