"""The figure of learning curves, from folders as training writes them."""

import json

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.cli import main
from care_sim.study.episode_play import Played
from care_sim.training.config import PpoConfig, SacConfig
from care_sim.training.curves import curves_table, grouped_runs, read_run
from care_sim.training.curves_figure import curves_figure
from care_sim.training.validation import EpisodeRow, write_episodes

DISTANCES = (4.0, 10.0, 16.0)


def folder(path, config, distances=DISTANCES):
    """A run that was evaluated every hundred steps."""
    path.mkdir()
    (path / "config.json").write_text(config.to_json())
    rules = {"random": 6.0, "care": 15.0, "full": 16.0}
    measured = {
        name: {
            "episodes": 2,
            "mean_return": -metres,
            "distance_m": metres if distances[0] is not None else None,
        }
        for name, metres in rules.items()
    }
    (path / "rules.json").write_text(json.dumps(measured))
    lines = (
        f"{100 * n},{n}.5,{n - 9},{'' if metres is None else metres}"
        for n, metres in enumerate(distances)
    )
    (path / "curve.csv").write_text("\n".join(["steps,seconds,return,distance_m", *lines]) + "\n")
    return path


def varied(path, config, scores, seconds=60.0):
    """A run in two environments, evaluated every hundred steps: `scores` are, at each evaluation,
    of the first and of the second between random, 0, and full, 1. Returns are from -20 or -200 on.
    """
    folder(path, config, (None,) * len(scores))
    lines = [f"{100 * n},{seconds * n},-1.0," for n in range(len(scores))]
    (path / "curve.csv").write_text("\n".join(["steps,seconds,return,distance_m", *lines]) + "\n")
    heights = {"random": (0.0, 0.0), "care": (0.5, 0.5), "full": (1.0, 1.0)}
    reached = [(rule, 0, both) for rule, both in heights.items()]
    reached += [("learner", 100 * n, both) for n, both in enumerate(scores)]
    write_episodes(
        path,
        [
            EpisodeRow(policy, steps, Played(2000 + 2 * n + place, env, span * (score - 1), None))
            for policy, steps, both in reached
            for place, (env, span, score) in enumerate(
                zip(("CARE-NCAP-v0", "CARE-Street-v0"), (20, 200), both, strict=True)
            )
            for n in range(2)
        ],
    )
    return path


VARIED = {"drawn": True, "env": ("CARE-NCAP-v0", "CARE-Street-v0")}


def test_environments_weigh_alike_whatever_their_returns_are(tmp_path):
    first = varied(tmp_path / "0", PpoConfig(**VARIED), [(0, 0.2), (0.4, 0.8)], 60)
    second = varied(tmp_path / "1", PpoConfig(**VARIED, seed=1), [(0, 0.2), (0.6, 1.0)], 120)
    (runs,) = grouped_runs(map(read_run, (first, second)))
    assert runs[0].tasks == ["CARE-NCAP-v0", "CARE-Street-v0"]
    np.testing.assert_allclose(runs[0].scores, [[0, 0.2], [0.4, 0.8]])
    np.testing.assert_allclose(runs[0].marks["care"], [0.5, 0.5])

    (row,) = curves_table([runs]).rows
    assert row[:2] == ("ppo, CARE-NCAP-v0, CARE-Street-v0, drawn", "2")
    # The middle two of 0.4, 0.6, 0.8 and 1; in each environment the worse or the better run.
    assert row[2:5] == ("100", "0.70 [0.60, 0.80]", "score (random 0, full 1)")
    assert row[5:] == ("random from 0, care from 100", "2 min")

    figure = curves_figure([runs])
    curve, profile = figure.axes
    (thick,) = (line for line in curve.lines if line.get_linewidth() > 2)
    np.testing.assert_allclose(thick.get_ydata(), [0.1, 0.7])
    (own,) = (line for line in profile.lines if line.get_label() == "ppo")
    # Returns of -12, -8, -40 and 0, twice each: all above -200, none above 0.
    assert own.get_ydata()[0] == 1.0
    assert own.get_ydata()[-1] == 0.0
    assert own.get_ydata()[np.searchsorted(own.get_xdata(), -30)] == 0.75


def test_panels_of_one_unit_have_one_scale(tmp_path):
    recipes = (PpoConfig(**VARIED), PpoConfig(**VARIED, without=("tracks",)), PpoConfig())
    low, high = (
        varied(tmp_path / "0", recipes[0], [(-3, -3)]),
        varied(tmp_path / "1", recipes[1], [(0.9, 0.9)]),
    )
    groups = grouped_runs(map(read_run, (low, high, folder(tmp_path / "2", recipes[2]))))
    scores, others, metres = curves_figure(groups).axes[:3]
    assert scores.get_ylim() == others.get_ylim() != metres.get_ylim()
    assert scores.get_ylim()[0] < -3
    places = [{text.get_text(): text.xy[1] for text in axes.texts} for axes in (scores, others)]
    assert places[0]["care"] == places[1]["care"]
    assert places[0]["ppo"] < places[0]["random"] < places[1]["ppo"] < places[1]["full"]


