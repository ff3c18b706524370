"""Jitter of boxes: its spread relative to the box, and that boxes stay in their picture."""

from itertools import pairwise, product

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import Sensing
from care_sim.core.frames import Frame
from care_sim.core.types import CLASSES, ImageDetections
from care_sim.envs.open_loop import FilmEnv
from care_sim.loops.film import Film
from care_sim.sensors.annotated import NO_OBJECT, IdentifiedDetections
from care_sim.sensors.camera import CameraDetector
from care_sim.sensors.camera_errors import (
    LEAST_PX,
    UNHIDDEN,
    Ghosts,
    PersistentDraws,
    confuse_classes,
    jitter_boxes,
    seen_as,
    whole_boxes,
)
from care_sim.sensors.camera_profiles import YOLOX, RecallTable
from care_sim.sensors.engines.picture_kernels import visible_boxes
from care_sim.sensors.false_boxes import NO_ROWS, BoxPool, box_areas
from care_sim.sensors.pictures import FRONT_CAMERA, faultless_detections
from care_sim.world.bodies import CATALOGUE

SPREADS = (0.1, 0.02, 0.15, 0.05)


def errors(boxes, draws, spreads=SPREADS):
    boxes, draws = np.asarray(boxes, float), np.asarray(draws, float)
    zeros = np.zeros(len(boxes), np.int64)
    return jitter_boxes(boxes, draws, np.tile(spreads, (len(boxes), 1)), zeros, [FRONT_CAMERA])


def test_one_sigma_moves_and_stretches_by_the_spread():
    one_sigma = 0.8413447460685429
    ((left, top, right, bottom),) = errors([[100.0, 50.0, 140.0, 110.0]], [[one_sigma] * 4])
    assert (left + right) / 2 == pytest.approx(120.0 + 0.1 * 40)
    assert (top + bottom) / 2 == pytest.approx(80.0 + 0.02 * 60)
    assert right - left == pytest.approx(40 * np.exp(0.15))
    assert bottom - top == pytest.approx(60 * np.exp(0.05))


EDGES = st.tuples(st.floats(0, 318), st.floats(0, 178), st.floats(1, 320), st.floats(1, 180))


@given(EDGES, st.lists(st.floats(1e-9, 1 - 1e-9), min_size=4, max_size=4))
def test_a_box_stays_a_box_within_its_picture(edges, draws):
    left, top, width, height = edges
    box = [left, top, min(left + width, 320), min(top + height, 180)]
    ((a, b, c, d),) = errors([box], [draws])
    assert 0 <= a <= c - LEAST_PX + 1e-9
    assert 0 <= b <= d - LEAST_PX + 1e-9
    assert c <= 320
    assert d <= 180


MATRIX = YOLOX.confusion_matrix()


@pytest.mark.parametrize("true", range(len(CLASSES)))
def test_classes_are_reported_as_often_as_the_matrix_says(true):
    draws = (np.arange(1000) + 0.5) / 1000
    reported = confuse_classes(np.full(1000, true), draws, MATRIX)
    assert np.bincount(reported, minlength=5) / 1000 == pytest.approx(MATRIX[true])


def test_a_draw_below_one_always_has_a_class():
    thirds = np.full((3, 3), 1 / 3)
    assert confuse_classes(np.array([0]), np.array([np.nextafter(1.0, 0.0)]), thirds).tolist() == [
        2
    ]


TABLE = RecallTable((10.0, 30.0), (0.5, 1.0), ((0.2, 0.4), (0.6, 0.8)))
SENSOR = Frame(0.0, 0.0, 1.84, 0.0)
TABLES = [group.recall for group in YOLOX.groups]


@pytest.mark.parametrize(
    ("height", "share", "recall"),
    [
        (10, 1.0, 0.6), (30, 0.5, 0.4), (20, 1.0, 0.7), (20, 0.75, 0.5),  # between four numbers
        (5, 1.0, 0.3), (30, 0.25, 0.2), (5, 0.25, 0.05),  # towards nothing
        (99, 1.0, 0.8), (0, 1.0, 0.0), (99, 0.0, 0.0),
    ],
)  # fmt: skip
def test_recall_is_linear_between_the_numbers_of_the_table(height, share, recall):
    assert TABLE.at(np.array([float(height)]), np.array([share])) == pytest.approx([recall])


@pytest.mark.parametrize("table", TABLES)
@given(height=st.floats(0, 500), share=st.floats(0, 0.99), more=st.floats(0, 0.01))
def test_recall_is_a_chance_and_grows_with_what_is_visible(table, height, share, more):
    less, most = table.at(np.array([height, height]), np.array([share, share + more]))
    assert 0.0 <= less <= most + 1e-12
    assert most <= 1.0


