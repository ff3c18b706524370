"""The training of the sets: its labels are true, it learns, and it makes the same bytes again."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

import care_sim
from care_sim.base.seeds import TRAINING
from care_sim.cli import main
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.grid import AngularGrid
from care_sim.envs.scenarios import DriveEnv
from care_sim.policies.learned.learned_sets import LEARNED_RETURNS, STEPS, SetNetwork
from care_sim.policies.learned.set_items import ITEM_INPUTS, STRIP_INPUTS, ItemReader, Items
from care_sim.policies.learned.weights import Card, load_weights, save_weights
from care_sim.training.supervised import sets, sets_data, worlds
from care_sim.training.supervised.sets_data import Example
from care_sim.training.supervised.worlds import World

torch = pytest.importorskip("torch")
PLACES = 13 * 32


def drawn(seed, count=200):
    """Keyframes whose items are found after 6 cells if they are camera boxes, never if not."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        items = int(rng.integers(0, 6))
        inputs = rng.random((items, len(ITEM_INPUTS))).astype(np.float32)
        inputs[:, 0] = inputs[:, 0].round()
        answers = np.where(inputs[:, 0] > 0, STEPS.index(6), len(STEPS)).astype(np.int8)
        strips = rng.random((8, len(STRIP_INPUTS))).astype(np.float32)
        places = rng.integers(0, PLACES, 8).astype(np.int16)
        found = (places < 40).astype(np.float32)
        yield Example(inputs, items, answers, places, strips, found, np.ones(8, np.float32))


@pytest.fixture(scope="module")
def learned():
    return sets.learn([*drawn(0)], PLACES, 0, 300)


def test_it_learns_what_there_is_to_learn(learned):
    untaught = sets.learn([*drawn(0)], PLACES, 0, 1)
    before, after = (sets.losses_of(one, [*drawn(1)]) for one in (untaught, learned))
    assert after["items"] < 0.1 < before["items"]
    assert after["strips"] < 0.5 * before["strips"]


def test_what_acts_is_what_has_learned(learned, tmp_path):
    """The loss by the chances of NumPy is that of PyTorch."""
    save_weights(tmp_path / "w.npz", learned, Card("learned-sets", AngularGrid()))
    network = SetNetwork(load_weights(tmp_path / "w.npz"), PLACES)
    one = next(example for example in drawn(5) if len(example.answers) == 5)
    items = Items(None, 0, one.inputs, one.strips)
    shares = np.diff(network.chances(items), prepend=0, append=1)
    told = -np.log(shares[np.arange(5), one.answers]).mean()
    chances = network.strip_chances(items, one.places)
    strips = -np.log(np.where(one.found > 0, chances, 1 - chances)).mean()
    losses = sets.losses_of(learned, [one])
    assert losses["items"] == pytest.approx(told, rel=1e-2)
    assert losses["strips"] == pytest.approx(strips, rel=1e-3)
    # In a batch a keyframe of fewer items is padded, and padding tells nobody anything.
    other = next(example for example in drawn(5) if len(example.answers) == 2)
    alone = [sets.losses_of(learned, [each])["items"] for each in (one, other)]
    assert sets.losses_of(learned, [one, other])["items"] == pytest.approx(
        np.average(alone, weights=[5, 2]), rel=1e-4
    )


@pytest.mark.parametrize("without", [["attention"], ["inputs"], ["attention", "inputs", "place"]])
def test_what_is_left_out_decides_nothing(without, tmp_path):
    """And what is not left out does: weights of the same form, which act in NumPy."""
    arrays = sets.learn([*drawn(0)], PLACES, 0, 60, without)
    save_weights(tmp_path / "w.npz", arrays, Card("learned-sets", AngularGrid()))
    network = SetNetwork(load_weights(tmp_path / "w.npz"), PLACES)
    rng = np.random.default_rng(4)
    inputs = rng.random((6, len(ITEM_INPUTS))).astype(np.float32)
    inputs[:, 0] = inputs[:, ITEM_INPUTS.index("explained")] = 1
    strips = rng.random((6, len(STRIP_INPUTS))).astype(np.float32)
    chances = network.chances(Items(None, 0, inputs, strips))
    others = inputs.copy()
    others[1:, 0] = 0
    among = network.chances(Items(None, 0, others, strips))
    of_strips = network.strip_chances(Items(None, 0, inputs, strips), np.arange(6))
    assert np.allclose(chances[0], among[0]) == ("attention" in without)
    assert (np.ptp(chances, axis=0) < 1e-6).all() == ("inputs" in without)
    assert (np.ptp(of_strips) < 1e-9) == ("place" in without)


def test_constants_are_the_shares_of_each_kind(tmp_path):
    """Without anything to tell items of a kind apart, what is learned are frequencies; and that of
    all strips, without their places.
    """
    # A strip with nothing stands for many, so that one in 250 finds something.
    examples = [
        replace(one, weights=np.where(one.found > 0, 1, 25).astype(np.float32)) for one in drawn(0)
    ]
    parts = ["attention", "inputs", "place"]
    constants = sets.learn(examples, PLACES, 0, 1500, parts)
    save_weights(tmp_path / "w.npz", constants, Card("learned-sets", AngularGrid()))
    network = SetNetwork(load_weights(tmp_path / "w.npz"), PLACES)
    for kind in (0, 1):
        inputs = np.zeros((1, len(ITEM_INPUTS)), np.float32)
        inputs[0, 0] = kind
        strips = np.zeros((1, len(STRIP_INPUTS)), np.float32)
        (chances,) = network.chances(Items(None, 0, inputs, strips))
        assert chances == pytest.approx(kind * (np.array(STEPS) >= 6), abs=0.05)
    found, weights = (
        np.concatenate([getattr(one, name) for one in examples]) for name in ("found", "weights")
    )
    share = np.average(found, weights=weights)
    assert 3 * sets.RARE < share < 5 * sets.RARE
    chances = network.strip_chances(Items(None, 0, inputs, strips), np.arange(PLACES))
    assert chances == pytest.approx(np.full(PLACES, share), rel=0.3)
    assert np.ptp(chances) == 0


