"""The training data of the learned detector, and the answers that it should give."""

from contextlib import closing

import numpy as np
import pytest

from care_sim.core.types import CLASSES
from care_sim.envs.open_loop import FilmEnv
from care_sim.perception.pillars.decoding import points_within
from care_sim.perception.pillars.network import REACH_M
from care_sim.policies import maker, tags_of
from care_sim.sensors.setups import setup_names
from care_sim.sources.street_films import street_film
from care_sim.training.supervised.detector_data import (
    CLUTTERED,
    EITHER,
    OTHER_SETUPS,
    POLICIES,
    RECORDED_SETUPS,
    Example,
    Targets,
    loss,
    play,
    scanned,
    targets_of,
)
from care_sim.training.supervised.worlds import World

DRIVE = World(EITHER, 10_003)


@pytest.fixture(scope="module")
def examples():
    return play(DRIVE)


def test_every_object_has_a_return_and_stands_on_the_plan(examples):
    assert examples
    for one in examples:
        larger = one.boxes + 0.5 * np.isin(np.arange(7), (3, 4, 5))
        assert (points_within(one.points.astype(float), larger) > 0).all()
        assert np.abs(one.boxes[:, :2]).max() < REACH_M
        assert set(one.classes.tolist()) <= set(range(len(CLASSES)))
        assert one.boxes[:, 2] + one.sensor_height_m == pytest.approx(one.boxes[:, 5] / 2)


def test_a_play_is_the_same_again_and_another_seed_plays_another(examples):
    again = play(DRIVE)
    assert all(
        np.array_equal(one.points, other.points) and np.array_equal(one.boxes, other.boxes)
        for one, other in zip(examples, again, strict=True)
    )
    assert not np.array_equal(examples[0].boxes, examples[-1].boxes)


def test_a_play_of_a_cluttered_street_has_slopes_and_parked_bicycles():
    (own, *_), (again, *_) = (play(World(CLUTTERED, 10_004)) for _ in range(2))
    assert np.array_equal(own.points, again.points)
    # Boxes stand on a road that leans.
    assert np.ptp(own.boxes[:, 2] - own.boxes[:, 5] / 2) > 0.1


def test_the_points_of_a_range_image_are_those_that_were_fired_and_returned():
    film = street_film(1000)
    with closing(FilmEnv(film, budget=1.0)) as env:
        env.reset(seed=0)
        observation, *_ = env.step(np.ones(env.action_space.shape, np.float32))
    points = scanned(env.rig.grid, observation["ranges"])
    assert points == pytest.approx(film.shots[0].cloud.points, abs=1e-4)
    ranges = observation["ranges"].copy()
    ranges[:16] = 0
    ranges[16:] = env.rig.grid.range_m
    assert len(scanned(env.rig.grid, ranges)) == 0


def test_policies_and_set_ups_are_known_and_none_was_learned():
    for name in POLICIES:
        maker(name)
        assert not {"learned", "privileged", "non-causal"} & set(tags_of(name))
    assert {*OTHER_SETUPS, *RECORDED_SETUPS} < set(setup_names())


torch = pytest.importorskip("torch")
NOTHING = np.empty((0, 3), np.float32)
CAR = [10.3, -4.2, -1.0, 4.6, 1.9, 1.7, 0.3]
PERSON = [11.3, -4.2, -1.0, 0.6, 0.6, 1.8, 0.0]


def wanted(classes, boxes):
    made = targets_of([Example(NOTHING, 1.84, np.array(classes), np.array(boxes))])
    return Targets(*map(torch.from_numpy, made))


def test_a_bump_is_highest_in_the_cell_of_the_centre_and_of_its_class_alone():
    sure = wanted([0], [CAR]).sure[0]
    assert sure.max() == sure[0, 62, 47] == 1
    assert (sure[0] == 1).sum() == 1
    assert not sure[1:].any()


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_between_two_a_cell_tells_of_the_nearer(order):
    labels, objects = zip(*[((0, CAR), (4, PERSON))[n] for n in order], strict=True)
    boxes = wanted(labels, objects).boxes[0]
    assert boxes[3, 62, 47] == pytest.approx(np.log(4.6))
    assert boxes[3, 63, 47] == pytest.approx(np.log(0.6))


def test_an_object_at_the_edge_of_the_plan_stays_on_it():
    sure = wanted([2], [[51.9, -51.9, -1, 12, 2.5, 3, 0]]).sure[0]
    assert sure[2, 103, 0] == 1


def test_the_loss_falls_towards_what_was_wanted_and_not_with_what_nobody_asked():
    asked = wanted([0], [CAR])
    right = torch.cat([torch.logit(asked.sure.clamp(1e-4, 1 - 1e-4)), asked.boxes], 1)
    off = [float(loss(torch, right + shift, asked)) for shift in (0.0, 0.5, 3.0)]
    assert off[0] < 0.2 < off[1] < off[2]

    # Nobody asks a cell far from everything for a box.
    elsewhere = right.clone()
    elsewhere[:, 5:, 10, 10] = 9.0
    assert float(loss(torch, elsewhere, asked)) == pytest.approx(off[0])


def test_an_empty_street_asks_for_silence():
    asked = wanted(np.empty(0, np.int64), np.empty((0, 7)))
    quiet, loud = (torch.full((1, 15, 104, 104), logit) for logit in (-9.0, 0.0))
    assert float(loss(torch, quiet, asked)) < 1e-3 < float(loss(torch, loud, asked))
