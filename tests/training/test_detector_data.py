"""What the learned detector learns from: scans with the truth of their time."""

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
from care_sim.training.supervised.detector_data import OTHER_SETUPS, POLICIES, play, scanned

DRIVE = 10_003


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
    assert set(OTHER_SETUPS) < set(setup_names())
