"""False boxes: how many come, where from, and how little the numbers of a single one say that it is
false.
"""

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.conditions import Sensing
from care_sim.core.types import CLASSES, ImageDetections
from care_sim.envs.open_loop import FilmEnv
from care_sim.scenarios.dartout import Dense
from care_sim.sensors.annotated import NO_OBJECT, IdentifiedDetections
from care_sim.sensors.camera import CameraDetector
from care_sim.sensors.false_boxes import MOST_DRAWS, BoxPool, FalseBoxes
from care_sim.sensors.pictures import FRONT_CAMERA
from care_sim.sensors.surround import SURROUND_CAMERAS
from care_sim.sources.street_films import record
from care_sim.streets.street import make_street
from care_sim.world import bullet_bodies as clients
from tests.helpers.short_streets import part_of
from tests.helpers.telling_apart import CHANCE, areas_under_the_curve

PEDESTRIAN, CAR = CLASSES.index("pedestrian"), CLASSES.index("car")
SHOWN = slice(0, 7)
"""Class, confidence, box and camera."""
SEED = np.random.SeedSequence(0)
PITCHED = 2
"""A seed whose mount turns the camera far up or down."""


def table(*boxes, pixels=400, label=CAR, camera=0):
    """Detections of boxes with so many visible pixels."""
    rows = [[label, pixels / (pixels + 36), *box, camera, 0.0, 0.0] for box in boxes]
    return np.array(rows, float).reshape(-1, len(ImageDetections.COLUMNS))


def pool(rows, times=None, cameras=(FRONT_CAMERA,), apart=0.0):
    """A pool of rows, each seen at its time."""
    times = np.zeros(len(rows)) if times is None else times
    seen = [
        IdentifiedDetections(ImageDetections.from_rows(row[None]), np.array([number]))
        for number, row in enumerate(rows)
    ]
    return BoxPool.of(seen, times, cameras, apart)


def spread(number, seed=0):
    """Boxes of 20 x 20 pixels and more all over the picture."""
    rng = np.random.default_rng(seed)
    corners, sizes = rng.integers(0, (250, 120), (number, 2)), rng.integers(20, 60, (number, 2))
    return table(*np.column_stack([corners, corners + sizes]))


def drawn(rate, keyframes=400, rows=None, true=None, seed=0):
    false_boxes = FalseBoxes(
        pool(spread(200) if rows is None else rows), rate, 1, np.random.default_rng(seed)
    )
    return [false_boxes.draw(spread(0) if true is None else true, 0.0) for _ in range(keyframes)]


def overlaps(ours, theirs):
    """(n, m) intersection over union of boxes of one class and camera, else 0."""
    low, high = (
        np.maximum(ours[:, None, 2:4], theirs[:, 2:4]),
        np.minimum(ours[:, None, 4:6], theirs[:, 4:6]),
    )
    common = np.prod(np.clip(high - low, 0, None), axis=-1)
    areas = [np.prod(rows[:, 4:6] - rows[:, 2:4], axis=1) for rows in (ours, theirs)]
    alike = (ours[:, None, 0] == theirs[:, 0]) & (ours[:, None, 6] == theirs[:, 6])
    return alike * common / (areas[0][:, None] + areas[1] - common)


def test_ghosts_come_in_poisson_numbers():
    numbers = [len(rows) for rows in drawn(3.0)]
    assert np.mean(numbers) == pytest.approx(3.0, abs=0.3)
    assert np.var(numbers) == pytest.approx(3.0, abs=0.6)


def test_the_rate_is_a_mean_over_the_pictures_and_boxes_come_where_true_ones_do():
    rows = np.concatenate([spread(90), table((10, 10, 50, 50), camera=1)[[0] * 10]])
    false_boxes = FalseBoxes(
        pool(rows, cameras=SURROUND_CAMERAS[:2]), 2.0, 2, np.random.default_rng(0)
    )
    ghosts = [false_boxes.draw(spread(0), 0.0) for _ in range(400)]
    assert np.mean(list(map(len, ghosts))) == pytest.approx(4.0, abs=0.3)
    assert np.mean(np.concatenate(ghosts)[:, 6]) == pytest.approx(0.1, abs=0.03)