def test_an_interrupt_keeps_what_the_first_round_has_taught(tmp_path, monkeypatch, capsys):
    asked = []

    def interrupted(worlds, own, *_):
        asked.append({*worlds})
        if own is not None:
            raise KeyboardInterrupt
        return [*drawn(0, 20)]

    monkeypatch.setattr(sets, "gathered", interrupted)
    with pytest.raises(SystemExit):
        main(["train", "learned-sets", "--out", str(tmp_path / "w.npz"), "--steps", "5"])
    # No world comes twice.
    assert min(world.seed for world in asked[0]) == TRAINING
    assert [len(worlds) for worlds in asked] == [82, 164]
    assert not asked[0] & asked[1]
    assert "w.npz holds what 1 of 2 rounds have taught" in capsys.readouterr().err
    card = load_weights(tmp_path / "w.npz").card
    assert "10 of street" in card.data
    assert "then" not in card.data
    assert not card.result


def test_without_faults_the_camera_has_none(monkeypatch):
    told = [worlds._conditions(np.random.default_rng(seed), False) for seed in range(50)]
    assert {name for one in told for name in one} == {"budget"}
    faulty = [worlds._conditions(np.random.default_rng(seed), True) for seed in range(50)]
    assert [one["budget"] for one in told] == [one["budget"] for one in faulty]
    asked = []
    monkeypatch.setattr(sets, "play", lambda *which: asked.append(which[-1]) or [])
    sets.gathered([World("drive", 10_000), World("drive", 10_001)], None, False)
    assert asked == [False, False]


def test_what_the_labels_say_comes_true():
    """In a drive under way an object returns three times once so many cells of its track are fired,
    and not before. Every object that is new in a box is one that no track has.
    """
    rng = np.random.default_rng(0)
    checked = new = 0
    with closing(DriveEnv(budget=0.1, keyframe_s=0.5, duration_s=10.0)) as env:
        policy = care_sim.make_policy("care-spread", env)
        observation, _ = env.reset(seed=10_001)
        reader = ItemReader(env.rig, STEPS[-1])
        for _ in range(12):
            items = reader.of(env.rig.read(observation))
            example = sets_data._example(env, reader, items, rng)
            behind = env.loop.bodies_behind_cells()
            tracked = env.loop.true_objects(env.loop.belief.tracks)
            present = [*env.loop.world.labels()]
            boxes = env.loop.sensor.boxes_to_local(env.loop.world.boxes_of(np.array(present)))
            near = {
                body for body, far in zip(present, planar_ranges(boxes), strict=True) if far <= 50
            }
            assert len(example.answers) == len(items.sets) == items.boxes + len(tracked)
            for row, answer in enumerate(example.answers.tolist()):
                low = STEPS[answer - 1] if answer else 0
                first, last = (items.sets[row][:end] for end in (low, (*STEPS, STEPS[-1])[answer]))
                if row >= items.boxes:
                    body = tracked[row - items.boxes]
                    is_found = answer < len(STEPS)
                    assert (
                        (behind[last] == body).sum() >= LEARNED_RETURNS and body in near
                    ) == is_found
                    assert (behind[first] == body).sum() < LEARNED_RETURNS or not is_found
                    checked += is_found
                elif answer < len(STEPS):
                    bodies, counts = np.unique(behind[last], return_counts=True)
                    often = {*bodies[counts >= LEARNED_RETURNS].tolist()} & near
                    assert often - {*tracked.tolist()}
                    new += 1
            observation, *_ = env.step(policy(observation))
    assert checked > 20
    assert new > 3


def test_a_strip_is_found_by_its_returns_and_an_object_once():
    numbers = np.full(16384, -1)
    reader = ItemReader(care_sim.Rig(), 48)
    numbers[reader.strips[10][:2]] = 0
    numbers[reader.strips[11][:5]] = 0
    numbers[reader.strips[20][:2]] = 1
    numbers[reader.strips[30]] = 2
    shares = sets_data._strip_shares(reader, numbers, np.array([True, True, False]))
    assert np.flatnonzero(shares).tolist() == [11, 20]
    assert shares[[11, 20]].tolist() == [1, 2 / 3]


def trained(path, monkeypatch, *options):
    monkeypatch.setattr(sets, "gathered", lambda worlds, *_: [*drawn(worlds[0].seed, 20)])
    with pytest.raises(SystemExit) as end:
        main(["train", "learned-sets", "--out", str(path), *options])
    return end.value.code


def test_the_command_writes_the_same_file_again_with_its_card(tmp_path, monkeypatch, capsys):
    for name in ("one.npz", "two.npz"):
        assert trained(tmp_path / "new" / name, monkeypatch, "--steps", "5", "--seed", "3") == 0
    one, two = (tmp_path / "new" / name for name in ("one.npz", "two.npz"))
    assert one.read_bytes() == two.read_bytes()
    card = load_weights(one).card
    assert (card.kind, card.steps, card.seeds["training"]) == ("learned-sets", 5, 3)
    assert len(card.result) == 4
    assert f"{one}: loss per items, learned" in capsys.readouterr().out