def detections(*boxes):
    # Buses, whose whole box is the box round their pixels.
    rows = [(2, 0.9, *box, 0, 0.0, 0.0) for box in boxes]
    return IdentifiedDetections(
        ImageDetections.from_rows(np.array(rows, float)), np.arange(len(boxes))
    )


def test_the_share_is_that_of_the_whole_box_within_the_picture():
    box = np.array([[12.0, 1.0, -1.0, 0.6, 0.6, 1.8, 0.0]])
    ((left, top, right, bottom),) = whole_boxes(FRONT_CAMERA, box)
    middle = (top + bottom) / 2
    seen = detections((left, top, right, bottom), (left, top, right, middle))
    heights, shares = seen_as(seen, np.repeat(box, 2, axis=0), [FRONT_CAMERA], 480.0)
    # The front camera's focal length is 160 pixels, a third of this picture's.
    assert heights == pytest.approx(3.0 * (bottom - top))
    assert shares == pytest.approx([1.0, 0.5])


def test_a_share_that_the_source_annotates_counts():
    box = np.array([[12.0, 1.0, -1.0, 0.6, 0.6, 1.8, 0.0]])
    seen = detections(whole_boxes(FRONT_CAMERA, box)[0])
    told = IdentifiedDetections(seen.detections, seen.objects, np.array([0.7]))
    assert seen_as(told, box, [FRONT_CAMERA], 480.0)[1].tolist() == [0.7]


def ratio_from_all_sides(bullet, kind):
    """Areas of the box round the pixels over that of the whole box, alone in the picture."""
    size, label = CATALOGUE[kind].size, CLASSES.index(CATALOGUE[kind].label)
    body = bullet.add(CATALOGUE[kind], (10.0, 0.0, 0.0))
    ratios = []
    for metres, yaw in product((10.0, 20.0, 30.0), np.linspace(0.0, np.pi, 8, endpoint=False)):
        bullet.move_all(np.array([body]), np.array([(metres, 2.0, yaw)]))
        local = SENSOR.boxes_to_local(np.array([[metres, 2.0, size[2] / 2, *size, yaw]]))
        picture = visible_boxes(bullet.body_ids(FRONT_CAMERA, SENSOR))
        seen = faultless_detections([picture], {body: label}).detections
        ratios += (box_areas(seen.boxes) / box_areas(whole_boxes(FRONT_CAMERA, local))).tolist()
    bullet.move_all(np.array([body]), np.array([(-99.0, 0.0, 0.0)]))
    return ratios


@pytest.mark.parametrize("label", CLASSES)
def test_the_share_that_shows_when_nothing_hides_is_the_median_of_the_class(bullet, label):
    # The share of two-wheelers is of those that are ridden; parked ones stand on cluttered streets.
    kinds = [
        name for name, kind in CATALOGUE.items() if kind.label == label and name != "parked bicycle"
    ]
    ratios = [ratio for kind in kinds for ratio in ratio_from_all_sides(bullet, kind)]
    assert np.median(ratios) == pytest.approx(UNHIDDEN[label], abs=0.02)


KEYFRAME_S = 0.1


def drawn(keyframes=400, objects=200, times_s=(0.2, 1.0), seed=0):
    draws = PersistentDraws(objects, times_s, KEYFRAME_S, np.random.default_rng(seed))
    return np.array([draws.next() for _ in range(keyframes)])


@pytest.mark.parametrize(("column", "time_s"), [(0, 0.2), (1, 1.0)])
@pytest.mark.parametrize("recall", [0.3, 0.9])
def test_misses_are_correlated_as_stated(column, time_s, recall):
    """The autocorrelation of misses is exp(-t / time), whatever the recall."""
    missed = drawn()[..., column] >= recall
    assert missed.mean() == pytest.approx(1 - recall, abs=0.02)
    away = missed - missed.mean()
    for lag in (1, 3, 8):
        correlation = np.mean(away[lag:] * away[:-lag]) / np.mean(away**2)
        assert correlation == pytest.approx(np.exp(-lag * KEYFRAME_S / time_s), abs=0.04)


POOLED = 50


def row(place, shift=0.0):
    left = 5.0 + 6.0 * place + shift
    return [4, 0.5, left, 60.0, left + 4.0, 80.0, 0, 0.0, 0.0]