def test_a_ghost_on_a_box_of_its_class_is_drawn_again_and_at_last_left_out():
    box = table((100, 80, 140, 110))
    free = table((200, 80, 240, 110))
    both = np.concatenate([box, free])
    alone = drawn(1.0, 50, rows=both, true=spread(0))
    beside = drawn(1.0, 50, rows=both, true=box)
    nowhere = drawn(1.0, 50, rows=box, true=box)
    assert sum(map(len, nowhere)) == 0
    assert any((rows[:, 2] < 150).any() for rows in alone)
    assert all((rows[:, 2] > 150).all() for rows in beside)
    numbers = np.array([[len(rows) for rows in kind] for kind in (alone, beside)])
    assert np.all((numbers[1] > 0) == (numbers[0] > 0)), f"{MOST_DRAWS} draws find the free place"


def test_a_ghost_may_lie_on_a_box_of_another_class_or_picture():
    place = (100, 80, 140, 110)
    for beside in (table(place, label=PEDESTRIAN), table(place, camera=1)):
        assert sum(map(len, drawn(1.0, 50, rows=table(place), true=beside))) > 20


def test_ghosts_do_not_lie_on_each_other():
    for rows in drawn(8.0, 60, rows=spread(30)):
        assert np.all(overlaps(rows, rows) - np.eye(len(rows)) < 0.5)


def test_every_policy_meets_the_same_draws_whatever_is_there():
    """The second keyframe's do not depend on what was there at the first."""
    rows = spread(200)
    ones, others = (FalseBoxes(pool(rows), 3.0, 1, np.random.default_rng(1)) for _ in range(2))
    ones.draw(spread(0), 0.0)
    others.draw(spread(40, seed=3), 0.0)
    assert np.array_equal(ones.draw(spread(0), 0.1), others.draw(spread(0), 0.1))


def test_a_film_lends_boxes_of_other_times_only():
    rows = table(*((30 * n, 80, 30 * n + 20, 110) for n in range(10)))
    false_boxes = FalseBoxes(
        pool(rows, np.arange(10.0), apart=3.0), 3.0, 1, np.random.default_rng(0)
    )
    lefts = np.concatenate([false_boxes.draw(spread(0), 5.0) for _ in range(50)])[:, 2]
    assert set(np.rint(lefts / 30)) == {0, 1, 2, 8, 9}


edges = st.tuples(st.integers(0, 280), st.integers(0, 150), st.integers(1, 39), st.integers(1, 29))


@given(
    st.lists(st.tuples(edges, st.floats(0.05, 1)), min_size=1, max_size=12),
    st.integers(0, 2**32 - 1),
)
def test_ghosts_of_rendered_pictures_have_whole_edges_and_pixels_that_fit(boxes, seed):
    """And stay as far from the border, and as sure, as the boxes that they are made from."""
    rows = np.concatenate(
        [
            table(
                (left, top, left + width, top + height), pixels=max(round(fill * width * height), 1)
            )
            for (left, top, width, height), fill in boxes
        ]
    )
    count = 40
    rng = np.random.default_rng(seed)
    ghosts = pool(rows).varied(rng.integers(len(rows), size=count), rng.random((count, 3)))
    left, top, right, bottom = ghosts[:, 2:6].T
    pixels = 36 * ghosts[:, 1] / (1 - ghosts[:, 1])
    assert np.array_equal(ghosts[:, 2:6], np.rint(ghosts[:, 2:6]))
    assert pixels == pytest.approx(np.rint(pixels), abs=1e-6)
    assert np.all(
        (left < right) & (top < bottom) & (pixels <= (right - left) * (bottom - top) + 1e-6)
    )
    assert ghosts[:, 1].min() >= rows[:, 1].min() - 1e-12
    assert np.all(ghosts[:, 2:4].min(axis=0) >= rows[:, 2:4].min(axis=0))
    assert np.all(ghosts[:, 4:6].max(axis=0) <= rows[:, 4:6].max(axis=0))


