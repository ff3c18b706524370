"""Learning curves from folders as training writes them: scores, what seeds reach, figure, table."""

import csv
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from care_sim.base.errors import InvalidInput
from care_sim.cli import main
from care_sim.reports.figures.styles import CALM
from care_sim.training.config import PpoConfig, SacConfig
from care_sim.training.curves import (
    curves_table,
    grouped_runs,
    interquartile_mean,
    performance_profile,
    read_run,
)
from care_sim.training.curves_figure import curves_figure
from care_sim.training.folder import COLUMNS

DENSE = "CARE-Dense-v0"
RULES = {"random": 6.0, "care": 15.0, "full": 16.0}
DISTANCES = (4.0, 10.0, 16.0)
VARIED = {"drawn": True, "env": ("CARE-NCAP-v0", "CARE-Street-v0")}


def written(path, config, evaluations, episodes, seconds=1.0):
    """A run that was evaluated every hundred steps; episodes are (policy, steps, env, return,
    metres), each of which is played twice.
    """
    path.mkdir(exist_ok=True)
    (path / "config.json").write_text(config.to_json())
    curve = [(100 * n, seconds * n, 0.0, None) for n in range(evaluations)]
    each = [
        (policy, steps, 2000 + 2 * n + k, *told)
        for k, (policy, steps, *told) in enumerate(episodes)
        for n in range(2)
    ]
    for name, rows in (("curve.csv", curve), ("episodes.csv", each)):
        with (path / name).open("w", newline="") as file:
            csv.writer(file).writerows([COLUMNS[name], *rows])
    return path


def folder(path, config, distances=DISTANCES, seconds=1.0):
    """A run in one environment whose learner reaches these metres; returns are minus as much."""
    reached = [(rule, 0, metres) for rule, metres in RULES.items()]
    reached += [("learner", 100 * n, metres) for n, metres in enumerate(distances)]
    rows = [(policy, steps, DENSE, -metres, metres) for policy, steps, metres in reached]
    return written(path, config, len(distances), rows, seconds)


def varied(path, config, scores, seconds=60.0, heights=(0.0, 0.5, 1.0)):
    """A run in two environments: `scores` are, at each evaluation, of the first and of the second
    between random, 0, and full, 1. Returns are from -20 or -200 on.
    """
    reached = [(rule, 0, (one, one)) for rule, one in zip(RULES, heights, strict=True)]
    reached += [("learner", 100 * n, both) for n, both in enumerate(scores)]
    spans = zip(VARIED["env"], (20, 200), strict=True)
    rows = [
        (policy, steps, env, span * (both[place] - 1), None)
        for place, (env, span) in enumerate(spans)
        for policy, steps, both in reached
    ]
    return written(path, config, len(scores), rows, seconds)


@pytest.fixture
def folders(tmp_path):
    configs = PpoConfig(seed=0), PpoConfig(seed=1), PpoConfig(env="CARE-Dartout-v0"), SacConfig()
    return [folder(tmp_path / f"run-{n}", config) for n, config in enumerate(configs)]


def test_environments_weigh_alike_whatever_their_returns_are(tmp_path):
    first = varied(tmp_path / "0", PpoConfig(**VARIED), [(0, 0.2), (0.4, 0.8)], 60)
    second = varied(tmp_path / "1", PpoConfig(**VARIED, seed=1), [(0, 0.2), (0.6, 1.0)], 120)
    (runs,) = grouped_runs(map(read_run, (first, second)))
    assert runs[0].tasks == ["CARE-NCAP-v0", "CARE-Street-v0"]
    np.testing.assert_allclose(runs[0].scores(steps=100), [0.4, 0.8])
    np.testing.assert_allclose(runs[0].scores("care"), [0.5, 0.5])

    (row,) = curves_table([runs]).rows
    assert row[:2] == ("ppo, CARE-NCAP-v0, CARE-Street-v0, drawn", "2")
    # The middle two of 0.4, 0.6, 0.8 and 1; in each environment the worse or the better run.
    assert row[2:5] == ("100", "0.70 [0.60, 0.80]", "score (random 0, full 1)")
    assert row[5:] == ("random from 0, care from 100", "2 min")

    curve, profile = curves_figure([runs]).axes
    (thick,) = (line for line in curve.lines if line.get_linewidth() > 2)
    np.testing.assert_allclose(thick.get_ydata(), [0.1, 0.7])
    (own,) = (line for line in profile.lines if line.get_linewidth() > 2)
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
    assert metres.get_ylim()[0] == 0
    places = [{text.get_text(): text.xy[1] for text in axes.texts} for axes in (scores, others)]
    assert places[0]["care"] == places[1]["care"]
    assert places[0]["ppo"] < places[0]["random"] < places[1]["ppo"] < places[1]["full"]