def pool(pictures=160, objects=POOLED, pixels_per_keyframe=0.0):
    """Objects side by side that move to the right together."""
    seen = [
        IdentifiedDetections(
            ImageDetections.from_rows(
                np.array([row(n, pixels_per_keyframe * k) for n in range(objects)])
            ),
            np.arange(objects),
        )
        for k in range(pictures)
    ]
    return BoxPool.of(seen, KEYFRAME_S * np.arange(pictures), [FRONT_CAMERA])


STILL = pool()


def shown(lent=STILL, rate=2.0, time_s=0.5, keyframes=100, seed=0, true=NO_ROWS):
    ghosts = Ghosts(lent, rate, time_s, KEYFRAME_S, 1, np.random.default_rng(seed))
    return [ghosts.draw(true, KEYFRAME_S * k) for k in range(keyframes)]


def test_there_are_as_many_as_stated_from_the_first_picture_on():
    lengths = np.array([list(map(len, shown(keyframes=12, seed=seed))) for seed in range(60)])
    assert lengths[:, 0].mean() == pytest.approx(2.0, abs=0.6)
    assert lengths.mean() == pytest.approx(2.0, abs=0.4)


@pytest.mark.parametrize(
    ("time_s", "pictures"),
    # 1 / (1 - exp(-keyframe / time)) pictures; 1.95 were measured on the detections of YOLOX.
    [(YOLOX.ghost_time_s, 1.95), (0.5, 5.52)],
)
def test_they_last_as_many_pictures_as_stated(time_s, pictures):
    there = stay = 0
    for seed in range(16):
        # Each keeps its left edge in a pool that stands still.
        edges = [set(boxes[:, 2].tolist()) for boxes in shown(time_s=time_s, seed=seed)]
        there += sum(map(len, edges[:-1]))
        stay += sum(len(now & before) for before, now in pairwise(edges))
    assert 1 / (1 - stay / there) == pytest.approx(pictures, rel=0.1)


def test_a_ghost_moves_as_the_object_that_it_follows():
    moving = pool(pictures=60, objects=1, pixels_per_keyframe=3.0)
    steps = []
    for seed in range(6):
        # One ghost is shown at most. It ends with the pool's last picture, and another may follow.
        lefts = [boxes[0, 2] for boxes in shown(moving, 1.0, 1e6, 10, seed) if len(boxes) == 1]
        steps += np.diff(lefts).tolist()
    # Near the pool's edges its variation is made the other way round: that step is another.
    assert len(steps) > 12
    assert np.median(steps) == pytest.approx(3.0, abs=0.3)
    assert np.mean(np.abs(np.array(steps) - 3.0) < 1.1) > 0.7


def test_it_is_hidden_by_a_box_of_its_class_and_comes_back():
    one = pool(objects=1)
    free = [len(boxes) for boxes in shown(one, 3.0, 1e6, 10)]
    assert max(free) == 1
    assert not any(len(boxes) for boxes in shown(one, 3.0, 1e6, 10, true=np.array([row(0)])))
    other_class = np.array([[0, *row(0)[1:]]])
    assert [len(boxes) for boxes in shown(one, 3.0, 1e6, 10, true=other_class)] == free


def test_what_is_there_does_not_move_the_draws():
    everything = np.array([row(n) for n in range(0, POOLED, 2)])
    ours, theirs = shown(keyframes=60), shown(keyframes=60, true=everything)
    for free, beside in zip(ours, theirs, strict=True):
        assert {*beside[:, 2].tolist()} <= {*free[:, 2].tolist()}
    assert sum(map(len, theirs)) < sum(map(len, ours))


CAR, TRUCK, BICYCLE, PEDESTRIAN = (
    CLASSES.index(name) for name in ("car", "truck", "bicycle", "pedestrian")
)
OBJECTS = 300


def reported(label, distance, height, visible=1.0, keyframes=60, seed=0):
    """All that arrives of OBJECTS alike objects whose lower part is hidden."""
    box = np.array([[distance, 0.0, -1.84 + height / 2, 0.6, 0.6, height, 0.0]])
    ((left, top, right, bottom),) = whole_boxes(FRONT_CAMERA, box)
    row = [label, 0.9, left, top, right, top + visible * (bottom - top), 0, 0.0, 0.0]
    seen = IdentifiedDetections(
        ImageDetections.from_rows(np.tile(row, (OBJECTS, 1))), np.arange(OBJECTS)
    )
    camera = CameraDetector(
        range(OBJECTS),
        Sensing(camera_profile="yolox"),
        0.1,
        np.random.SeedSequence(seed),
        [FRONT_CAMERA],
    )
    boxes = np.repeat(box, OBJECTS, axis=0)
    found = [camera.detect(seen, 0.0, boxes, 0.1 * k) for k in range(keyframes)]
    return found, (bottom - top) * YOLOX.focal_px / FRONT_CAMERA.focal