def test_what_the_edge_of_the_picture_cuts_it_cuts_in_a_ghost_too():
    rows = table((0, 60, 50, 120), (270, 60, 320, 180), (100, 80, 140, 110))
    ghosts = pool(rows).varied(np.repeat([0, 1], 50), np.random.default_rng(0).random((100, 3)))
    assert np.all(ghosts[:50, 2] == 0)
    assert np.all(ghosts[50:, 4:6] == (320, 180))
    assert len(np.unique(ghosts[:50, 4])) > 3


def test_ghosts_are_written_with_the_decimals_of_the_file_that_they_come_from():
    """The recorded picture is off the rig's by a part of a pixel, so that no edge is a round
    number.
    """
    rng = np.random.default_rng(0)
    corners = np.round(rng.uniform(0, 600, (30, 2)), 1)
    boxes = np.column_stack([corners, corners + np.round(rng.uniform(20, 200, (30, 2)), 1)])
    off = np.array([-16.267, -41.507, -16.267, -41.507])
    rows = table(*(boxes + off))
    rows[:, 1] = np.round(rng.uniform(0.3, 1.0, 30), 3)
    ghosts = pool(rows).varied(rng.integers(30, size=200), rng.random((200, 3)))
    for values, decimals in ((ghosts[:, 2:6] - off, 1), (ghosts[:, 1], 3)):
        assert values == pytest.approx(np.round(values, decimals), abs=1e-6)
    assert (
        len(
            {tuple(row) for row in ghosts[:, 2:6].tolist()}
            & {tuple(row) for row in rows[:, 2:6].tolist()}
        )
        < 10
    )


def played(env, seed):
    """Tables of the true and of the false boxes of every keyframe of an episode in which every cell
    is fired.
    """
    observation, _ = env.reset(seed=seed)
    loop, everything, over = env.unwrapped.loop, np.ones(env.action_space.shape, np.float32), False
    keyframes = []
    while not over:
        film = hasattr(loop, "shot")
        identified = loop.shot.seen if film else loop.faultless(as_mounted=True)
        truth = {
            tuple(row) for row in identified.detections.rows().astype(np.float32)[:, SHOWN].tolist()
        }
        shown = observation["detections"][observation["detections"][:, 0] >= 0]
        true = np.array([tuple(row) in truth for row in shown[:, SHOWN].tolist()], bool)
        keyframes.append((shown[true], shown[~true]))
        observation, _, terminated, truncated, _ = env.step(everything)
        over = terminated or truncated
    return keyframes


def keyframes_of(name, rate, seeds, **more):
    env = gymnasium.make(
        name, budget=1.0, false_positive_rate=rate, disable_env_checker=True, **more
    )
    episodes = [played(env, seed) for seed in seeds]
    env.close()
    return episodes


def of_kind(episodes, kind):
    """A table an episode: of true boxes (0) or false ones (1)."""
    return [np.concatenate([keyframe[kind] for keyframe in keyframes]) for keyframes in episodes]


@pytest.fixture(scope="module")
def dense():
    """Eight episodes of the dense street with two ghosts a picture."""
    return keyframes_of("CARE-Dense-v0", 2.0, range(8))


@pytest.fixture(scope="module")
def streets():
    """The same of the first twelve seconds of two generated streets."""
    episodes = []
    for seed in (3000, 3001):
        film = record(part_of(make_street(seed), slice(24)))
        episodes.append(played(FilmEnv(film, budget=1.0, false_positive_rate=3.0), 0))
    return episodes


@pytest.mark.parametrize("world", ["dense", "streets"])
def test_small_classifiers_of_single_boxes_tell_no_more_than_they_did(world, request):
    """With 300 boxes of each kind. `results/degraded-sensing.md` says what else tells them apart,
    and how well.
    """
    episodes = request.getfixturevalue(world)
    areas = areas_under_the_curve(
        *(of_kind(episodes, kind) for kind in (0, 1)), np.random.default_rng(0)
    )
    assert all(0.5 - CHANCE <= area <= 0.5 + CHANCE for area in areas.values()), areas


