"""The training of the learned scorer: it learns, and makes the same bytes again."""

from contextlib import closing

import numpy as np
import pytest

from care_sim.base.seeds import TRAINING, VALIDATION
from care_sim.cli import main
from care_sim.envs.scenarios import DriveEnv
from care_sim.policies import make_policy
from care_sim.policies.learned.cell_inputs import RIG_INPUTS, SCAN_INPUTS
from care_sim.policies.learned.weights import load_weights
from care_sim.training.supervised import scorer
from care_sim.training.supervised.scorer import Examples, drawn_examples

torch = pytest.importorskip("torch")
INPUTS = SCAN_INPUTS + len(RIG_INPUTS)


def drawn(seed, count=3000):
    """Examples that are positive, mostly, where the first input is 1."""
    rng = np.random.default_rng(seed)
    inputs = rng.random((count, INPUTS)).astype(np.float32).round()
    positive = (inputs[:, 0] > 0) != (rng.random(count) < 0.1)
    return Examples(inputs, positive, np.ones(count, np.float32))


def examples():
    return {"learned": drawn(0), "held out": drawn(1)}


def test_it_learns_what_there_is_to_learn():
    """One label in ten is wrong: the loss cannot fall below 0.325, the entropy of that."""
    arrays, losses = scorer.train_scorer(examples(), 0, 300)
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
    batches = [rows.tolist() for rows in scorer._batches(np.random.default_rng(0), 10, 5)]
    assert [len(rows) for rows in batches] == [4] * 5
    assert all(len(set(batches[n] + batches[n + 1])) == 8 for n in (0, 2))
    assert batches[2] + batches[3] != batches[0] + batches[1]


def test_training_does_not_depend_on_the_threads_and_gives_them_back():
    before = torch.get_num_threads()
    made = []
    for threads in (1, 2):
        torch.set_num_threads(threads)
        made.append(scorer.train_scorer(examples(), 0, 20)[0])
        assert torch.get_num_threads() == threads
    torch.set_num_threads(before)
    for name, array in made[0].items():
        assert np.array_equal(array, made[1][name])
    other, _ = scorer.train_scorer(examples(), 1, 20)
    assert not np.array_equal(made[0]["layer"], other["layer"])


def trained(path, monkeypatch, *options):
    monkeypatch.setattr(scorer, "_STREETS", {"calibration": (2000,), "held out": (2001,)})
    monkeypatch.setattr(scorer, "examples", lambda seeds: [drawn(seed) for seed in seeds])
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
    assert f"{one}: loss calibration" in capsys.readouterr().out


def test_worlds_that_differ_give_weights_that_play_and_a_card_that_says_so(tmp_path, monkeypatch):
    """Real tests of Euro NCAP, two to learn from and one held out."""
    played = []

    def watched(kind, seed):
        played.append((kind, seed))
        return drawn_examples(kind, seed)

    monkeypatch.setattr(scorer, "DRAWN", {"ncap": 2})
    monkeypatch.setattr(scorer, "DRAWN_HELD_OUT", {"ncap": 1})
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


@pytest.mark.parametrize(
    ("options", "message"),
    [(("--steps", "0"), "steps must be a whole number >= 1, got 0"), (("--sead", "0"), "--sead")],
)
def test_bad_options_are_refused_in_one_line(tmp_path, monkeypatch, capsys, options, message):
    assert trained(tmp_path / "w.npz", monkeypatch, *options) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.startswith("care-sim: ")
    assert error.count("\n") == 1
