"""A trained agent is found by name, file or folder, and plays where it learned."""

import re
import shlex
from dataclasses import replace
from types import SimpleNamespace

import pytest

from care_sim.cli import parsed_command
from care_sim.commands.options.shared import EpisodeOptions
from care_sim.commands.shared.agent_play import AgentPlay
from care_sim.policies.learned.weights import load_weights, save_weights, shipped_weights
from care_sim.training.agents import Agent, find_agent, shipped_agents
from care_sim.training.config import SacConfig
from care_sim.training.folder import Folder
from tests.helpers.commands import run

SHORT = ("--scenario-parameters", "duration_s=0.3")


def hash_of(out):
    """The hash of the episode whose timeline was printed."""
    return re.search(r"^episode_hash +(\S+)$", out, re.MULTILINE)[1]


@pytest.fixture
def mine(tmp_path):
    """The folder of a run that learned in the dart-out at 5% of the cells, with a bad LiDAR."""
    file = load_weights(shipped_weights("ppo-dense"))
    learned = file.card.result["config"] | {
        "budget": [0.05],
        "env_parameters": ["lidar_dropout=0.5", "duration_s=0.5", "keyframe_s=0.1"],
    }
    card = replace(file.card, scenario="CARE-Dartout-v0", budget=819, result={"config": learned})
    (tmp_path / "mine").mkdir()
    save_weights(tmp_path / "mine" / "weights.npz", file.arrays, card)
    return tmp_path / "mine"


def test_it_plays_where_the_agent_learned_and_with_its_conditions(capsys, mine):
    path = mine / "weights.npz"
    line = f"run dartout --policy ppo --budget 0.05 --policy-parameters path={path} --seed 2"
    conditions = "--lidar-dropout 0.5 --scenario-parameters duration_s=0.5"
    wanted = hash_of(run(capsys, *line.split(), *conditions.split())[1])
    for named in (mine, path):
        code, out, complaint = run(capsys, "run", named, "--seed", 2)
        assert code == 0
        assert hash_of(out) == wanted
        assert complaint == "care-sim: played without what no command takes: keyframe_s\n"
    # Given options win over those of the training.
    given = ("--lidar-dropout", 0.1, *SHORT)
    other = [*line.split(), *given]
    assert hash_of(run(capsys, "run", mine, *given, "--seed", 2)[1]) == hash_of(
        run(capsys, *other)[1]
    )
    # Elsewhere nothing of the training counts but the weights, and the budget.
    away = run(capsys, "run", path, "--scenario", "dense", *SHORT)
    line = ["run", "dense", "--policy", "ppo", "--budget", 0.05, *SHORT]
    there = run(capsys, *line, "--policy-parameters", f"path={path}")
    assert away[2] == there[2] == ""
    assert hash_of(away[1]) == hash_of(there[1])


def test_of_several_environments_the_first_counts_and_its_own_parameter_wins(mine):
    file = load_weights(mine / "weights.npz")
    own = ["CARE-NCAP-v0.speed_kph=0", "speed_kph=20", "CARE-Dense-v0.vehicles=2"]
    learned = file.card.result["config"] | {"env_parameters": [*own, "scoring_info=True"]}
    names = "CARE-NCAP-v0 CARE-Dense-v0"
    card = replace(file.card, scenario=names, result={"config": learned})
    save_weights(mine / "weights.npz", file.arrays, card)
    agent = find_agent(str(mine))
    assert agent.env == "CARE-NCAP-v0"
    assert dict(agent.env_parameters) == {"speed_kph": 0, "scoring_info": True}
    play = AgentPlay(agent)
    assert play.left_out() == ["scoring_info"]
    assert play.options(EpisodeOptions())["scenario_parameters"] == ("speed_kph=0",)


