import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import Sensing
from care_sim.core.frames import Frame
from care_sim.core.types import CLASSES
from care_sim.sensors.camera import CameraDetector
from care_sim.sensors.pictures import (
    FRONT_CAMERA,
    FULL_CONFIDENCE,
    MIN_PIXELS,
    Picture,
    class_table,
    confidence_of,
    faultless_detections,
    window_on,
)
from care_sim.world.bodies import CATALOGUE

SENSOR = Frame(0.0, 0.0, 1.84, 0.0)
PEDESTRIAN = CLASSES.index("pedestrian")


class Detector(CameraDetector):
    """Everybody 20 m away, one picture a keyframe."""

    def __init__(self, labels, sensing, keyframe_s, seed):
        super().__init__(list(labels), sensing, keyframe_s, seed, [FRONT_CAMERA])
        self.labels = labels
        self.boxes = np.tile([20.0, 0, 0, 1, 1, 1, 0], (len(labels), 1))
        self.keyframe_s, self.frame = keyframe_s, -1

    def detect(self, picture, heading):
        self.frame += 1
        seen = faultless_detections([picture], class_table(self.labels))
        time_s = self.frame * self.keyframe_s
        return super().detect(seen, heading, self.boxes, time_s).detections


def detector(labels, keyframe_s=0.1, seed=0, **faults):
    return Detector(labels, Sensing(**faults), keyframe_s, np.random.SeedSequence(seed))


def picture(*boxes, shape=(180, 320)):
    """A picture of ids with rectangles (id, left, top, right, bottom), later ones in front."""
    ids = np.full(shape, -1)
    for body, left, top, right, bottom in boxes:
        ids[top:bottom, left:right] = body
    return Picture.of(ids)


def look(bullet):
    return Picture.of(bullet.body_ids(FRONT_CAMERA, SENSOR))


def test_boxes_are_the_outer_edges_of_the_visible_pixels():
    seen = picture((3, 10, 20, 30, 60), (7, 100, 0, 320, 180))
    assert seen.bodies.tolist() == [3, 7]
    assert seen.boxes.tolist() == [[10, 20, 30, 60], [100, 0, 320, 180]]
    assert seen.pixels.tolist() == [20 * 40, 220 * 180]


def test_what_stands_in_front_takes_pixels_away():
    seen = picture((3, 10, 20, 30, 60), (7, 20, 0, 100, 100))
    assert seen.boxes[0].tolist() == [10, 20, 20, 60]
    assert seen.pixels[0] == 10 * 40


def test_a_body_in_two_pieces_has_one_box_around_both():
    seen = picture((3, 10, 20, 50, 60), (7, 20, 0, 40, 180))
    assert seen.boxes[0].tolist() == [10, 20, 50, 60]
    assert seen.pixels[0] == 20 * 40


def test_body_zero_and_an_empty_picture():
    assert picture((0, 1, 2, 3, 4)).bodies.tolist() == [0]
    empty = picture()
    assert (len(empty.bodies), empty.boxes.shape, len(empty.pixels)) == (0, (0, 4), 0)
    assert not empty.shows(0)


@pytest.mark.parametrize(("pixels", "visible"), [(MIN_PIXELS - 1, False), (MIN_PIXELS, True)])
def test_a_sliver_has_no_box(pixels, visible):
    seen = picture((3, 0, 0, pixels, 1))
    assert seen.shows(3) is visible
    assert len(detector({3: 0}).detect(seen, 0.0)) == int(visible)


def test_a_person_in_the_open_has_a_box_where_the_projection_says(bullet):
    person = bullet.add(CATALOGUE["pedestrian"], (15.0, 2.0, 0.0))
    seen = look(bullet)
    corners = [
        (15 + x, 2 + y, z - 1.84) for x in (-0.37, 0.37) for y in (-0.33, 0.33) for z in (0, 1.76)
    ]
    pixels, _ = FRONT_CAMERA.project(corners)
    left, top, right, bottom = seen.boxes[seen.bodies == person][0]
    assert [left, top] == pytest.approx(pixels.min(axis=0), abs=1.7)
    assert [right, bottom] == pytest.approx(pixels.max(axis=0), abs=1.7)


def test_a_person_behind_a_trailer_has_no_box(bullet):
    person = bullet.add(CATALOGUE["pedestrian"], (25.0, 0.0, 0.0))
    assert look(bullet).shows(person)
    bullet.add(CATALOGUE["trailer"], (12.0, 0.0, np.pi / 2))
    assert person not in look(bullet).bodies


