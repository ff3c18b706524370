"""Hyperparameters in files: those of the environment are the defaults, and options win."""

from dataclasses import fields

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.cli import parsed_command
from care_sim.commands.train import train
from care_sim.envs import IDS
from care_sim.policies.learned.weights import load_weights, shipped_weights
from care_sim.training.config import PpoConfig, RecurrentPpoConfig, SacConfig
from care_sim.training.hyperparameters import (
    DEFAULT,
    DRAWN,
    names_of,
    read_hyperparameters,
    shipped_file,
)

KINDS = (PpoConfig, SacConfig, RecurrentPpoConfig)
OWN = """
["CARE-CutIn-v0"]
learning_rate = 3e-4
epochs = 2
budget = [0.05, 1]
env_parameters = ["duration_s=2"]
[default]
noise = 1
"""


@pytest.fixture
def own(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(OWN)
    return path


def asked(*line):
    """The command of `care-sim train`."""
    return parsed_command(["train", *map(str, line)])[1]


@pytest.mark.parametrize("kind", KINDS)
def test_every_learner_has_a_file_whose_tables_are_of_environments(kind):
    tables = [
        line.strip('[]"\n') for line in shipped_file(kind.algorithm).open() if line.startswith("[")
    ]
    assert {*tables} - {DEFAULT, DRAWN} <= {*IDS}
    assert DEFAULT in tables
    for env in (*IDS, "dense", "mine:Mine"):
        assert read_hyperparameters(kind, [env]).values


@pytest.mark.parametrize("name", ["ppo-dense", "ppo-dartout"])
def test_the_file_holds_the_recipe_of_the_shipped_agents(name):
    recipe = load_weights(shipped_weights(name)).card.result["config"]
    command = asked("ppo", "--env", recipe["env"], "--budget", *recipe["budget"])
    config = {one: getattr(command, one) for one in recipe if one != "algorithm"}
    plain = {one: [*v] if isinstance(v, tuple) else v for one, v in config.items()}
    assert {"algorithm": command.kind.algorithm} | plain == recipe | {"env": [recipe["env"]]}
    assert command.steps == 200_000


def test_the_defaults_of_a_command_are_those_of_its_environment(own):
    of_cutin = asked("ppo", "--env", "CARE-CutIn-v0", "--hyperparameters", own)
    assert (of_cutin.learning_rate, of_cutin.epochs, of_cutin.budget) == (3e-4, 2, (0.05, 1))
    assert of_cutin.env_parameters == ("duration_s=2",)
    assert of_cutin.noise == PpoConfig().noise
    for line in (["--env", "cutin"], ["--env=CARE-CutIn-v0"]):
        assert asked("ppo", f"--hyperparameters={own}", *line).epochs == 2
    # Another has the table of all others.
    other = asked("ppo", "--hyperparameters", own)
    assert (other.noise, other.epochs) == (1, PpoConfig().epochs)


def test_what_is_of_one_of_several_environments_may_stand_in_a_file(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text('[default]\nenv_parameters = ["CARE-NCAP-v0.speed_kph=0"]\n')
    several = ("--env", "CARE-Dense-v0", "CARE-NCAP-v0", "--hyperparameters", path)
    assert asked("ppo", "--drawn", *several).arguments("CARE-NCAP-v0") == {"speed_kph": 0}
    with pytest.raises(InvalidInput, match="unknown environment of env_parameter CARE-NCAP"):
        asked("ppo", "--hyperparameters", path)


def test_drawn_episodes_have_a_table_of_their_own(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text("[drawn]\nepochs = 2\n[CARE-Dense-v0]\nepochs = 3\n[default]\nepochs = 5\n")
    epochs = {
        line: asked("ppo", "--hyperparameters", path, *line).epochs
        for line in (
            (),
            ("--drawn",),
            ("--drawn", "--env", "CARE-Drive-v0", "CARE-NCAP-v0"),
            ("--env", "CARE-Drive-v0"),
        )
    }
    assert [*epochs.values()] == [3, 2, 2, 5]
    # All of its budgets are drawn, however few environments there are.
    assert asked("ppo", "--drawn", "--environments", 1).budget == (0.02, 0.05, 0.1, 0.2)


def test_the_gain_of_a_table_says_nothing_of_drawn_episodes(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text("[default]\ngain = 3.0\nepochs = 2\n")
    command = asked("ppo", "--drawn", "--hyperparameters", path)
    assert (command.gain, command.epochs) == (PpoConfig.gain, 2)
    assert asked("ppo", "--hyperparameters", path).gain == 3.0
    table = read_hyperparameters(PpoConfig, command.env, path, drawn=True)
    assert table.told(command).endswith(f"{path} [default], options included: epochs 2")
    with pytest.raises(InvalidInput, match="gain weighs a term of another reward"):
        asked("ppo", "--drawn", "--hyperparameters", path, "--gain", 3.0)


def test_an_option_wins_also_where_it_is_the_default_of_the_command(own):
    default = PpoConfig().epochs
    line = ("ppo", "--env", "cutin", "--hyperparameters", own, "--epochs", default)
    command = asked(*line, "--budget", "0.2")
    assert (command.epochs, command.budget, command.learning_rate) == (default, (0.2,), 3e-4)
    table = read_hyperparameters(PpoConfig, ["cutin"], own)
    assert table.told(command) == (
        f"hyperparameters of {own} [CARE-CutIn-v0], options included: learning_rate 0.0003, "
        f"epochs {default}, budget (0.2,), env_parameters ('duration_s=2',)"
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "[default]\nepoch = 2",
            "own.toml [default] 'epoch', the nearest is epochs; known: action",
        ),
        ("[default]\nmemory = 2", "unknown argument of "),
        ("[default]\nepochs = 0", "own.toml [default]: epochs must be a whole number >= 1"),
        ("[default]\nlearning_rate = 'fast'", "learning_rate must lie in [1e-08, 1], got 'fast'"),
        ("[default]\naction = 'Fire'", "unknown action 'Fire'; known: SectorReserve"),
        ("[default]\nbudget = 0.1", "budget must be a list of numbers, got 0.1"),
        ("[default]\nenv_parameters = [1]", "env_parameters must be a list of texts NAME=VALUE"),
        ("epochs = 2", "own.toml: epochs stands in no table"),
        ("[default", "own.toml is no TOML file"),
        ("a=" + "[" * 5000, "own.toml is no TOML file"),
    ],
)
def test_a_file_that_is_wrong_is_told_in_one_line(tmp_path, text, message):
    path = tmp_path / "own.toml"
    path.write_text(text)
    with pytest.raises(InvalidInput) as refused:
        read_hyperparameters(PpoConfig, ["CARE-Dense-v0"], path)
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(InvalidInput, match=r"hyperparameters .*none.toml: no such file"):
        train(asked("sac", "--hyperparameters", tmp_path / "none.toml"))


@pytest.mark.parametrize("kind", KINDS)
def test_what_belongs_to_one_run_is_no_hyperparameter(kind):
    assert {field.name for field in fields(kind)} - {*names_of(kind)} == {
        "env",
        "drawn",
        "without",
        "seed",
        "out",
        "resume",
        "tensorboard",
        "threads",
        "processes",
    }