@pytest.mark.parametrize("label", [CAR, PEDESTRIAN])
@pytest.mark.parametrize(("distance", "visible"), [(10.0, 1.0), (20.0, 1.0), (20.0, 0.45)])
def test_the_long_run_is_the_table(label, distance, visible):
    found, height = reported(label, distance, 1.8, visible)
    table = YOLOX.groups[YOLOX.group_of[label]].recall
    share = min(visible / UNHIDDEN[CLASSES[label]], 1.0)
    (recall,) = table.at(np.array([height]), np.array([share]))
    shares = [len(one) / OBJECTS for one in found]
    # From the first keyframe on, but for the spread of 300 objects.
    assert shares[0] == pytest.approx(recall, abs=0.1)
    assert np.mean(shares) == pytest.approx(recall, abs=0.03)


def test_a_cyclist_is_sometimes_reported_as_a_pedestrian_and_stays_that_object():
    found, _ = reported(BICYCLE, 10.0, 1.8)
    classes = np.concatenate([one.detections.classes for one in found])
    assert {*classes.tolist()} == {BICYCLE, PEDESTRIAN}
    assert np.mean(classes == PEDESTRIAN) == pytest.approx(0.20, abs=0.04)
    assert not any((one.objects == NO_OBJECT).any() for one in found)


@pytest.mark.parametrize(("aside", "expected"), [(0.0, 0.0), (60.0, 0.28)])
def test_ghosts_come_as_often_as_stated_and_never_where_an_object_is(aside, expected):
    """All of the pool is one box, that of the car or one beside it."""
    box = np.array([[15.0, 0.0, -1.0, 1.8, 1.8, 1.6, 0.0]])
    (edges,) = whole_boxes(FRONT_CAMERA, box)
    times_s = 0.1 * np.arange(400)

    def seen(shift):
        row = [CAR, 0.9, *np.add(edges, [shift, 0.0, shift, 0.0]), 0, 0.0, 0.0]
        rows = np.array([row], float)
        return IdentifiedDetections(ImageDetections.from_rows(rows), np.array([0]))

    pool = BoxPool.of([seen(aside)] * len(times_s), times_s.tolist(), [FRONT_CAMERA])
    sensing = Sensing(camera_profile="yolox")
    counts = []
    for seed in range(30):
        camera = CameraDetector(
            [0], sensing, 0.1, np.random.SeedSequence(seed), [FRONT_CAMERA], pool
        )
        found = [camera.detect(seen(0.0), 0.0, box, 0.1 * k) for k in range(40)]
        counts += [np.sum(one.objects == NO_OBJECT) for one in found]
    # A second ghost at the same place is never shown beside the first.
    assert np.mean(np.array(counts) > 0) == pytest.approx(1 - np.exp(-expected), abs=0.05)


def observations(policy, keyframes=12, **conditions):
    env = gymnasium.make("CARE-Dense-v0", budget=0.05, disable_env_checker=True, **conditions)
    choose = care_sim.make_policy(policy, env)
    seen = [env.reset(seed=0)[0]]
    for _ in range(keyframes):
        seen.append(env.step(choose(seen[-1]))[0])
    env.close()
    return [one["detections"] for one in seen]


def test_every_policy_meets_the_same_detector():
    ours, theirs = (observations(policy, camera_profile="yolox") for policy in ("care", "random"))
    assert all(np.array_equal(a, b) for a, b in zip(ours, theirs, strict=True))
    assert not all(np.array_equal(a, b) for a, b in zip(ours, observations("care"), strict=True))


def test_the_faults_come_on_top_and_leave_the_profile_as_it_is():
    def boxes(**faults):
        return [
            {tuple(row[2:6]) for row in one if row[0] >= 0}
            for one in observations("random", camera_profile="yolox", **faults)
        ]

    alone, missing = boxes(), boxes(false_negative_rate=0.5)
    assert all(fewer <= all_ for fewer, all_ in zip(missing, alone, strict=True))
    assert sum(map(len, missing)) < sum(map(len, alone))


def test_detections_of_a_file_have_errors_of_their_own():
    film = Film("empty", (FRONT_CAMERA,), 1.84, 0.5, (), detected=True)
    env = FilmEnv(film, camera_profile="yolox")
    with pytest.raises(InvalidInput, match="camera_profile must be ideal where"):
        env.reset(seed=0)