def test_a_half_hidden_bus_has_half_a_box(bullet):
    bus = bullet.add(CATALOGUE["bus"], (30.0, 0.0, np.pi / 2))
    whole = look(bullet)
    bullet.add(CATALOGUE["building"], (20.0, -4.0, 0.0))
    half = look(bullet)
    (all_left, _, all_right, _), (left, _, right, _) = (
        s.boxes[s.bodies == bus][0] for s in (whole, half)
    )
    assert left == all_left
    assert (right - left) / (all_right - all_left) == pytest.approx(0.5, abs=0.1)


def test_a_low_wall_leaves_the_upper_half(bullet):
    bus = bullet.add(CATALOGUE["bus"], (30.0, 0.0, np.pi / 2))
    _, top, _, bottom = look(bullet).boxes[0]
    bullet.add(CATALOGUE["car"], (10.0, 0.0, np.pi / 2))
    after = look(bullet)
    _, top_after, _, bottom_after = after.boxes[after.bodies == bus][0]
    assert top_after == top
    assert bottom_after == bottom
    assert after.pixels[after.bodies == bus][0] < look(bullet).pixels.sum()


def test_only_bodies_with_a_label_are_detected_with_their_class():
    seen = picture((3, 50, 20, 80, 60), (7, 100, 20, 130, 60), (5, 0, 0, 30, 30))
    found = detector({7: 0, 5: PEDESTRIAN}).detect(seen, 0.0)
    assert found.classes.tolist() == [0, PEDESTRIAN]
    assert found.boxes.tolist() == [[100, 20, 130, 60], [0, 0, 30, 30]]
    assert found.cameras.tolist() == [0, 0]
    assert found.ages.tolist() == found.yaw_changes.tolist() == [0, 0]


def test_detections_do_not_betray_the_order_of_body_ids():
    one = detector({3: 0, 7: 0}).detect(picture((3, 50, 0, 80, 60), (7, 100, 0, 130, 60)), 0.0)
    other = detector({3: 0, 7: 0}).detect(picture((7, 50, 0, 80, 60), (3, 100, 0, 130, 60)), 0.0)
    assert one.rows().tolist() == other.rows().tolist()


def test_confidence_grows_with_the_visible_pixels_from_a_quarter():
    def confidence(pixels):
        return detector({3: 0}).detect(picture((3, 0, 0, pixels, 1)), 0.0).confidences[0]

    assert confidence(MIN_PIXELS) == pytest.approx(0.25)
    for pixels in (MIN_PIXELS, 13, 77, 319):
        assert confidence(pixels) == confidence_of(float(pixels))
    assert confidence(FULL_CONFIDENCE) == pytest.approx(0.5)
    assert confidence(300) > confidence(200)


LABELS = dict.fromkeys(range(1, 21), 0)
EVERYBODY = picture(*[(body, 15 * body, 0, 15 * body + 10, 10) for body in LABELS])


def missed(found, shown=LABELS):
    return {body for body in shown if 15 * body not in found.boxes[:, 0]}


def test_no_misses_by_default_and_all_at_rate_one():
    assert missed(detector(LABELS).detect(EVERYBODY, 0.0)) == set()
    assert len(detector(LABELS, false_negative_rate=1.0).detect(EVERYBODY, 0.0)) == 0


@pytest.mark.parametrize("rate", [0.2, 0.4])
def test_the_rate_of_misses_is_right(rate):
    camera = detector(LABELS, false_negative_rate=rate)
    misses = [len(missed(camera.detect(EVERYBODY, 0.0))) for _ in range(500)]
    assert np.mean(misses) / 20 == pytest.approx(rate, abs=0.02)


def test_misses_are_drawn_anew_for_every_detection_and_frame():
    camera = detector(LABELS, false_negative_rate=0.5)
    frames = np.array(
        [[body in missed(camera.detect(EVERYBODY, 0.0)) for body in LABELS] for _ in range(2)]
    )
    again = detector(LABELS, false_negative_rate=0.5)
    patterns = {frozenset(missed(again.detect(EVERYBODY, 0.0))) for _ in range(20)}
    assert len(patterns) > 15
    assert frames.shape == (2, 20)