def test_an_environment_that_tells_nothing_is_left_out(tmp_path):
    """A scan of all sees no more than chance in the first of two."""
    path = varied(tmp_path / "0", PpoConfig(**VARIED), [(0.4, 0.8)])
    text = (path / "episodes.csv").read_text()
    (path / "episodes.csv").write_text(text.replace("CARE-NCAP-v0,-20.0", "CARE-NCAP-v0,0.0"))
    assert read_run(path).tasks == ["CARE-Street-v0"]


def test_episodes_that_are_missing_are_named(tmp_path):
    path = varied(tmp_path / "0", PpoConfig(**VARIED), [(0.4, 0.8)])
    with pytest.raises(InvalidInput, match="lack some of fan after 0 steps"):
        read_run(path).scores("fan")


def test_runs_that_differ_by_their_seed_lie_together(folders, tmp_path):
    others = folder(tmp_path / "other", PpoConfig(without=("tracks",)))
    groups = grouped_runs(map(read_run, [*folders, others]))
    assert [len(group) for group in groups] == [2, 1, 1, 1]
    assert curves_table(groups).rows[-1][0] == "ppo, CARE-Dense-v0, without tracks"
    longer = read_run(folder(tmp_path / "longer", PpoConfig(seed=5), (*DISTANCES, 16.0)))
    (row,) = curves_table([[*groups[0], longer]]).rows
    assert row[1:3] == ("3", "200"), "the last evaluation that all have"


def learned(axes):
    (name,) = (text for text in axes.texts if text.get_text() == "ppo")
    return [line for line in axes.lines if line.get_color() == name.get_color()]


def test_a_panel_a_task_a_line_a_seed_and_their_mean(folders, tmp_path):
    other = folder(tmp_path / "other", PpoConfig(seed=2), (4.0, 13.0, 16.0))
    figure = curves_figure(grouped_runs(map(read_run, [folders[0], other, folders[2]])))
    both, alone = figure.axes[:2]
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


def test_the_learner_the_papers_rules_and_the_best_others_are_named(tmp_path):
    rules = {"random": 1.0, "rows": 2.0, "place": 14.0, "fan": 13.0, "history": 1.5, "full": 16.0}
    rules |= {"care": 12.0, "all-camera": 1.8}
    rows = [(rule, 0, "CARE-Dense-v0", 0.0, metres) for rule, metres in rules.items()]
    rows.append(("learner", 0, "CARE-Dense-v0", 0.0, 5.0))
    run = read_run(written(tmp_path / "run", PpoConfig(), 1, rows))
    above, below = curves_figure([[run]]).axes
    names = {text.get_text() for text in above.texts}
    assert names == {"ppo", "full", "care", "history", "all-camera", "place", "fan"}
    for axes in (above, below):
        assert [line.get_color() for line in axes.lines].count(CALM) == 2


@pytest.mark.filterwarnings("error")
def test_a_street_is_scored_by_its_return_and_may_be_evaluated_once_alone(tmp_path):
    rows = [(name, 0, "CARE-Street-v0", -9.0, None) for name in (*RULES, "learner")]
    run = read_run(written(tmp_path / "street", PpoConfig(env="CARE-Street-v0"), 1, rows))
    assert (run.steps, run.scores().tolist()) == ([0], [-9.0])
    axes = curves_figure([[run]]).axes[0]
    assert (axes.get_ylabel(), axes.get_xlim()[0]) == ("return", 0)


def drawn_by_command(folders, tmp_path):
    with pytest.raises(SystemExit) as end:
        main(["train", "curves", *map(str, folders), "--out", str(tmp_path / "new" / "curves.png")])
    return end.value.code


@pytest.mark.filterwarnings("error")
def test_the_command_draws_both_forms_and_names_as_they_are(folders, tmp_path, capsys):
    name = "my $rule_{\u5b66"
    text = (folders[0] / "episodes.csv").read_text()
    (folders[0] / "episodes.csv").write_text(text.replace("care,", f"{name},"))
    config = json.loads((folders[0] / "config.json").read_text())
    (folders[0] / "config.json").write_text(json.dumps(config | {"env": "E $x^$ $\\frac$\x00"}))
    assert drawn_by_command(folders, tmp_path) == 0
    said = capsys.readouterr().out
    assert "Training runs" in said
    assert said.strip().endswith("curves.png")
    assert (tmp_path / "new" / "curves.png").stat().st_size > 1000
    assert f">{name}</text>" in (tmp_path / "new" / "curves.svg").read_text()


@pytest.mark.parametrize("name", ["config.json", "curve.csv", "episodes.csv"])
def test_a_folder_that_lacks_something_is_named(folders, name):
    (folders[0] / name).unlink()
    with pytest.raises(InvalidInput, match=f"run-0 holds no evaluated training run: no {name}"):
        read_run(folders[0])


