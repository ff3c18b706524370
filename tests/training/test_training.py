"""Training from the command line: seeds apart, files kept, resumed, refused."""

import csv
import json
import re
import shlex
import sys
from collections import Counter
from importlib.util import find_spec

import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput, MissingExtra
from care_sim.base.seeds import TRAINING, VALIDATION
from care_sim.cli import main, parsed_command
from care_sim.commands.train import end_of_training
from care_sim.core.defaults import Wrapping
from care_sim.policies.learned.weights import load_weights
from care_sim.training.config import PpoConfig, SacConfig
from care_sim.training.environments import plain, training
from care_sim.training.folder import read_table, rule_scores
from care_sim.training.run import RULES, algorithm, played_rules
from care_sim.training.seeds import validation_seeds

SHORT = ["--environments", "2", "--episodes", "2", "--env-parameters", "duration_s=1.0"]
TOLD = ("scoring_info=True",)
TINY = [*SHORT, "--rollout", "32", "--batch", "32", "--epochs", "1", "--hidden", "4"]


def care(capsys, *arguments):
    """Exit code, output and complaint of a command."""
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    return end.value.code, *capsys.readouterr()


def hash_of(played):
    """The hash of the episode whose timeline was printed."""
    return re.search(r"^episode_hash +(\S+)$", played, re.MULTILINE)[1]


@pytest.fixture
def libraries():
    pytest.importorskip("stable_baselines3")
    pytest.importorskip("torch")


def test_training_never_meets_a_seed_that_is_held_out(monkeypatch):
    """Nor do learners of neighbouring seeds share an episode, though Stable-Baselines3 seeds
    environment n of a learner with its seed + n.
    """
    monkeypatch.setattr("care_sim.training.seeds.LAST", TRAINING + 100_000)
    met = []
    for learner, given in ((0, 0), (0, 0), (0, 1), (1, 0)):
        env = training(PpoConfig(seed=learner, env_parameters=TOLD), 0.03)
        met.append([env.reset(seed=None if n else given)[1]["seed"] for n in range(10)])
        env.close()
    assert min(min(seeds) for seeds in met) >= TRAINING > max(validation_seeds(8000))
    assert min(validation_seeds(20)) >= VALIDATION
    assert met[0] == met[1]
    assert len({*met[1], *met[2], *met[3]}) == 30


@pytest.mark.usefixtures("libraries")
@pytest.mark.slow
def test_it_trains_keeps_and_goes_on(capsys, tmp_path):
    out = tmp_path / "run"
    command = ["train", "ppo", *TINY, "--out", out, "--evaluate-every", "64"]
    code, said, _ = care(capsys, *command, "--steps", "128")
    assert code == 0
    first, *lines = said.splitlines()
    assert first.startswith("hyperparameters of ")
    assert lines[0] == "playing the rules on 2 validation episodes"
    scored, lines = lines[1 : 4 + len(RULES)], lines[4 + len(RULES) :]
    assert [line.partition(":")[0] for line in scored] == [
        *RULES, "0 steps", "64 steps", "128 steps",
    ]  # fmt: skip
    assert "environment steps per second inside ppo" in lines[0]
    steps, value = re.match(
        r"best after (\d+) steps: return (\S+) on 2 validation episodes; random .*, full ", lines[1]
    ).groups()
    curve = {
        row["steps"]: float(row["return"]) for row in csv.DictReader((out / "curve.csv").open())
    }
    assert max(curve, key=curve.get) == steps
    assert float(value) == pytest.approx(curve[steps], abs=0.005)
    # So few steps may teach nothing.
    random = rule_scores(read_table(out / "episodes.csv"))["random"].mean_return
    told = "not better than random: nothing was learned yet"
    assert (lines[2] == told) == (curve[steps] <= random)
    lines = [line for line in lines if line != told]
    assert lines[2] == f"kept: the weights of that step, {out / 'weights.npz'}"
    assert load_weights(out / "weights.npz").card.steps == int(steps)
    play, beside = (line.partition(": ")[2] for line in lines[3:])
    assert play == f"care-sim run {out}"
    # It goes as it is told, and learns of the parameters of the training.
    assert beside == (
        "care-sim sweep --policies care ppo --budgets 0.03 "
        f"--policy-parameters ppo.path={out / 'weights.npz'} "
        "--scenario-parameters duration_s=1.0 --scenarios dense"
    )
    assert parsed_command(shlex.split(beside)[1:])[1].budgets == (0.03,)
    code, played, complaint = care(capsys, *shlex.split(play)[1:], "--seed", "5")
    line = f"run dense --policy ppo --budget 0.03 --policy-parameters path={out / 'weights.npz'}"
    again = care(capsys, *line.split(), "--scenario-parameters", "duration_s=1.0", "--seed", 5)[1]
    assert (code, complaint) == (0, "")
    assert [*map(hash_of, (played, again))] == [hash_of(played)] * 2
    settings = json.loads((out / "config.json").read_text())
    assert (settings["algorithm"], settings["budget"], settings["hidden"]) == ("ppo", [0.03], 4)

    assert care(capsys, *command)[0] == 2
    code, said, _ = care(capsys, *command, "--steps", "192", "--resume")
    assert "checkpoint.zip: loading a checkpoint runs code from it, so resume your own" in said
    assert code == 0
    rows = list(csv.DictReader((out / "curve.csv").open()))
    assert [int(row["steps"]) for row in rows] == [0, 64, 128, 192]
    seconds = [float(row["seconds"]) for row in rows]
    assert seconds == sorted(seconds)

    assert list(rule_scores(read_table(out / "episodes.csv"))) == list(RULES)
    weights = load_weights(out / "weights.npz")
    assert "out" not in weights.card.result["config"]
    best = max(float(row["return"]) for row in rows)
    assert weights.card.result["validation"]["mean_return"] == pytest.approx(best)
    assert (weights.card.budget, weights.card.wrapper) == (492, Wrapping())
    assert weights.card.seeds["validation"] == [VALIDATION, VALIDATION + 1]
    env = plain(PpoConfig())
    care_sim.make_policy("ppo", env, path=out / "weights.npz")
    env.close()

    for changed, message in (
        (["--azimuths", "16"], "trained with azimuths 32, asked is 16"),
        (["--budget", "0.05"], "trained with budget [0.03], asked is [0.05]"),
        (
            ["--env", "CARE-Dartout-v0"],
            "trained with env 'CARE-Dense-v0', asked is 'CARE-Dartout-v0'",
        ),
        (["--steps", "192"], "192 steps are done"),
    ):
        code, _, complaint = care(capsys, *command, "--steps", "256", "--resume", *changed)
        assert (code, complaint.count("\n")) == (2, 1)
        assert message in complaint


