"""The training of the learned detector: it learns, and makes the same bytes again."""

from concurrent.futures import ThreadPoolExecutor
from itertools import count, repeat

import numpy as np
import pytest

from care_sim.cli import main
from care_sim.perception.pillars.detector import PillarsDetector, load_detector
from care_sim.perception.pillars.network import REACH_M, Fixed, answers, on_plan, place_planes
from care_sim.training.supervised import detector
from care_sim.training.supervised.detector import PLAIN, Judged, Peaks, calibration_of, right
from care_sim.training.supervised.detector_data import Example, targets_of, turned_example
from care_sim.training.supervised.worlds import World
from tests.helpers.made_points import HEIGHT, road, shell

torch = pytest.importorskip("torch")
from care_sim.training.supervised.detector_network import Learning  # noqa: E402 (it needs PyTorch)


def street(seed):
    """Two cars on a road."""
    rng = np.random.default_rng(seed)
    places = [
        (side * rng.uniform(6, 20), rng.uniform(-9, 9), rng.uniform(-3, 3)) for side in (1, -1)
    ]
    bodies = [shell(x, y, yaw, 4.6, 1.9, 1.7) for x, y, yaw in places]
    points = np.concatenate([road(reach=24), *bodies]).astype(np.float32)
    boxes = np.array([[x, y, 0.85 - HEIGHT, 4.6, 1.9, 1.7, yaw] for x, y, yaw in places])
    return [Example(points, HEIGHT, np.array([0, 0]), boxes, full=seed % 2 == 0)]


def test_it_learns_where_a_car_stands():
    with detector.one_thread(torch):
        torch.manual_seed(0)
        network = Learning()
        assert len(detector.train_detector(network, repeat(street(0)), 25)) == 25
    network.eval()
    (judged,) = detector.scores_by_scan(network, street(0))
    surest = judged.peaks.take(np.arange(2))
    assert surest.classes.tolist() == [0, 0]
    assert judged.right[:2].all()


def test_what_was_learned_acts_alike_once_it_is_fixed():
    network = Learning()
    network.train()
    for seed in range(2):
        network(street(seed))
    network.eval()
    seen = on_plan(street(5)[0].points.astype(float), HEIGHT)
    fixed = answers(
        torch,
        Fixed(torch, network.arrays()),
        torch.from_numpy(seen.inputs),
        torch.from_numpy(seen.pillars),
        place_planes(torch),
    )
    with torch.no_grad():
        assert torch.allclose(network(street(5)), fixed, atol=1e-3)


def test_learning_goes_on_where_weights_ended():
    """Layers that are normalised anew over some scans answer them as the weights do."""
    arrays, _ = load_detector()
    network, scans = Learning(), [street(seed)[0] for seed in range(3)]
    network.begin_at(arrays, scans)
    network.eval()
    for one in scans:
        with torch.no_grad():
            answer = network([one])[0].numpy()
        wanted = PillarsDetector().answer(one.points.astype(float), HEIGHT)
        assert np.abs(answer - wanted).max() < 0.02
        assert np.abs(wanted).max() > 5
    # Shells on a bare road are unlike streets, and still it begins far ahead of drawn weights.
    first, drawn = (
        detector.train_detector(start, repeat(scans), 1)[0] for start in (network, Learning())
    )
    assert first < drawn / 2


def played_street(world):
    return street(world.seed)


def trained(path, monkeypatch, *options, play=played_street):
    monkeypatch.setattr(detector, "processes", ThreadPoolExecutor)
    monkeypatch.setattr(detector, "play", play)
    monkeypatch.setattr(detector, "SHUFFLED", 6)
    monkeypatch.setattr(detector, "CALIBRATING", range(2))
    monkeypatch.setattr(detector, "HELD_OUT", range(2, 4))
    with pytest.raises(SystemExit) as end:
        main(["train", "detector", "--out", str(path), *options])
    return end.value.code


def test_the_command_writes_the_same_file_again_with_its_card(tmp_path, monkeypatch, capsys):
    one, two, other = (tmp_path / "new" / name for name in ("one.npz", "two.npz", "three.npz"))
    for path, seed in ((one, "3"), (two, "3"), (other, "4")):
        assert trained(path, monkeypatch, "--steps", "2", "--seed", seed) == 0
    assert one.read_bytes() == two.read_bytes() != other.read_bytes()
    _, card = load_detector(one)
    assert (card["kind"], card["steps"], card["seeds"]["training"]) == ("pillars", 2, 3)
    assert len(card["curve"]) == 1
    assert f"{one}: recall, all scans" in capsys.readouterr().out
    PillarsDetector(one).detect(road(), HEIGHT)


