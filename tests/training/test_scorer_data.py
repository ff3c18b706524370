"""What the learned scorer learns from, on a street that belongs to no list."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from care_sim.envs.open_loop import FilmEnv
from care_sim.envs.scenarios import DriveEnv
from care_sim.policies.learned.cell_inputs import RIG_INPUTS, SCAN_INPUTS, CellInputs
from care_sim.sources.street_films import street_film
from care_sim.streets.street import CALIBRATION_SEEDS, EVALUATION_SEEDS
from care_sim.training.supervised import worlds
from care_sim.training.supervised.scorer import (
    HELD_OUT,
    OTHER_CELLS,
    SCORER_BUDGETS,
    Examples,
    balanced,
    drawn_examples,
    examples,
    untracked_cells,
)
from care_sim.training.supervised.worlds import front_alone


@pytest.fixture(scope="module")
def film():
    return street_film(2000)


def of_objects(shot, cells):
    """How many of the cells lie on each annotated object within 50 m."""
    in_range = np.hypot(shot.annotations.boxes[:, 0], shot.annotations.boxes[:, 1]) <= 50
    return {
        number: len(np.intersect1d(shot.cloud.cells[shot.cloud.objects == number], cells))
        for number in shot.annotations.objects[in_range].tolist()
    }


def test_nobody_learns_from_the_streets_of_the_evaluation():
    assert set(HELD_OUT).isdisjoint({*EVALUATION_SEEDS, *CALIBRATION_SEEDS})


def test_before_the_first_scan_every_object_is_untracked_and_weighs_1(film):
    env = FilmEnv(film, budget=0.1)
    env.reset(seed=0)
    cells, shares = untracked_cells(env.loop)
    everywhere = of_objects(env.loop.shot, np.arange(env.rig.grid.size))
    expected = {number: count for number, count in everywhere.items() if count >= 3}
    assert {n: c for n, c in of_objects(env.loop.shot, cells).items() if c} == expected
    assert len(cells) == sum(expected.values())
    assert shares.sum() == pytest.approx(len(expected))


def test_returns_that_one_shot_does_not_show_are_no_examples(film):
    def faint(shot):
        return replace(shot, cloud=replace(shot.cloud, shots=np.full(len(shot.cloud), 2.0)))

    env = FilmEnv(replace(film, shots=tuple(map(faint, film.shots))), budget=0.1)
    env.reset(seed=0)
    assert not len(untracked_cells(env.loop)[0])


def test_what_a_full_scan_found_is_tracked_and_only_what_is_new_is_not(film):
    env = FilmEnv(film, budget=1.0)
    env.reset(seed=0)
    news = 0
    for _ in range(6):
        found = {
            n
            for n, count in of_objects(env.loop.shot, np.arange(env.rig.grid.size)).items()
            if count >= 3
        }
        env.step(np.ones(env.rig.grid.shape, np.float32))
        cells, _ = untracked_cells(env.loop)
        new = {number for number, count in of_objects(env.loop.shot, cells).items() if count}
        assert not new & found
        news += len(new)
    assert news


def test_a_front_alone_sees_what_the_first_camera_saw(film):
    front = front_alone(film)
    assert front.cameras == film.cameras[:1]
    for shown, shot in zip(front.shots, film.shots, strict=True):
        first = shot.seen.detections.cameras == 0
        assert not shown.seen.detections.cameras.any()
        assert np.array_equal(shown.seen.detections.boxes, shot.seen.detections.boxes[first])
        assert np.array_equal(shown.seen.objects, shot.seen.objects[first])
    assert sum(len(shot.seen.objects) for shot in front.shots) > 0


def test_positive_and_other_examples_weigh_the_same_and_1_on_average():
    inputs, positive = np.zeros((4, 2), np.float32), np.array([True, False, False, False])
    made = Examples(inputs, positive, np.array([0.2, 1, 1, 2], np.float32))
    weights = balanced([made, made]).weights
    assert weights == pytest.approx([2, 0.5, 0.5, 1] * 2)


def test_in_a_drive_what_is_new_is_positive_until_it_has_a_track():
    """Everybody who shows in enough cells for the first time; nobody whom a full scan found at the
    keyframe before. Who was hidden since may have lost his track.
    """
    with closing(DriveEnv(budget=1.0, keyframe_s=0.5)) as env:
        env.reset(seed=10_001)
        found, last, news = set(), set(), 0
        for number in range(24):
            bodies = np.array([*env.loop.world.labels()])
            boxes = env.loop.sensor.boxes_to_local(env.loop.world.boxes_of(bodies))
            near = {*bodies[np.hypot(boxes[:, 0], boxes[:, 1]) <= 50].tolist()}
            behind = env.loop.bodies_behind_cells()
            shown = {body for body in bodies.tolist() if (behind == body).sum() >= 3}
            cells, shares = untracked_cells(env.loop)
            new = {*behind[cells].tolist()}
            assert (shown & near) - found <= new <= (shown & near) - last
            assert len(cells) == sum((behind == body).sum() for body in new)
            assert shares.sum() == pytest.approx(len(new))
            news += number > 0 and len(new)
            last = shown
            found |= shown
            env.step(np.ones(env.rig.grid.shape, np.float32))
    assert news


def test_a_drawn_play_gives_the_same_examples_again_at_its_own_budget(monkeypatch):
    told = []

    def watched(rng, faulty):
        told.append(conditions(rng, faulty))
        return told[-1]

    conditions = worlds._conditions
    monkeypatch.setattr(worlds, "_conditions", watched)
    once, again, other = ([*drawn_examples("ncap", seed)] for seed in (10_002, 10_002, 10_003))
    assert once
    for one, same in zip(once, again, strict=True):
        assert np.array_equal(one.inputs, same.inputs)
        assert np.array_equal(one.weights, same.weights)
    assert told[0] == told[1] != told[2]
    assert all(0.005 <= each["budget"] <= 0.2 for each in told)
    for one in (*once, *other):
        assert one.inputs.shape == (len(one), SCAN_INPUTS + len(RIG_INPUTS))
        assert OTHER_CELLS * 0.9 < (~one.positive).sum() <= OTHER_CELLS


def test_what_a_rig_tells_of_a_cell_does_not_tell_left_from_right():
    """So no side has to be mirrored; but for two cells at the edge of a picture."""
    for env in (DriveEnv(), FilmEnv(street_film(2000))):
        inputs = CellInputs(env.rig).rig_inputs.reshape(*env.rig.grid.shape, -1)
        differ = np.abs(inputs - inputs[:, ::-1]).max(axis=-1) > 1e-6
        assert differ.sum() <= 2
        env.close()


@pytest.mark.slow
def test_a_street_gives_the_same_examples_again():
    once, again = ([*examples([2000])] for _ in range(2))
    assert len(once) == 2 * len(SCORER_BUDGETS)
    for one, other in zip(once, again, strict=True):
        assert one.inputs.shape == (len(one), SCAN_INPUTS + len(RIG_INPUTS))
        assert np.array_equal(one.inputs, other.inputs)
        assert np.array_equal(one.weights, other.weights)
        assert 39 * OTHER_CELLS < (~one.positive).sum() <= 40 * OTHER_CELLS
        assert one.positive.any()
