"""A study of hyperparameters: its trials, how it goes on, what it writes and what it refuses."""

import csv
import math
import sys
from dataclasses import replace

import pytest

from care_sim.base.errors import InvalidInput, MissingExtra
from care_sim.base.seed_ranges import VALIDATION
from care_sim.cli import main
from care_sim.training.config import PpoConfig, SacConfig
from care_sim.training.episodes import LEARNER, EpisodeRow, Played, read_episodes, write_episodes
from care_sim.training.folder import CONFIG, CURVE, CURVE_COLUMNS, Folder
from care_sim.training.hyperparameters import names_of, read_hyperparameters
from care_sim.training.tuning import BEST, SPACES, TRIALS, spaces_of, tune

STEPS = (0, 50, 100)
BEST_RATE = 2e-3


class Learner:
    """Learns the better the nearer its step size is to the best one, and keeps a folder as runs do.

    At evaluation number `breaks` of all it is interrupted.
    """

    def __init__(self, breaks=None):
        self.breaks = breaks
        self.evaluations = 0
        self.trained = []

    def __call__(self, config, evaluated):
        """Train a configuration."""
        self.trained.append(config)
        config.out.mkdir(parents=True, exist_ok=True)
        assert (config.out / CONFIG).exists() == config.resume
        (config.out / CONFIG).write_text(config.to_json())
        curve, rows = config.out / CURVE, []
        if curve.exists():
            with curve.open(newline="") as file:
                rows = list(csv.reader(file))[1:]
        far = abs(math.log(config.learning_rate / BEST_RATE))
        for number in range(len(rows), len(STEPS)):
            value = -10.0 if number == 0 else -far - (0.5 if number == 2 else 0)
            rows.append([STEPS[number], number, value, ""])
            with curve.open("w", newline="") as file:
                csv.writer(file).writerows([CURVE_COLUMNS, *rows])
            self.evaluations += 1
            if self.evaluations == self.breaks:
                raise KeyboardInterrupt
            evaluated(value)


@pytest.fixture
def config(tmp_path):
    pytest.importorskip("optuna")
    return PpoConfig(out=tmp_path / "study", steps=STEPS[-1], env="CARE-CutIn-v0", hidden=4)


def tried(learner):
    """What was tried in every trial, by the name of its folder."""
    return {
        one.out.name: {name: getattr(one, name) for name in spaces_of(one)}
        for one in learner.trained
    }


def test_trials_begin_with_what_is_given_and_the_best_is_written(config):
    learner = Learner()
    path = tune(config, 9, learner)
    trials = tried(learner)
    assert [*trials] == [f"{number:03d}" for number in range(9)]
    assert trials["000"] == {name: getattr(config, name) for name in SPACES}
    assert len({tuple(values.values()) for values in trials.values()}) == 9
    # All else, the seed too, is as asked.
    assert {(one.seed, one.hidden, one.env) for one in learner.trained} == {
        (0, 4, ("CARE-CutIn-v0",))
    }
    # A curve counts by its best evaluation, which is the last but one.
    returns = {
        name: -abs(math.log(values["learning_rate"] / BEST_RATE))
        for name, values in trials.items()
        if len((config.out / TRIALS / name / CURVE).read_text().splitlines()) == 4
    }
    best = max(returns, key=returns.get)
    table = read_hyperparameters(PpoConfig, ["cutin"], path)
    assert {name: table.values[name] for name in SPACES} == trials[best]
    assert [*table.values] == names_of(PpoConfig)
    assert table.values["hidden"] == 4
    assert f"# Trial {int(best)} of 9: validation return {returns[best]:.4g}" in path.read_text()


def test_a_trial_below_the_median_ends_early_and_is_not_the_best(config, capsys):
    tune(config, 9, Learner())
    told = capsys.readouterr().out
    assert "pruned" in told
    for line in told.splitlines():
        number, _, rest = line.removeprefix("trial ").partition(": ")
        if rest.startswith(("pruned", "complete")):
            rows = (config.out / TRIALS / f"{int(number):03d}" / CURVE).read_text().splitlines()
            assert len(rows) == (3 if rest.startswith("pruned") else 4)