def test_a_rule_that_does_not_fit_is_told_and_left_out(capsys):
    """A map is one of the default grid."""
    given = ("sensor=os1-64", "duration_s=0.2")
    config = PpoConfig(budget=(0.03,), episodes=1, env_parameters=given)
    assert {*RULES} - {*played_rules(config)} == {"place"}
    first, line = capsys.readouterr().out.splitlines()
    assert first == "playing the rules on 1 validation episode"
    assert line.startswith("place does not fit and is not beside it: ")


@pytest.mark.usefixtures("libraries")
@pytest.mark.slow
@pytest.mark.parametrize(
    "moment", ["care_sim.training.run.play", "care_sim.training.run._learn_steps"]
)
def test_an_interrupted_run_goes_on(capsys, monkeypatch, tmp_path, moment):
    """Whether the rules are being measured or the first steps were just learned."""

    def interrupt(*_):
        raise KeyboardInterrupt

    command = [
        "train",
        "ppo",
        *TINY,
        "--out",
        tmp_path / "run",
        "--evaluate-every",
        "64",
        "--steps",
        "64",
    ]
    with monkeypatch.context() as patch:
        patch.setattr(moment, interrupt)
        code, _, complaint = care(capsys, *command)
    assert code == 130
    assert "the same command with --resume resumes" in complaint
    assert care(capsys, *command, "--resume")[0] == 0
    assert len((tmp_path / "run" / "curve.csv").read_text().splitlines()) == 3


@pytest.mark.usefixtures("libraries")
@pytest.mark.slow
def test_it_learns_in_drawn_episodes_and_goes_on(capsys, tmp_path):
    out = tmp_path / "run"
    names = ["CARE-Dense-v0", "CARE-NCAP-v0"]
    command = ["train", "ppo", "--drawn", *TINY, "--env", *names, "--budget", "0.02", "0.05"]
    command += ["--episodes", "6", "--without", "tracks", "--out", out]
    assert care(capsys, *command, "--steps", "64")[0] == 0
    code, said, _ = care(capsys, *command, "--steps", "128", "--resume")
    assert code == 0
    assert "full: return 0.00" in said

    rows = read_table(out / "episodes.csv")
    played = Counter((row["policy"], row["steps"]) for row in rows)
    policies = [(rule, 0) for rule in RULES]
    assert played == dict.fromkeys(
        [*policies, ("learner", 0), ("learner", 64), ("learner", 128)], 6
    )
    assert {row["env"] for row in rows} == set(names)
    totals = [row["return"] for row in rows if (row["policy"], row["steps"]) == ("learner", 128)]
    curve = list(csv.DictReader((out / "curve.csv").open()))
    assert float(curve[-1]["return"]) == pytest.approx(np.mean(totals))

    card = load_weights(out / "weights.npz").card
    assert (card.budget, card.scenario) == (None, " ".join(names))
    assert card.result["config"]["drawn"]
    assert card.result["config"]["without"] == ["tracks"]

    code, _, complaint = care(
        capsys, *command, "--steps", "256", "--resume", "--env", "CARE-Dense-v0"
    )
    assert (code, complaint.count("\n")) == (2, 1)
    assert (
        "trained with env ['CARE-Dense-v0', 'CARE-NCAP-v0'], asked is 'CARE-Dense-v0'" in complaint
    )