def test_a_shipped_agent_plays_by_either_name_and_is_filmed(capsys, tmp_path):
    film = tmp_path / "film.gif"
    line = ["run", "dense", "--policy", "ppo", "--budget", 0.03, *SHORT]
    wanted = hash_of(run(capsys, *line)[1])
    code, out, _ = run(capsys, "run", "ppo", *SHORT, "--video", film)
    assert (code, hash_of(out)) == (0, wanted)
    assert out.endswith(f"Filmed in {film}\n")
    assert film.read_bytes().startswith(b"GIF8")
    assert hash_of(run(capsys, "run", "ppo-dense", *SHORT)[1]) == wanted


def test_every_agent_of_the_package_is_found_and_has_a_world():
    names = {agent.policy for agent in shipped_agents()}
    assert {"ppo", "ppo-dartout", "learned-scorer", "place"} <= names
    worlds = {name: AgentPlay(find_agent(name)).world for name in names}
    assert worlds["ppo-dartout"] == "dartout"
    assert worlds["learned-scorer"] == "street"
    for name in names:
        line = shlex.split(AgentPlay(find_agent(name)).study_line())
        assert name in parsed_command(line[1:])[1].policies


@pytest.mark.parametrize(
    ("env", "given", "line"),
    [
        (
            "CARE-Street-v0",
            (("camera_latency", 1), ("false_negative_rate", 0.2)),
            "care-sim protocol --source streets --policies care ppo --budgets 0.1 "
            "--policy-parameters ppo.path=w.npz --false-negative-rate 0.2 --camera-latency 1",
        ),
        (
            "CARE-Replay-v0",
            (("source", "nuscenes:a b"), ("split", "val"), ("scene", "scene-1")),
            "care-sim protocol --source 'nuscenes:a b' --policies care ppo --budgets 0.1 "
            "--policy-parameters ppo.path=w.npz --split val",
        ),
        (
            "mine:Mine",
            (("gap_m", (1.0, 2.0)), ("floor", False), ("driver", "careful-human")),
            "care-sim sweep --scenarios mine:Mine --policies care ppo --budgets 0.1 --no-floor "
            "--driver careful-human --scenario-parameters gap_m=1.0,2.0 "
            "--policy-parameters ppo.path=w.npz",
        ),
    ],
)
def test_the_line_beside_care_is_that_of_its_loop_and_conditions(env, given, line):
    told = AgentPlay(Agent("ppo", "w.npz", env, 0.1, given)).study_line()
    # In whatever order the options come.
    assert parsed_command(shlex.split(told)[1:]) == parsed_command(shlex.split(line)[1:])


@pytest.mark.parametrize(
    ("named", "message"),
    [
        ("nobody", "unknown scenario 'nobody'; known: "),
        ("torn.npz", "weights torn.npz: no .npz of weights of care-sim train, or damaged"),
        ("sac", "sac holds no weights.npz: an agent of sac acts from its checkpoint alone"),
        ("placeless.npz", "placeless.npz: the card names no environment"),
    ],
)
def test_what_is_no_agent_is_told_in_one_line(capsys, tmp_path, monkeypatch, named, message):
    monkeypatch.chdir(tmp_path)
    whole = shipped_weights("ppo-dense").read_bytes()
    (tmp_path / "torn.npz").write_bytes(whole[: len(whole) // 2])
    file = load_weights(shipped_weights("ppo-dense"))
    save_weights("placeless.npz", file.arrays, replace(file.card, scenario=None))
    learner = SimpleNamespace(save=lambda path: path.write_bytes(b"PK"))
    Folder(SacConfig(out=tmp_path / "sac")).begin(learner)
    code, _, complaint = run(capsys, "run", *named.split())
    assert (code, complaint.count("\n")) == (2, 1)
    assert message in complaint


@pytest.mark.parametrize(
    "config",
    [
        {"budget": ["much"]},
        {"env_parameters": "x"},
    ],
)
def test_a_card_that_somebody_wrote_breaks_nothing(tmp_path, config):
    file = load_weights(shipped_weights("ppo-dense"))
    card = replace(file.card, result={"config": config})
    save_weights(tmp_path / "odd.npz", file.arrays, card)
    agent = find_agent(str(tmp_path / "odd.npz"))
    assert (agent.budget, agent.env_parameters) == (0.1, ())