def test_few_false_people_stand_where_nobody_can_have_emerged_yet(dense):
    """Scenarios run by the clock: 40% of the false people stood there too early when any moment
    lent its boxes.
    """
    true, false = (
        [
            n
            for episode in dense
            for n, both in enumerate(episode)
            for row in both[kind]
            if row[0] == PEDESTRIAN
        ]
        for kind in (0, 1)
    )
    assert len(false) > 30
    assert np.mean(np.array(false) < min(true)) < 0.3


def test_as_many_ghosts_as_asked_for(dense, streets):
    for episodes, rate, cameras in ((dense, 2.0, 1), (streets, 3.0, 6)):
        numbers = [len(false) for keyframes in episodes for _, false in keyframes]
        assert np.mean(numbers) == pytest.approx(rate * cameras, abs=0.1 * rate * cameras)


def test_a_crooked_camera_sees_ghosts_as_crookedly_as_the_rest():
    (keyframes,) = keyframes_of("CARE-Dense-v0", 4.0, [PITCHED], camera_rotation_sigma_deg=10.0)
    (straight,) = keyframes_of("CARE-Dense-v0", 4.0, [PITCHED])
    true, false, usual = (
        np.median(np.concatenate(rows)[:, [3, 5]].mean(axis=1))
        for rows in ([b[0] for b in keyframes], [b[1] for b in keyframes], [b[0] for b in straight])
    )
    assert abs(true - usual) > 25
    assert abs(false - true) < 10


def test_the_other_drive_is_of_a_world_of_its_own_and_leaves_no_client_behind(monkeypatch):
    built = []

    def build(scenario, rng, real=Dense.build):
        built.append(repr(rng.bit_generator.state))
        return real(scenario, rng)

    monkeypatch.setattr(Dense, "build", build)
    env = gymnasium.make("CARE-Dense-v0", disable_env_checker=True)
    env.reset(seed=0)
    assert len(built) == 1
    env.close()
    free = len(clients._free)
    env = gymnasium.make("CARE-Dense-v0", false_positive_rate=1.0, disable_env_checker=True)
    for _ in range(2):
        env.reset(seed=0)
    env.close()
    assert len(clients._free) == free
    assert len(built) == 5
    assert len(set(built)) == 2
    assert built[0] in built[2::2]


def test_ghosts_change_nothing_of_what_is_true():
    plain, with_ghosts = (
        keyframes_of("CARE-Dartout-v0", 0.0, [0]),
        keyframes_of("CARE-Dartout-v0", 1.0, [0]),
    )
    assert all(np.array_equal(a[0], b[0]) for a, b in zip(plain[0], with_ghosts[0], strict=True))
    assert {row[0] for _, false in with_ghosts[0] for row in false} == {PEDESTRIAN}, (
        "nobody else has a box here"
    )


def test_of_boxes_that_sort_alike_the_order_does_not_say_which_is_false():
    """Confidence and left edge decide; a true and a false box that have both in common may come in
    either order.
    """
    boxes = high, low = table((10, 20, 30, 40)), table((10, 60, 30, 80))
    orders, behind = [], []
    for true, false in (boxes, boxes[::-1]):
        lent = pool(false)
        lent.__dict__["varied"] = lambda rows, draws, lent=lent: lent.rows[rows]
        camera = CameraDetector([], Sensing(false_positive_rate=9), 0.1, SEED, [FRONT_CAMERA], lent)
        identified = IdentifiedDetections(ImageDetections.from_rows(true), np.array([0]))
        arrived = camera.detect(identified, 0.0, np.empty((0, 7)), 0.0)
        orders.append(arrived.detections.boxes.tolist())
        behind.append(arrived.objects.tolist())
    assert orders[0] == orders[1] == [high[0, 2:6].tolist(), low[0, 2:6].tolist()]
    assert behind == [[0, NO_OBJECT], [NO_OBJECT, 0]]