@pytest.mark.usefixtures("libraries")
@pytest.mark.slow
@pytest.mark.parametrize("name", ["sac", "recurrent-ppo"])
def test_the_other_learners_by_name(capsys, tmp_path, name):
    if name == "recurrent-ppo":
        pytest.importorskip("sb3_contrib")
    own = ["--memory", "500"] if name == "sac" else ["--rollout", "32", "--batch", "32"]
    command = ["train", name, *SHORT, *own, "--out", tmp_path, "--evaluate-every", "128"]
    logs = ["--tensorboard"] if find_spec("tensorboard") else []
    code, said, _ = care(capsys, *command, "--steps", "128", *logs)
    assert code == 0
    # Weights that act outside of its library are those of `ppo` alone.
    assert said.endswith(f"{tmp_path / 'checkpoint.zip'}; --resume goes on with it\n")
    assert len([*tmp_path.glob("tensorboard/*/events.*")]) == len(logs)
    assert care(capsys, *command, "--steps", "256", "--resume")[0] == 0
    assert len((tmp_path / "curve.csv").read_text().splitlines()) == 4


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ["--env", "CARE-Moon-v0"],
            "unknown environment 'CARE-Moon-v0'; the nearest is CARE-Dense-v0; known: ",
        ),
        (["--azimuths", "24"], "azimuths must divide columns, got 24 and 64"),
        (["--azimuths", "3", "--columns", "3"], "azimuths must divide the 512 of the grid"),
        (["--budget", "2"], "budget must lie in (0, 1]"),
        (["--steps", "0"], "steps must be a whole number >= 1"),
        (["--episodes", "8001"], "episodes must be a whole number >= 1 and <= 8000"),
        (["--env-parameters", "budget=0.1"], "budget is no env_parameter but set by --budget"),
        (["--env-parameters", "wheels=3"], "wheels"),
        (["--resume"], "holds no run to be resumed"),
        (["--drawn", "--env", "CARE-Dense-v0", "CARE-Moon-v0"], "unknown environment 'CARE-Moon"),
    ],
)
@pytest.mark.usefixtures("libraries")
def test_bad_input_is_one_line(capsys, tmp_path, options, message):
    code, _, complaint = care(capsys, "train", "ppo", "--out", tmp_path / "out", *options)
    assert (code, complaint.count("\n")) == (2, 1)
    assert message in complaint
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("best", "is_told"), [(-3.0, True), (-2.5, True), (-2.4, False)])
def test_who_is_not_better_than_chance_has_learned_nothing(tmp_path, best, is_told):
    rules = "policy,steps,seed,env,return,distance_m\nrandom,0,2000,E,-2.5,\n"
    (tmp_path / "episodes.csv").write_text(rules)
    rows = ["steps,seconds,return,distance_m", "0,0,-4.0,", f"256,1.0,{best},"]
    (tmp_path / "curve.csv").write_text("\n".join(rows))
    first, *others = end_of_training(PpoConfig(out=tmp_path))
    assert f"return {best:.2f} on 20 validation episodes; random -2.50" in first
    assert ("not better than random: nothing was learned yet" in others) == is_told


def test_a_missing_library_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "sb3_contrib", None)
    with pytest.raises(MissingExtra, match=r"recurrent-ppo needs the extra 'rl'"):
        algorithm("recurrent-ppo")


def test_a_rollout_of_one_step_is_refused():
    with pytest.raises(InvalidInput, match="rollout needs two steps or more"):
        PpoConfig(environments=1, rollout=1)


def test_budgets_beyond_the_environments_are_refused():
    with pytest.raises(InvalidInput, match="budget needs one value to 2"):
        SacConfig(environments=2, budget=(0.1, 0.2, 0.3))