def test_an_interrupt_leaves_what_was_learned_until_then(tmp_path, monkeypatch, capsys):
    steps = iter(range(5))

    def interrupted(torch, answer, wanted):
        if next(steps) == 4:
            raise KeyboardInterrupt
        return (answer**2).mean()

    monkeypatch.setattr(detector, "loss", interrupted)
    monkeypatch.setattr(detector, "CURVE_STEPS", 2)
    assert trained(tmp_path / "w.npz", monkeypatch, "--steps", "9") == 130
    _, card = load_detector(tmp_path / "w.npz")
    assert (card["steps"], card["steps asked for"], len(card["curve"])) == (4, 9, 2)
    assert card["result"] == "not checked, scores not calibrated"
    assert "interrupted" in capsys.readouterr().err


def test_a_training_that_diverges_writes_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(detector, "loss", lambda torch, answer, wanted: answer.sum() * float("nan"))
    assert trained(tmp_path / "w.npz", monkeypatch, "--steps", "2") == 2
    assert not (tmp_path / "w.npz").exists()
    assert "the training diverged: the loss of step 1 is nan" in capsys.readouterr().err


@pytest.mark.parametrize("steps", [1, 2, 19, 20, 21, 41])
def test_any_number_of_steps_has_a_rate_of_learning(monkeypatch, steps):
    class One(torch.nn.Module):
        def __init__(self):
            super().__init__()
            self.number = torch.nn.Parameter(torch.ones(1))

        def forward(self, examples):
            return self.number

    monkeypatch.setattr(detector, "targets_of", lambda batch: [np.zeros(1)] * 3)
    monkeypatch.setattr(detector, "loss", lambda torch, answer, wanted: answer.sum())
    assert len(detector.train_detector(One(), repeat(street(0)), steps)) == steps


def test_plays_come_in_order_whatever_they_take(monkeypatch):
    monkeypatch.setattr(detector, "play", played_street)
    with ThreadPoolExecutor(3) as executor:
        examples = detector.played(executor, (World("any", seed) for seed in count(7)))
        taken = [next(examples) for _ in range(9)]
    for one, seed in zip(taken, range(7, 16), strict=True):
        assert np.array_equal(one.boxes, street(seed)[0].boxes)


def test_a_scan_turns_with_what_stands_in_it():
    rng = np.random.default_rng(0)
    for _ in range(6):
        (before,) = street(3)
        after = turned_example(before, rng)
        for old, new in zip(before.boxes, after.boxes, strict=True):
            corner = 2.3 * np.array([np.cos(new[6]), np.sin(new[6])])
            near = np.hypot(*(after.points[:, :2] - new[:2] - corner).T).min()
            was = 2.3 * np.array([np.cos(old[6]), np.sin(old[6])])
            assert near == pytest.approx(
                np.hypot(*(before.points[:, :2] - old[:2] - was).T).min(), abs=1e-4
            )


def test_what_a_turn_takes_off_the_plan_is_no_object_any_more():
    corner = np.array([[50.0, -50.0, -1, 4.6, 1.9, 1.7, 0.0], [-50.0, 20.0, -1, 4.6, 1.9, 1.7, 0]])
    before = Example(np.empty((0, 3), np.float32), HEIGHT, np.array([0, 1]), corner)
    rng = np.random.default_rng(0)
    turns = [turned_example(before, rng) for _ in range(20)]
    assert {len(after.classes) for after in turns} == {0, 1, 2}
    for after in turns:
        assert np.abs(after.boxes[:, :2]).max(initial=0) < REACH_M
        # One cell for each, none for what is gone.
        assert (targets_of([after]).sure == 1).sum() == len(after.classes) == len(after.boxes)


def peaks(logits, places):
    boxes = np.array([[x, 0, -1, 4.6, 1.9, 1.7, 0] for x in places], float)
    logits = np.array(logits, float)
    return Peaks(np.zeros(len(logits), np.int64), logits, 1 / (1 + np.exp(-logits)), boxes)


def test_an_object_is_served_once_by_the_surest_near_it():
    boxes = np.array([[10.0, 0, -1, 4.6, 1.9, 1.7, 0], [20.0, 0, -1, 4.6, 1.9, 1.7, 0]])
    example = Example(np.empty((0, 3)), HEIGHT, np.array([0, 4]), boxes)
    assert right(peaks([3, 2, 1], [11.5, 10, 20]), example).tolist() == [True, False, False]


def test_scores_become_the_share_that_is_right():
    rng = np.random.default_rng(0)
    logits = rng.normal(0, 2, 4000)
    hits = rng.random(4000) < 1 / (1 + np.exp(-(0.5 * logits - 1)))
    fitted = calibration_of([Judged(peaks(logits, np.zeros(4000)), hits, 4000, True)])
    assert fitted[0] == pytest.approx([0.5, -1], abs=0.15)
    assert np.array_equal(fitted[1:], PLAIN[1:])
