"""The learned scorer: what it learns from, on streets of no list, and that it learns."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from care_sim.base.seeds import TRAINING, VALIDATION
from care_sim.cli import main
from care_sim.envs.open_loop import FilmEnv
from care_sim.envs.scenarios import DriveEnv
from care_sim.policies import make_policy
from care_sim.policies.learned.cell_inputs import RIG_INPUTS, SCAN_INPUTS, CellInputs
from care_sim.policies.learned.weights import load_weights
from care_sim.sources.street_films import street_film
from care_sim.streets.street import CALIBRATION_SEEDS, EVALUATION_SEEDS
from care_sim.training.supervised import scorer, worlds
from care_sim.training.supervised.scorer import (
    OTHER_CELLS,
    STREETS,
    Examples,
    balanced,
    drawn_examples,
    untracked_cells,
)
from care_sim.training.supervised.worlds import World, front_alone


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
    assert set(STREETS["held out"]).isdisjoint({*EVALUATION_SEEDS, *CALIBRATION_SEEDS})


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

    env = FilmEnv(replace(film, shots=tuple(map(faint, film.shots[:1]))), budget=0.1)
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
    keyframe before. Somebody who was hidden since may have lost his track.
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
    once, again, other = (
        [*drawn_examples(World("ncap", seed))] for seed in (10_002, 10_002, 10_003)
    )
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


torch = pytest.importorskip("torch")
INPUTS = SCAN_INPUTS + len(RIG_INPUTS)


def drawn(seed, count=3000):
    """Examples that are positive, mostly, where the first input is 1."""
    rng = np.random.default_rng(seed)
    inputs = rng.random((count, INPUTS)).astype(np.float32).round()
    positive = (inputs[:, 0] > 0) != (rng.random(count) < 0.1)
    return Examples(inputs, positive, np.ones(count, np.float32))


def lessons():
    return {"learned": drawn(0), "held out": drawn(1)}


def test_it_learns_what_there_is_to_learn():
    """One label in ten is wrong: the loss cannot fall below 0.325, the entropy of that."""
    arrays, losses = scorer.train_scorer(lessons(), 0, 300)
    assert {name: array.shape for name, array in arrays.items()} == {
        "layer": (INPUTS, scorer.HIDDEN_UNITS),
        "bias": (scorer.HIDDEN_UNITS,),
        "out": (scorer.HIDDEN_UNITS,),
    }
    assert losses["held out"] == pytest.approx(0.325, abs=0.06)
    inputs = np.zeros((2, INPUTS), np.float32)
    inputs[1, 0] = 1
    less, more = np.maximum(inputs @ arrays["layer"] + arrays["bias"], 0) @ arrays["out"]
    assert more > less + 1


def test_a_pass_leaves_out_what_fills_no_batch(monkeypatch):
    monkeypatch.setattr(scorer, "BATCH", 4)
    drawing = scorer._batches(np.random.default_rng(0), 10)
    batches = [next(drawing).tolist() for _ in range(5)]
    assert [len(rows) for rows in batches] == [4] * 5
    assert all(len(set(batches[n] + batches[n + 1])) == 8 for n in (0, 2))
    assert batches[2] + batches[3] != batches[0] + batches[1]


def test_training_does_not_depend_on_the_threads_and_gives_them_back():
    before = torch.get_num_threads()
    made = []
    for threads in (1, 2):
        torch.set_num_threads(threads)
        made.append(scorer.train_scorer(lessons(), 0, 20)[0])
        assert torch.get_num_threads() == threads
    torch.set_num_threads(before)
    for name, array in made[0].items():
        assert np.array_equal(array, made[1][name])
    other, _ = scorer.train_scorer(lessons(), 1, 20)
    assert not np.array_equal(made[0]["layer"], other["layer"])


def trained(path, monkeypatch, *options):
    monkeypatch.setattr(scorer, "STREETS", {"calibration": (2000,), "held out": (2001,)})
    monkeypatch.setattr(scorer, "examples", lambda world: [drawn(world.seed)])
    with pytest.raises(SystemExit) as end:
        main(["train", "learned-scorer", "--out", str(path), *options])
    return end.value.code


def test_the_command_writes_the_same_file_again_with_its_card(tmp_path, monkeypatch, capsys):
    for name in ("one.npz", "two.npz"):
        assert trained(tmp_path / "new" / name, monkeypatch, "--steps", "20", "--seed", "3") == 0
    one, two = (tmp_path / "new" / name for name in ("one.npz", "two.npz"))
    assert one.read_bytes() == two.read_bytes()
    card = load_weights(one).card
    assert (card.kind, card.steps, card.seeds["training"]) == ("learned-scorer", 20, 3)
    assert card.versions["torch"] == torch.__version__
    assert set(card.result) == {"loss calibration", "loss held out"}
    first, last = capsys.readouterr().out.splitlines()[:2]
    assert first.startswith(f"{one}: loss calibration")
    assert last == f"play it: care-sim run {one}"


def test_worlds_that_differ_give_weights_that_play_and_a_card_that_says_so(tmp_path, monkeypatch):
    """Real tests of Euro NCAP, two to learn from and one held out."""
    played = []

    def watched(world):
        played.append((world.kind, world.seed))
        return drawn_examples(world)

    counts = {"learned": (TRAINING, {"ncap": 2}), "held out": (VALIDATION, {"ncap": 1})}
    monkeypatch.setattr(scorer, "DRAWN", counts)
    monkeypatch.setattr(scorer, "drawn_examples", watched)
    path = tmp_path / "w.npz"
    assert trained(path, monkeypatch, "--drawn", "--steps", "20") == 0
    assert played == [("ncap", TRAINING), ("ncap", TRAINING + 1), ("ncap", VALIDATION)]
    card = load_weights(path).card
    assert card.scenario == "CARE-Drive-v0, CARE-NCAP-v0 and CARE-Street-v0"
    assert "worlds 2 of ncap under history at 0.005 to 0.2 of the cells" in card.data
    assert card.seeds == {
        "learned": [TRAINING, TRAINING + 1],
        "held out": [VALIDATION, VALIDATION],
        "training": 0,
    }
    assert set(card.result) == {"loss learned", "loss held out"}
    with closing(DriveEnv(budget=0.03)) as env:
        observation, _ = env.reset(seed=VALIDATION)
        own, usual = (
            make_policy("learned-scorer", env, **told)(observation) for told in ({"path": path}, {})
        )
    assert not np.array_equal(own, usual)
