import os
import subprocess
import sys

import numpy as np
import pytest

from care_sim.commands.options.studies import Protocol, Sweep
from care_sim.reports.figures.budget import sweep_figures
from care_sim.reports.figures.crowding import crowding_figures
from care_sim.reports.figures.files import remove_others, save
from care_sim.reports.figures.styles import styles
from care_sim.study.results_formats import EPISODES
from care_sim.study.rows.parquet import write_rows
from tests.helpers.made_rows import CROWD, STUDY, rows

OWN = ("care-spread", "care-priority")
SWEEP = [
    *STUDY,
    *rows("history", [None, None, None, 8.0, 9.0], budget=0.1),
    *rows("care", [15.0] * 5, budget=0.1),
]


@pytest.mark.parametrize(
    ("draw", "study", "name"),
    [(sweep_figures, SWEEP, "dense-budget"), (crowding_figures, CROWD, "crowding")],
)
def test_figures_are_written_the_same_every_time(draw, study, name, tmp_path):
    figures = draw(study)
    assert list(figures) == [name]
    save(figures[name], tmp_path / name)
    assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    drawing = (tmp_path / f"{name}.svg").read_text()
    save(draw(study)[name], tmp_path / name)
    assert (tmp_path / f"{name}.svg").read_text() == drawing


def test_settings_of_the_user_change_no_figure(tmp_path):
    for name in ("plain", "styled"):
        write_rows(SWEEP, tmp_path / name / EPISODES.file)
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\nlines.linewidth: 9\n")
    program = [sys.executable, "-c", "from care_sim.cli import main; main()"]
    settings = {"MATPLOTLIBRC": str(tmp_path), "MPLBACKEND": "none"}
    subprocess.run([*program, "report", tmp_path / "plain"], check=True, timeout=120)
    styled = [*program, "report", tmp_path / "styled"]
    subprocess.run(styled, check=True, timeout=120, env=os.environ | settings)
    for suffix in (".png", ".svg"):
        plain = (tmp_path / "plain" / "dense-budget").with_suffix(suffix)
        assert (tmp_path / "styled" / plain.name).read_bytes() == plain.read_bytes()


def test_one_budget_makes_no_curve():
    assert sweep_figures(STUDY) == {}


def test_the_figure_names_its_curves():
    (legend,) = sweep_figures(SWEEP)["dense-budget"].legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "full scan",
        "care",
        "all-camera",
        "history",
    ]


def test_a_median_that_is_not_detected_is_an_open_marker_at_the_bottom_with_the_count():
    axes = sweep_figures(SWEEP)["dense-budget"].axes[0]
    history = next(line for line in axes.lines if line.get_label() == "history")
    assert np.array_equal(history.get_ydata(), [4.0, np.nan], equal_nan=True)
    (hollow,) = [line for line in axes.lines if line.get_markerfacecolor() == "white"]
    assert (list(hollow.get_xdata()), list(hollow.get_ydata())) == ([0.1], [0.0])
    assert [text.get_text() for text in axes.texts] == ["3/5 never"]
    assert axes.get_ylim()[0] == 0.0


def test_policies_that_studies_play_share_no_marker():
    drawn = styles((name, ()) for name in {*Protocol.policies, *Sweep.policies, *OWN} - {"full"})
    assert len({style.marker for style in drawn.values()}) == len(drawn)


def test_every_policy_looks_different_and_those_no_car_can_have_are_dashed():
    names = (
        "history",
        "all-camera",
        "care",
        "care-sbf",
        "care-priority",
        "uncertainty",
        "random",
        "beam-reduce",
    )
    drawn = styles(
        [(name, ("causal",)) for name in (*names, "history-uniform", "installed", "another")]
    )
    drawn |= styles([("history-oracle", ("privileged",)), ("random-points", ("non-causal",))])
    assert len({(style.colour, style.marker) for style in drawn.values()}) == len(drawn) == 13
    assert [name for name, style in drawn.items() if style.line != "-"] == [
        "history-oracle",
        "random-points",
    ]


def test_the_heat_map_has_a_number_in_every_cell_and_frames_the_collapse():
    axes = crowding_figures(CROWD)["crowding"].axes[0]
    assert [text.get_text() for text in axes.texts] == ["+0.0", "-0.5", "-7.0*", "≤-12.0*"]
    assert [text.get_weight() for text in axes.texts] == ["normal", "bold", "bold", "bold"]
    assert [patch.get_y() + 0.5 for patch in axes.patches] == [2, 3]


def test_only_figures_of_known_names_are_removed(tmp_path):
    for name in ("a.png", "a.svg", "b.png", "mine.png", "c-1.png", "c-2.svg", "c-1.txt", "c.png"):
        (tmp_path / name).touch()
    remove_others(tmp_path, ["a", "b", "c-*"], kept={"b", "c-2"})
    assert {path.name for path in tmp_path.iterdir()} == {
        "b.png",
        "mine.png",
        "c-2.svg",
        "c-1.txt",
        "c.png",
    }