def test_an_environment_that_tells_nothing_is_left_out(tmp_path):
    path = varied(tmp_path / "0", PpoConfig(**VARIED), [(0.4, 0.8)])
    rows = [
        row._replace(played=row.played._replace(total=0.0))
        if row.played.env == "CARE-NCAP-v0"
        else row
        for row in read_run(path).episodes
    ]
    write_episodes(path, [*rows, EpisodeRow("random", 0, rows[-1].played._replace(env="else"))])
    run = read_run(path)
    assert run.tasks == ["CARE-Street-v0"]


def test_recipes_that_leave_something_out_are_recipes_of_their_own(tmp_path):
    configs = [PpoConfig(), PpoConfig(without=("tracks",))]
    runs = [read_run(folder(tmp_path / str(n), one)) for n, one in enumerate(configs)]
    groups = grouped_runs(runs)
    assert [row[0] for row in curves_table(groups).rows] == [
        "ppo, CARE-Dense-v0",
        "ppo, CARE-Dense-v0, without tracks",
    ]


@pytest.mark.parametrize(
    "text",
    [
        "policy,steps\ncare,0\n",
        "policy,steps,seed,env,return,distance_m\ncare,0,2000,E,nan,\n",
        "policy,steps,seed,env,return,distance_m\ncare,-1,2000,E,1,\n",
        "policy,steps,seed,env,return,distance_m\ncare,0,2000,E\n",
        "",
    ],
)
def test_a_damaged_table_of_episodes_is_named(folders, text):
    (folders[0] / "episodes.csv").write_text(text)
    with pytest.raises(InvalidInput, match=r"episodes\.csv is damaged") as error:
        read_run(folders[0])
    assert "\n" not in str(error.value)


def test_episodes_that_are_missing_are_named(tmp_path):
    path = varied(tmp_path / "0", PpoConfig(**VARIED), [(0.4, 0.8)])
    rows = [row for row in read_run(path).episodes if row.policy != "care"]
    write_episodes(path, rows)
    with pytest.raises(InvalidInput, match="lack those of care after 0 steps in 'CARE-NCAP-v0'"):
        read_run(path).marks  # noqa: B018


@pytest.fixture
def folders(tmp_path):
    configs = PpoConfig(seed=0), PpoConfig(seed=1), PpoConfig(env="CARE-Dartout-v0"), SacConfig()
    return [folder(tmp_path / f"run-{n}", config) for n, config in enumerate(configs)]


def learned(axes):
    (name,) = (text for text in axes.texts if text.get_text() == "ppo")
    return [line for line in axes.lines if line.get_color() == name.get_color()]


def test_runs_that_differ_by_their_seed_lie_together(folders):
    assert [len(group) for group in grouped_runs(map(read_run, folders))] == [2, 1, 1]


def test_a_run_of_before_lies_with_those_of_its_recipe(folders):
    config = json.loads((folders[0] / "config.json").read_text())
    del config["drawn"], config["without"]
    (folders[0] / "config.json").write_text(json.dumps(config))
    assert [len(group) for group in grouped_runs(map(read_run, folders))] == [2, 1, 1]


def test_who_is_behind_random_is_drawn_below_0(tmp_path):
    path = varied(tmp_path / "0", PpoConfig(**VARIED), [(-0.5, -0.5), (0.4, 0.8)])
    lines = (path / "curve.csv").read_text().splitlines()
    # Both environments have metres.
    (path / "curve.csv").write_text("\n".join([lines[0], *(f"{one}10" for one in lines[1:])]))
    assert curves_figure([[read_run(path)]]).axes[0].get_ylim()[0] < -0.5


def test_a_panel_a_task_a_line_a_seed_and_their_mean(folders, tmp_path):
    other = folder(tmp_path / "other", PpoConfig(seed=2), (4.0, 13.0, 16.0))
    figure = curves_figure(grouped_runs(map(read_run, [folders[0], other, folders[2]])))
    both, alone = figure.axes
    assert [line.get_ydata().tolist() for line in learned(both)] == [
        [4, 10, 16],
        [4, 13, 16],
        [4, 11.5, 16],
    ]
    assert [line.get_ydata().tolist() for line in learned(alone)] == [[4, 10, 16]]
    assert learned(alone)[0].get_xdata().tolist() == [0, 100, 200]
    assert both.get_title(loc="left") == "ppo, CARE-Dense-v0, 2 training seeds"
    figure.canvas.draw()
    assert "0.1" in {label.get_text() for label in alone.get_xticklabels()}, "thousands of steps"
    assert {text.get_text() for text in both.texts} == {"random", "care", "full", "ppo"}


def test_without_a_distance_the_return_is_drawn(tmp_path):
    run = read_run(folder(tmp_path / "street", PpoConfig(env="CARE-Street-v0"), (None, None)))
    assert run.scores.tolist() == [[-9.0], [-8.0]]
    assert run.marks["random"].tolist() == [-6.0]
    assert curves_figure([[run]]).axes[0].get_ylabel() == "return"