def test_misses_do_not_depend_on_what_is_seen():
    """Two runs that see different bodies agree on each that both see: common random numbers."""
    few = [1, 4, 5, 11, 20]
    some = picture(*[(body, 15 * body, 0, 15 * body + 10, 10) for body in few])
    one, other = (detector(LABELS, false_negative_rate=0.5, seed=3) for _ in range(2))
    for frame in range(50):
        expected = missed(one.detect(EVERYBODY, 0.0)) & set(few)
        assert missed(other.detect(some if frame % 3 else EVERYBODY, 0.0), few) == expected


def test_another_seed_misses_others():
    one, other = (detector(LABELS, false_negative_rate=0.5, seed=seed) for seed in (0, 1))
    assert [missed(one.detect(EVERYBODY, 0.0)) for _ in range(5)] != [
        missed(other.detect(EVERYBODY, 0.0)) for _ in range(5)
    ]


@pytest.mark.parametrize("latency", [0, 1, 2, 3])
def test_a_late_camera_shows_exactly_the_picture_of_then(latency):
    camera = detector({1: 0}, camera_latency=latency)
    found = [camera.detect(picture((1, 10 * t, 0, 10 * t + 9, 9)), 0.1 * t**2) for t in range(8)]
    assert [len(one) for one in found] == [0] * latency + [1] * (8 - latency)
    for t in range(latency, 8):
        assert found[t].boxes[0, 0] == 10 * (t - latency)
        assert found[t].ages[0] == pytest.approx(0.1 * latency)
        assert found[t].yaw_changes[0] == pytest.approx(0.1 * t**2 - 0.1 * (t - latency) ** 2)


def test_latency_counts_keyframes_of_any_length():
    camera = detector({1: 0}, keyframe_s=0.5, camera_latency=1)
    camera.detect(picture((1, 0, 0, 9, 9)), 0.0)
    assert camera.detect(picture((1, 0, 0, 9, 9)), 0.0).ages.tolist() == [0.5]


@pytest.mark.parametrize(
    ("faults", "named"),
    [
        ({"false_negative_rate": -0.1}, "false_negative_rate"),
        ({"false_negative_rate": 1.1}, "false_negative_rate"),
        ({"false_negative_rate": float("nan")}, "false_negative_rate"),
        ({"camera_latency": -1}, "camera_latency"),
        ({"camera_latency": 0.5}, "camera_latency"),
    ],
)
def test_impossible_faults_are_refused_by_name(faults, named):
    with pytest.raises(InvalidInput, match=named):
        Sensing(**faults)


@pytest.mark.parametrize("heading", [0.0, 0.4, -0.3])
def test_rendering_only_a_window_shows_the_same_bodies(bullet, heading):
    """What is looked for lies in the window whole, hidden and half-hidden parts as in the full
    picture.
    """
    places = {
        "car": (12, 3),
        "pedestrian": (9, -1),
        "bicycle": (14, 0.5),
        "bus": (40, 12),
        "truck": (1.5, 4),
        "van": (-9, 0),
    }
    looked_for = {
        bullet.add(CATALOGUE[name], (*place, 0.3)): (name, place) for name, place in places.items()
    }
    bullet.add(CATALOGUE["trailer"], (25.0, 4.0, 0.0))
    boxes = np.array(
        [[*at, CATALOGUE[n].size[2] / 2, *CATALOGUE[n].size, 0.3] for n, at in looked_for.values()]
    )
    sensor = Frame(0.0, 0.0, 1.84, heading)
    window = window_on(FRONT_CAMERA, sensor.boxes_to_local(boxes))
    whole, part = (
        bullet.body_ids(FRONT_CAMERA, sensor),
        bullet.body_ids(FRONT_CAMERA, sensor, window),
    )
    left, top, right, bottom = window
    assert part.shape == (bottom - top, right - left)
    for body in looked_for:
        before, after = (
            np.argwhere(whole == body),
            np.argwhere(part == body) + np.array([top, left]),
        )
        assert abs(len(before) - len(after)) <= 0.01 * len(before)
        if len(before):
            assert np.abs(before.min(axis=0) - after.min(axis=0)).max() <= 1
            assert np.abs(before.max(axis=0) - after.max(axis=0)).max() <= 1


def test_nothing_to_look_for_is_an_empty_window(bullet):
    bullet.add(CATALOGUE["car"], (10.0, 0.0, 0.0))
    behind = np.array([[-10.0, 0.0, -1.0, 4.0, 2.0, 1.5, 0.0]])
    for boxes in (behind, np.empty((0, 7))):
        window = window_on(FRONT_CAMERA, boxes)
        assert Picture.of(bullet.body_ids(FRONT_CAMERA, SENSOR, window), window).bodies.size == 0
