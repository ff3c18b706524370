"""Files of figures, and the figures of the closed loop's studies on rows made by hand."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib import rc_context

from care_sim.reports.figures.closed_loop import (
    fault_figures,
    firing_figures,
    order_figures,
    sweep_figures,
    validation_figures,
)
from care_sim.reports.figures.study_maps import (
    ablation_figures,
    crowding_figures,
    open_ablation_figures,
)
from care_sim.reports.figures.styles import colours, remove_others, save, stem_of, svg_text
from care_sim.reports.report import StudyReport
from care_sim.reports.studies import STUDIES
from care_sim.study.designs.ablations import ablation_study
from care_sim.study.designs.faults import FAULTS, fault_study
from care_sim.study.designs.firing import ORDERS, firing_study, order_study
from care_sim.study.designs.variants import Variant
from tests.helpers import made_plays, made_worlds
from tests.helpers.drawn import heights, ticks, titles
from tests.helpers.made_rows import CROWD, STUDY, row, rows

SWEEP = [
    *STUDY,
    *rows("history", [None, None, None, 8.0, 9.0], budget=0.1),
    *rows("care", [15.0] * 5, budget=0.1),
]


def test_a_dot_in_the_name_of_a_figure_is_no_ending():
    assert stem_of(Path("curves-0.1")) == Path("curves-0.1")
    assert stem_of(Path("curves-0.1.svg")) == stem_of(Path("curves-0.1.png")) == Path("curves-0.1")


def test_figures_are_written_the_same_every_time(tmp_path):
    ((name, figure),) = sweep_figures(SWEEP).items()
    save(figure, tmp_path / name)
    assert (tmp_path / "dense-budget.png").read_bytes().startswith(b"\x89PNG")
    drawing = (tmp_path / "dense-budget.svg").read_text()
    assert drawing == svg_text(sweep_figures(SWEEP)[name], name)


def test_a_figure_keeps_a_name_with_dots(tmp_path):
    """As of `--detector-parameters file=net.pt` or `--false-negative-rate 0.2`."""
    (figure,) = sweep_figures(SWEEP).values()
    name = "levels-streets-torchscript-file-net.pt-false-negative-rate-0.2"
    report = StudyReport({}, {name: figure})
    report.write(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {f"{name}.png", f"{name}.svg"}


def test_texts_are_texts_of_anybody_on_a_transparent_ground():
    evil = [each | {"policy": "<b> $x^$ \x1b"} for each in SWEEP if each["policy"] == "history"]
    drawing = svg_text(sweep_figures([*SWEEP, *evil])["dense-budget"], "dense-budget")
    assert ">all-camera</text>" in drawing
    assert "&lt;b&gt; $x^$ \\x1b" in drawing
    assert "fill: #ffffff" not in drawing
    assert "date" not in drawing


def test_settings_of_the_user_change_no_figure():
    def drawn():
        return svg_text(StudyReport.of(SWEEP).figures["dense-budget"], "dense-budget")

    with rc_context({"axes.linewidth": 9, "font.family": "serif"}):
        styled = drawn()
    assert styled == drawn()


def test_only_figures_of_known_names_are_removed(tmp_path):
    for name in ("a.png", "a.svg", "b.png", "mine.png", "c-1.png", "c-2.svg", "c-1.txt", "c.png"):
        (tmp_path / name).touch()
    remove_others(tmp_path, ["a", "b", "c-*"], kept={"b", "c-2"})
    left = {"b.png", "mine.png", "c-2.svg", "c-1.txt", "c.png"}
    assert {path.name for path in tmp_path.iterdir()} == left


def test_a_sweep_has_the_medians_by_budget_and_quartiles_of_care():
    figure = sweep_figures(SWEEP)["dense-budget"]
    (axes,) = figure.axes
    shown = heights(axes)
    assert shown["history"] == [4.0, 0.0]
    assert shown["care"][1] == 15.0
    assert ticks(axes) == ["3%", "10%"]
    assert {*shown} == {"full scan", "care", "all-camera", "history"}
    bars = [drawn.get_segments()[0][:, 1].tolist() for drawn in axes.collections]
    assert bars == [[16.0, 18.0], [15.0, 15.0]]
    assert "bars: quartiles of care" in figure.get_supxlabel()
    assert sweep_figures(STUDY) == {}, "one budget makes no curve"


def test_the_crowding_map_has_a_number_in_every_cell_and_frames_the_collapse():
    axes = crowding_figures(CROWD)["crowding"].axes[0]
    texts = [text for text in axes.texts if text.get_text()]
    assert [text.get_text() for text in texts] == ["≤-12.0*", "-7.0*", "-0.5", "+0.0"]
    assert [text.get_weight() for text in texts] == ["bold", "bold", "bold", "normal"]
    assert [patch.get_y() + 0.5 for patch in axes.patches] == [1, 0]


def test_faults_have_a_figure_a_place_and_measure_with_a_panel_a_fault():
    configs = [c for c in fault_study([0, 1]) if c.scenario == "dartout"]
    made = [row(each, 9.0 - each.seed) | {"braked": each.seed == 0} for each in configs]
    figures = fault_figures(made)
    assert {*figures} == {name for name in STUDIES["faults"].figure_names if "dartout" in name}
    for name, height in (("detection", 8.5), ("braked", 50.0)):
        figure = figures[f"faults-dartout-{name}"]
        assert titles(figure) == [fault.title for fault in FAULTS]
        assert {*heights(figure.axes[0])["care"]} == {height}


def fired(config):
    """Tiles cost a metre on the default grid; rows never detect anybody with the mirror."""
    if config.policy == "full":
        return 16.0
    if config.sensor == "m1-forward":
        return None if config.firing == "rows" else 12.0 + config.budget * 10
    return 14.0 if config.firing == "tiles:4x8" else 15.0


def test_hardware_has_a_panel_a_set_up_with_every_unit_that_divides_its_grid():
    configs = firing_study([0], sensors=["hdl-32e", "m1-forward"])
    usual, mirror = firing_figures([row(one, fired(one)) for one in configs])["firing"].axes
    assert usual.get_title(loc="left") == "hdl-32e"
    assert heights(usual)["tiles:4x8"] == [14.0] * 3
    assert {*heights(usual)["full scan"]} == {16.0}
    shown = heights(mirror)
    fitting = {"cells", "rows", "columns", "vertical-window", "energy:4"}
    assert {*shown} == fitting | {"full scan"}
    assert (shown["cells"], shown["rows"]) == ([12.3, 12.5, 13.0], [0.0] * 3)
    one = [config for config in firing_study([0]) if config.budget in (0.1, 1.0)]
    assert firing_figures([row(config, 9.0) for config in one]) == {}


def ordered(config):
    """History never detects anybody on the dense street; the reserves grow by order."""
    if config.policy == "history":
        return None if config.scenario == "dense" else 8.0
    return 16.0 if config.policy == "full" else 10.0 + ORDERS.index(config.cell_order)


def test_orders_have_a_panel_a_place_that_was_played():
    made = [row(config, ordered(config)) for config in order_study([0])]
    figure = order_figures(made)["order"]
    assert titles(figure) == ["dartout, 3%", "dartout, 10%", "dense, 3%", "dense, 5%"]
    shown = heights(figure.axes[0])
    assert shown["care"] == [10.0, 11.0, 12.0, 13.0, 14.0, 15.0]
    assert (shown["history"], {*shown["full scan"]}) == ([8.0] * 6, {16.0})
    assert heights(figure.axes[2])["history"] == [0.0] * 6
    assert ticks(figure.axes[2]) == list(ORDERS)
    few = order_figures([each for each in made if each["scenario"] == "dense"])["order"]
    assert titles(few) == ["dense, 3%", "dense, 5%"]
    assert order_figures([each for each in made if each["scenario"] == "cutin"]) == {}


def test_a_validation_has_every_world_with_the_factor_that_is_changed():
    figure = validation_figures(made_worlds.STUDY)["validation"]
    found, hit = figure.axes
    assert ticks(hit) == ["dartout", "mirrored drawn"]
    assert titles(figure)[0] == "first detection, median, m: budget 3%"
    assert figure.get_suptitle() == "dartout, then with one factor changed: 6 test seeds"
    assert heights(found)["care"] == [16.0, 15.0]
    assert heights(found)["best control"] == [16.0, 10.0]
    assert heights(hit)["history"] == [0.0, 100.0]
    assert "best control of dartout: " in figure.get_supxlabel()


def test_the_validation_of_one_world_is_over_the_budget():
    one = [
        *made_worlds.world(made_worlds.SATURATED, made_worlds.TRAINING),
        *made_worlds.world(made_worlds.TELLING, made_worlds.TRAINING, budget=0.1),
    ]
    found, hit = validation_figures(one)["validation"].axes
    assert ticks(found) == ticks(hit) == ["3%", "10%"]
    assert heights(found)["care"] == [16.0, 15.0]
    assert heights(hit)["history"] == [0.0, 100.0]
    assert hit.get_title("left") == "episodes with a collision, %"


def test_no_two_policies_of_a_figure_have_one_colour():
    known = ["care-sector", "place", "fan", "theirs", "mine", "history-place"]
    assert len({*colours(known).values()}) == len(known)


def ablated(config):
    """A small reserve costs 2 m on the dense street; a late camera up to 1.5 m, by the seed."""
    if config.policy == "care" and config.scenario == "dense" and config.reserve_fraction == 0.15:
        return 14.0
    if config.policy == "care" and config.camera_latency == 1:
        return 16.0 - 0.5 * (config.seed % 4)
    return 16.0


def cells(figure):
    """Text, weight and value of every cell of a map, by the names of its line and column."""
    (axes,) = figure.axes
    lines = [label.get_text() for label in axes.get_yticklabels()]
    values = np.ma.filled(axes.images[0].get_array(), np.nan)
    return {
        (lines[y], ticks(axes)[x]): (text.get_text(), text.get_weight(), values[y, x])
        for text in axes.texts
        for x, y in [text.get_position()]
    }


def test_an_ablation_has_a_line_a_level_that_was_played_with_its_difference_to_the_usual():
    made = [row(config, ablated(config)) for config in ablation_study(range(5))]
    shown = cells(ablation_figures(made)["ablations"])
    level = "care, reserve fraction rho: 0.15"
    assert shown[level, "dense, 2%"] == ("-2.0", "bold", -2.0)
    assert shown[level, "dartout, 3%"] == ("+0.0", "normal", 0.0)
    assert not any(line.endswith("rho: 0.3") for line, _ in shown), "the usual level"
    few = [each for each in made if each["camera_latency"] == 0]
    assert not any(
        "age of the camera" in line for line, _ in cells(*ablation_figures(few).values())
    )
    assert ablation_figures([each for each in made if each["policy"] == "history"]) == {}


def test_an_ablation_of_the_open_loop_has_a_column_a_budget_and_measure():
    late = Variant("1", {"camera_latency": 1})
    plays = made_plays.study({"care": (8, 6)}, seeds=(0,), budgets=(0.1,)) + made_plays.study(
        {"care": (5, 6)}, seeds=(0,), budgets=(0.1,), **late.changes
    )
    shown = cells(open_ablation_figures(plays)["ablations-open-loop"])
    level = "care, age of the camera's detections, keyframes: 1"
    assert shown[level, "first sightings, 10%"][2] == pytest.approx(-15.0)
    assert shown[level, "all below 20 m, 10%"][2] == pytest.approx(0.0)