HEAD = "steps,seconds,return,distance_m\n"
EPISODE = "policy,steps,seed,env,return,distance_m\ncare,"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("config.json", "{"),
        ("config.json", '{"a": ' + "[" * 100_000),
        ("config.json", "[1]"),
        ("config.json", '{"algorithm": "ppo", "env": "E", "budget": [], "episodes": 2}'),
        ("config.json", '{"algorithm": "ppo", "env": "E", "budget": ["a"], "episodes": 2}'),
        ("config.json", '{"algorithm": "ppo", "env": [], "budget": [0.1], "episodes": 2}'),
        ("config.json", '{"algorithm": "\\ud800", "env": "E", "budget": [0.1], "episodes": 2}'),
        ("config.json", '{"algorithm": ["ppo"], "env": "E", "budget": [0.1], "episodes": 2}'),
        ("curve.csv", ""),
        ("curve.csv", "steps\n100"),
        ("curve.csv", HEAD),
        ("curve.csv", f"{HEAD}1,2,nan,3\n"),
        ("curve.csv", f"{HEAD}1,2,1e300,3\n"),
        ("curve.csv", f"{HEAD}{10**300},2,1,3\n"),
        ("curve.csv", f"{HEAD}-1,2,1,3\n"),
        ("curve.csv", f"{HEAD}1,2,1,3,4\n"),
        ("curve.csv", f"{HEAD}1,2\0,1,3\n"),
        ("curve.csv", "\udcff"),
        ("curve.csv", f'{HEAD}1,2,"{"x" * 200_000}",3\n'),
        ("episodes.csv", f"{EPISODE}0,2000,E\n"),
        ("episodes.csv", f"{EPISODE}0,-1,E,1,\n"),
    ],
)
def test_files_of_somebody_else_are_one_line(folders, name, text, capsys, tmp_path):
    (folders[0] / name).write_bytes(text.encode(errors="surrogateescape"))
    assert drawn_by_command(folders[:1], tmp_path) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert len(said) < 500
    assert "run-0" in said


def test_the_middle_half_counts_alone():
    assert interquartile_mean(np.arange(1.0, 9.0)[None]).value == 4.5, "of 3, 4, 5 and 6"
    outliers = np.array([[-1e9, -50, 3, 4, 5, 6, 70, 1e9]])
    assert interquartile_mean(outliers) == (4.5, None, None), "a single run has no interval"
    # The paper's library too leaves one of five values out at either end.
    assert interquartile_mean([[1.0], [2.0], [3.0], [4.0], [100.0]]).value == 3.0


def test_runs_are_drawn_task_by_task_and_independently():
    """Tasks of different heights: a bootstrap over all scores alike would draw one task more often
    than the other, and give an interval where nothing varies. Runs that are better in one task as
    they are worse in the other would cancel if they were drawn together.
    """
    assert interquartile_mean([[1.0, 5.0]] * 3) == (3.0, 3.0, 3.0)
    value, low, high = interquartile_mean(np.array([[0.0, 1.0], [1.0, 0.0]] * 4))
    assert value == 0.5
    assert low < 0.4
    assert high > 0.6


def test_the_interval_is_as_wide_as_theory_says():
    """The interval of a mean-like statistic of n normal scores is about 2 * 1.96 * 1.09 / sqrt(n):
    the interquartile mean's deviation is 1.09 times the mean's.
    """
    scores = np.random.default_rng(3).normal(size=(400, 1))
    _, low, high = interquartile_mean(scores)
    assert high - low == pytest.approx(2 * 1.96 * 1.09 / 20, rel=0.15)


TABLES = arrays(float, st.tuples(st.integers(2, 5), st.integers(1, 3)),
                elements=st.floats(-100, 100).map(lambda value: round(value, 3)))  # fmt: skip


@settings(max_examples=15)
@given(scores=TABLES)
def test_an_interval_holds_its_value_and_moves_with_the_scores(scores):
    value, low, high = interquartile_mean(scores)
    assert scores.min() - 1e-9 <= low <= high <= scores.max() + 1e-9
    np.testing.assert_allclose(
        interquartile_mean(2 * scores + 1), 2 * np.array([value, low, high]) + 1, atol=1e-6
    )


def test_a_profile_is_the_share_above_each_level_and_runs_are_drawn_whole():
    profile = performance_profile([[0.0, 1.0], [2.0, 3.0]], [-1, 0, 0.5, 2, 3])
    assert [one.value for one in profile] == [1, 0.75, 0.75, 0.25, 0]
    assert profile[0][1:] == (1.0, 1.0)
    # One run is above the level in all of many episodes, the other in none: with so few runs the
    # share may be anything, however many episodes there are.
    scores = np.repeat([[0.0], [1.0]], 50, axis=1)
    assert performance_profile(scores, 0.5) == [(0.5, 0.0, 1.0)]
