"""The figure of learning curves, from folders as training writes them."""

import json

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.cli import main
from care_sim.training.config import PpoConfig, SacConfig
from care_sim.training.curves import grouped_runs, read_run
from care_sim.training.curves_figure import curves_figure

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


@pytest.fixture
def folders(tmp_path):
    configs = PpoConfig(seed=0), PpoConfig(seed=1), PpoConfig(env="CARE-Dartout-v0"), SacConfig()
    return [folder(tmp_path / f"run-{n}", config) for n, config in enumerate(configs)]


def learned(axes):
    (name,) = (text for text in axes.texts if text.get_text() == "ppo")
    return [line for line in axes.lines if line.get_color() == name.get_color()]


def test_runs_that_differ_by_their_seed_lie_together(folders):
    assert [len(group) for group in grouped_runs(map(read_run, folders))] == [2, 1, 1]


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
    assert all(f"<!-- {name} -->" in drawn for name in ("my $rule_{", "\\ud800\\x1b[31m\u5b66")), (
        "names beside the axes"
    )