@pytest.mark.parametrize("breaks", [1, 3, 5, 15])
def test_a_study_that_was_interrupted_goes_on_as_if_it_had_not_been(config, tmp_path, breaks):
    whole, broken, rest = Learner(), Learner(breaks), Learner()
    other = replace(config, out=tmp_path / "other")
    tune(other, 7, whole)
    with pytest.raises(KeyboardInterrupt):
        tune(config, 7, broken)
    tune(replace(config, resume=True), 7, rest)
    assert tried(broken) | tried(rest) == tried(whole)
    assert (config.out / BEST).read_text() == (other.out / BEST).read_text()
    # A finished one plays nothing again, and more trials go on from there.
    before = len(rest.trained)
    tune(replace(config, resume=True), 7, rest)
    assert len(rest.trained) == before
    tune(replace(config, resume=True), 8, rest)
    assert len(rest.trained) == before + 1


def test_a_trial_whose_numbers_burst_fails_alone(config, capsys):
    def train(one, evaluated):
        if one.out.name == "001":
            raise ValueError("Expected parameter loc\nto satisfy the constraint Real()")
        Learner()(one, evaluated)

    tune(config, 3, train)
    told = capsys.readouterr().out
    assert "trial 1: Expected parameter loc to satisfy the constraint Real()\ntrial 1: fail" in told
    assert "trial 2: complete" in told


def test_where_every_trial_fails_that_is_told(config):
    def train(*_):
        raise ValueError("no number")

    with pytest.raises(InvalidInput, match="study: none of the trials was completed, 2 were begun"):
        tune(config, 2, train)


def test_every_trial_tells_of_the_episodes_of_the_rules(config):
    """Scored in the first, they are kept by the others, which begin a run of their own."""
    played = Played(VALIDATION, "CARE-CutIn-v0", -1.0, 20.0)
    scored = []

    def train(one, evaluated):
        folder = Folder(one)

        def score():
            scored.append(one.out.name)
            return {"care": [played]}

        folder.rules(score)
        write_episodes(one.out, [*folder._episodes, EpisodeRow(LEARNER, 0, played)])
        Learner()(one, evaluated)

    tune(config, 3, train)
    assert scored == ["000"]
    rows = [EpisodeRow("care", 0, played), EpisodeRow(LEARNER, 0, played)]
    for number in range(3):
        assert read_episodes(config.out / TRIALS / f"{number:03d}") == rows


def test_another_study_is_not_mixed_in(config):
    tune(config, 1, Learner())
    for changed, message in (
        ({}, "holds a study already; add --resume"),
        ({"resume": True, "hidden": 8}, "tuned with hidden 4, asked is 8"),
        ({"resume": True, "steps": 200}, "tuned with steps 100, asked is 200"),
        ({"resume": True, "out": config.out / "none"}, "no study to be resumed: no study.journal"),
    ):
        with pytest.raises(InvalidInput, match=message):
            tune(replace(config, **changed), 2, Learner())


def test_what_is_wrong_with_a_run_ends_the_study(config):
    def train(*_):
        raise InvalidInput("unknown environment")

    with pytest.raises(InvalidInput, match="unknown environment"):
        tune(config, 3, train)


def test_what_no_trial_could_play_leaves_no_study(config):
    with pytest.raises(InvalidInput, match="budget"):
        tune(replace(config, budget=(0.0,)), 1, Learner())
    assert not config.out.exists()


def test_a_learner_tries_what_it_has(tmp_path):
    assert [*spaces_of(SacConfig(out=tmp_path))] == ["learning_rate", "discount", "batch"]


def test_without_optuna_the_extra_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "optuna", None)
    with pytest.raises(MissingExtra, match=r"--tune needs the extra 'tune': pip install"):
        tune(PpoConfig(out=tmp_path / "study"), 1, Learner())
    assert not (tmp_path / "study").exists()


@pytest.mark.slow
def test_the_command_tunes_real_runs_and_its_file_trains(capsys, tmp_path):
    for library in ("optuna", "stable_baselines3"):
        pytest.importorskip(library)
    short = "--environments 2 --episodes 1 --evaluate-every 64 --rollout 32 --hidden 4"
    line = f"train ppo --env CARE-CutIn-v0 {short} --env-parameters duration_s=1.0 --out {tmp_path}"
    with pytest.raises(SystemExit) as end:
        main([*line.split(), "--steps", "64", "--tune", "2"])
    told = capsys.readouterr().out
    assert end.value.code == 0
    assert "trial 1: complete, return " in told
    assert (tmp_path / TRIALS / "001" / "weights.npz").exists()
    *_, last = told.splitlines()
    assert last == (
        "train with them: care-sim train ppo --env CARE-CutIn-v0 --hyperparameters "
        f"{tmp_path / BEST}"
    )
