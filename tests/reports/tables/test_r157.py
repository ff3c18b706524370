import numpy as np

from care_sim.reports.figures.study_maps import r157_figures
from care_sim.reports.tables.r157 import r157_tables
from tests.helpers.drawn import ticks
from tests.helpers.made_rows import CUT_INS, cut_ins


def test_outcomes_of_every_policy_with_differences_of_pairs():
    """History collides in cut-ins at 40, 40 and 60 km/h; the impacts of 40 and 39.5 are hits."""
    outcomes, speeds = r157_tables(CUT_INS)
    assert outcomes.title == "Preventable cut-ins, driver fixed: what became of them"
    heading, history, care, fan, stride, full, wider, care_3, full_3 = outcomes.rows
    assert (heading, wider) == (("budget 1%, best control fan",), ("budget 3%",))
    assert history[:6] == ("history", "4", "25.0%", "1", "2", "39")
    assert history[6:] == ("-75 [-100,-25]", "-50 [-100,0]")
    assert care == ("care", "4", "100.0%", "0", "0", "", "", "+25 [0,75]")
    assert fan[6:] == ("-25 [-75,0]", "")
    assert stride[2:6] == ("50.0%", "2", "0", "40")
    assert full[:6] == ("full", *care[1:6])
    assert (care_3[2], full_3[6]) == ("75.0%", "+25 [0,75]")
    assert speeds.columns == ("policy", "40 km/h", "60 km/h")
    assert speeds.rows[1] == ("history", "0/2", "1/2")
    assert speeds.rows[-2] == ("care", "2/2", "1/2")


def test_only_worlds_that_both_have_met_are_compared():
    outcomes, _ = r157_tables([*CUT_INS[:4], *CUT_INS[5:7]])
    heading, history, _ = outcomes.rows
    assert heading == ("budget 1%",)
    # A pair at 40 km/h, and one at 60 km/h.
    assert history[6:] == ("-100 [-100,-100]", "")


def test_the_best_control_is_chosen_on_what_all_controls_have():
    """Stride has only the case that it avoids; there, both are alike, and the first is taken."""
    rows = [*cut_ins("fan", [None, 40.0, 50.0, 50.0], tags="control")]
    rows += cut_ins("stride", [None] * 4, tags="control")[:1]
    assert r157_tables(rows)[0].rows[0] == ("budget 1%, best control fan",)


def test_a_panel_for_every_policy_and_budget_coloured_by_what_was_avoided():
    figure = r157_figures(CUT_INS)["r157-avoided"]
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    panels = [axes for axes, title in zip(figure.axes, titles, strict=True) if title]
    assert titles[:5] == ["history, 1%", "care, 1%", "fan, 1%", "stride, 1%", "full, every cell"]
    assert len(panels) == 10
    (shown,) = panels[0].images
    assert np.ma.filled(shown.get_array(), np.nan).tolist() == [[25.0]]
    assert ticks(panels[-1]) == ["20"]


def test_a_full_scan_alone_has_one_panel():
    figure = r157_figures(cut_ins("full", [None] * 4))["r157-avoided"]
    assert [title for axes in figure.axes if (title := axes.get_title(loc="left"))] == [
        "full, every cell"
    ]