def test_the_command_draws_both_forms(folders, tmp_path, capsys):
    with pytest.raises(SystemExit) as end:
        main(
            [
                "train",
                "curves",
                *map(str, folders),
                "--out",
                str(tmp_path / "figures" / "curves.png"),
            ]
        )
    assert end.value.code == 0
    said = capsys.readouterr().out
    assert said.strip().endswith("curves.png")
    assert "Figure: " in said
    assert "Training runs" in said
    assert all(
        (tmp_path / "figures" / f"curves{ending}").stat().st_size > 1000
        for ending in (".png", ".svg")
    )


@pytest.mark.parametrize("name", ["config.json", "rules.json", "curve.csv"])
def test_a_folder_that_lacks_something_is_named(folders, name):
    (folders[0] / name).unlink()
    with pytest.raises(InvalidInput, match=f"run-0 holds no evaluated training run: no {name}"):
        read_run(folders[0])


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("config.json", "{"),
        ("rules.json", ""),
        ("curve.csv", "steps,seconds,return,distance_m\n100,2"),
        ("curve.csv", "steps\n100"),
        ("curve.csv", ""),
    ],
)
def test_a_damaged_file_is_named(folders, name, text):
    (folders[0] / name).write_text(text)
    with pytest.raises(InvalidInput, match=f"{name} is damaged") as error:
        read_run(folders[0])
    assert "\n" not in str(error.value)


DEEP = '{"a": ' + "[" * 100_000


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("config.json", DEEP),
        ("config.json", "[1]"),
        ("config.json", '{"study": "sweep", "configurations": []}'),
        ("config.json", '{"algorithm": "ppo", "env": "E", "budget": [], "episodes": 2}'),
        ("config.json", '{"algorithm": "ppo", "env": "E", "budget": ["a"], "episodes": 2}'),
        ("config.json", '{"algorithm": "dqn", "env": "E", "budget": [0.1], "episodes": 2}'),
        ("config.json", '{"algorithm": "\\ud800", "env": "E", "budget": [0.1], "episodes": 2}'),
        ("config.json", '{"algorithm": ["ppo"], "env": "E", "budget": [0.1], "episodes": 2}'),
        ("rules.json", DEEP),
        ("rules.json", "3"),
        ("rules.json", '{"care": 3}'),
        ("rules.json", '{"care": {"mean_return": 1, "distance_m": 2}}'),
        ("rules.json", '{"care": {"episodes": 2, "mean_return": "1", "distance_m": 2}}'),
        ("rules.json", '{"care": {"episodes": 2, "mean_return": NaN, "distance_m": null}}'),
        ("curve.csv", "steps,seconds,return,distance_m\n"),
        ("curve.csv", "steps,seconds,return,distance_m\n1,2,nan,3\n"),
        ("curve.csv", "steps,seconds,return,distance_m\n1,2,1e300,3\n"),
        ("curve.csv", f"steps,seconds,return,distance_m\n{10**300},2,1,3\n"),
        ("curve.csv", "steps,seconds,return,distance_m\n-1,2,1,3\n"),
        ("curve.csv", "steps,seconds,return,distance_m\n1,2,1,3,4\n"),
        ("curve.csv", "steps,seconds,return,distance_m\n1,2\0,1,3\n"),
        ("curve.csv", "\udcff"),
        ("curve.csv", f'steps,seconds,return,distance_m\n1,2,"{"x" * 200_000}",3\n'),
    ],
)
def test_files_of_somebody_else_are_one_line(folders, name, text, capsys, tmp_path):
    (folders[0] / name).write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(SystemExit) as end:
        main(["train", "curves", str(folders[0]), "--out", str(tmp_path / "curves.png")])
    said = capsys.readouterr().err
    assert (end.value.code, said.count("\n")) == (2, 1)
    assert len(said) < 500
    assert "run-0" in said


@pytest.mark.filterwarnings("error")
def test_a_run_that_was_only_evaluated_before_its_first_step_is_drawn(tmp_path):
    run = read_run(folder(tmp_path / "begun", PpoConfig(), (4.0,)))
    assert run.steps == [0]
    assert curves_figure([[run]]).axes[0].get_xlim()[0] == 0


@pytest.mark.filterwarnings("error")
def test_names_are_drawn_as_they_are(folders, tmp_path):
    rules = json.loads((folders[0] / "rules.json").read_text())
    names = "my $rule_{", "\ud800\x1b[31m\u5b66"
    (folders[0] / "rules.json").write_text(json.dumps(rules | dict.fromkeys(names, rules["care"])))
    config = json.loads((folders[0] / "config.json").read_text())
    (folders[0] / "config.json").write_text(json.dumps(config | {"env": "E $x^$ $\\frac$\x00"}))
    with pytest.raises(SystemExit) as end:
        main(["train", "curves", str(folders[0]), "--out", str(tmp_path / "curves.png")])
    assert end.value.code == 0
    drawn = (tmp_path / "curves.svg").read_text()
    assert all(f">{name}</text>" in drawn for name in ("my $rule_{", "\\ud800\\x1b[31m\u5b66")), (
        "names beside the axes"
    )
