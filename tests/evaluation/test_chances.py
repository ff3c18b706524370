"""Chances of newcomers by hand-made films: how often they are detected, seed after seed."""

from dataclasses import replace

import numpy as np
import pytest

from care_sim.core.types import CLASSES
from care_sim.envs.open_loop import FilmEnv
from care_sim.evaluation.chances import Chances
from care_sim.evaluation.counts import KEPT, expected_columns, scene_counts
from care_sim.evaluation.strata import EMERGING, ENTERING
from care_sim.loops.film import Sweep
from tests.helpers.handmade_film import FIRST_KEYFRAMES, handmade_film, returns_of

SEEDS = 200
FIRED = 4
"""Cells that fire at every object: few enough that nobody is sure to be detected."""
CASES = {
    "centerpoint": ("centerpoint", {}, 0.5),
    "sweeps of the coming mask": ("megvii", {"first_hit": 1.0}, 0.5),
    "surer and worth less": ("centerpoint", {"track_score": 0.3, "worth": 0.7}, 0.5),
    "short keyframes": ("centerpoint", {}, 0.1),
    "one sweep, some classes": ("pointrcnn", {}, 0.5),
}


def action_at(index, seed):
    """A few cells of every object that is there, other ones for every seed."""
    action = np.zeros(16384, np.float32)
    rng = np.random.default_rng([seed, index])
    for number, first in FIRST_KEYFRAMES.items():
        if first <= index:
            action[rng.permutation(returns_of(number, index))[:FIRED]] = 1.0
    return action.reshape(32, 512)


def played(env, detector, parameters, seed):
    """Whether each newcomer was detected in its first keyframe, and the chances."""
    env.reset(seed=seed)
    chances = Chances.of(detector, parameters, env.rig)
    while not env.loop.over:
        env.step(action_at(env.loop.index, seed))
        chances.note(env.loop)
    score = env.score
    return score.found[score.sightings.events], chances.of_events(score.sightings)


@pytest.mark.parametrize(("detector", "parameters", "keyframe_s"), CASES.values(), ids=CASES)
def test_newcomers_are_detected_as_often_as_their_chances_say(detector, parameters, keyframe_s):
    assert_as_often(replace(handmade_film(), keyframe_s=keyframe_s), detector, parameters)


def test_returns_of_gathered_sweeps_count_as_their_mean():
    """Half of the sweeps show nobody, which halves the returns per sweep."""
    film = handmade_film()
    shots = []
    for shot in film.shots:
        empty = shot.cloud.take(np.zeros(len(shot.cloud), bool))
        sweeps = tuple(
            Sweep(shot.time_s - ago, shot.sensor, cloud)
            for ago, cloud in ((0.3, empty), (0.2, shot.cloud), (0.1, empty))
        )
        shots.append(replace(shot, sweeps=sweeps))
    film = replace(film, shots=tuple(shots))
    assert_as_often(film, "centerpoint", {}, sweep_mask="coming")


def assert_as_often(film, detector, parameters, **conditions):
    given = parameters | {"false_boxes": False}
    known = {"detector": detector, "detector_parameters": given, "floor": False}
    with FilmEnv(film, **known, **conditions) as env:
        draws, chances = zip(
            *(played(env, detector, given, seed) for seed in range(SEEDS)), strict=True
        )
    draws, chances = np.array(draws), np.array(chances)
    expected = chances.mean(axis=0)
    error = np.sqrt((chances * (1 - chances)).sum(axis=0)) / SEEDS
    assert draws.shape == (SEEDS, 4)
    assert (np.abs(draws.mean(axis=0) - expected) <= 4 * error + 1e-12).all()
    # Some are neither never nor always detected, so that the test can fail.
    assert ((expected > 0.1) & (expected < 0.9)).any()


def test_the_graded_proxy_detects_where_its_luck_is_below_the_chance():
    """Luck follows from the place, so that all seeds have one, and more cells never lose."""
    with FilmEnv(handmade_film(), detector="graded", floor=False) as env:
        found, chances = played(env, "graded", {}, 0)
    assert found[chances == 1].all()
    assert not found[chances == 0].any()


def test_chances_follow_the_curve_of_a_file(tmp_path):
    """Four cells of every object return."""
    path = tmp_path / "recall.csv"
    path.write_text("class,returns,recall\npedestrian,1,0.5\npedestrian,16,0.7\nbus,5,1\ncar,4,1\n")
    given = {"file": str(path)}
    with FilmEnv(handmade_film(), detector="graded", detector_parameters=given, floor=False) as env:
        found, chances = played(env, "graded", given, 0)
        events = env.score.sightings
    labels = events.frames.classes[events.events]
    expected = {"pedestrian": 0.6, "bus": 0.0, "car": 1.0}
    assert chances.tolist() == pytest.approx([expected[CLASSES[label]] for label in labels])
    assert found[chances == 1].all()
    assert not found[chances == 0].any()


@pytest.mark.parametrize("detector", ["returns", "cluster", "pillars"])
def test_other_detectors_have_no_chances(detector):
    with FilmEnv(handmade_film()) as env:
        assert Chances.of(detector, {}, env.rig) is None


def test_expected_counts_are_sums_over_the_kinds_of_newcomers():
    """The bus, one of four newcomers, comes from beyond the range; the other three emerge."""
    with FilmEnv(handmade_film(), floor=False) as env:
        env.reset(seed=0)
        while not env.loop.over:
            env.step(action_at(env.loop.index, 0))
        sightings = env.score.sightings
    # Events are in the order of the film: the walker, the bus and the cars as they are annotated.
    numbers = sightings.frames.objects[sightings.events]
    chances = {9: 0.5, 11: 0.25, 13: 0.125, 15: 0.0625}
    columns = expected_columns(sightings, np.array([chances[n] for n in numbers.tolist()]))
    assert columns == {f"expected/{EMERGING}": 0.875, f"expected/{ENTERING}": 0.0625}


DRAWN = {
    "found": 30.0,
    "class/bicycle/found": 3.0,
    "class/pedestrian/found": 4.0,
    "class/car/found": 23.0,
    "entry/emergence/sighted": 2.0,
    "entry/ring/sighted": 5.0,
    "entry/beyond/sighted": 6.0,
    "entry/at start/sighted": 0.0,
}


def test_counts_of_a_row_are_draws_unless_it_has_expectations():
    drawn = {EMERGING: 2.0, ENTERING: 11.0, KEPT: 30.0, "people kept": 7.0}
    assert scene_counts(DRAWN) == drawn
    assert scene_counts(DRAWN | {f"expected/{EMERGING}": None}) == drawn
    more = DRAWN | {f"expected/{EMERGING}": 2.5, f"expected/{ENTERING}": 10.25}
    assert scene_counts(more) == drawn | {EMERGING: 2.5, ENTERING: 10.25}
