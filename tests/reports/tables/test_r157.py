import numpy as np

from care_sim.reports.collisions import CollisionRows
from care_sim.reports.figures.study_maps import r157_figures
from care_sim.reports.tables.r157 import cut_in_rows, r157_tables
from tests.helpers.drawn import ticks
from tests.helpers.made_rows import CUT_INS, cut_ins


def test_outcomes_of_every_policy_with_differences_of_pairs():
    """Of history's three collisions at 40, 40 and 60 km/h, those at 40 and 39.5 are hits."""
    outcomes, _ = r157_tables(CUT_INS)
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


def test_avoided_by_the_speed_of_the_ego():
    _, speeds = r157_tables(CUT_INS)
    assert speeds.columns == ("policy", "40 km/h", "60 km/h")
    assert speeds.rows[1] == ("history", "0/2", "1/2")
    assert speeds.rows[-2] == ("care", "2/2", "1/2")


def test_only_worlds_that_both_have_met_are_compared():
    study = cut_in_rows([*CUT_INS[:4], *CUT_INS[5:7]])
    contrast = study.difference("history", "care", 0.01)
    assert (contrast.difference.pairs, contrast.mean) == (2, -100.0)
    assert study.difference("history", "fan", 0.01) is None
    assert study.best_control(0.01) is None


def test_the_best_control_is_chosen_on_what_all_controls_have():
    """Stride has only the case that it avoids; there, both are alike, and the first is taken."""
    rows = [*cut_ins("fan", [None, 40.0, 50.0, 50.0], tags="control")]
    rows += cut_ins("stride", [None] * 4, tags="control")[:1]
    assert CollisionRows(rows, lambda row: 1.0).best_control(0.01) == "fan"


def test_a_panel_for_every_policy_and_budget_coloured_by_what_was_avoided():
    figure = r157_figures(CUT_INS)["r157-avoided"]
    panels = [axes for axes in figure.axes if axes.get_title(loc="left")]
    assert [axes.get_title(loc="left") for axes in panels[:5]] == [
        "history, 1%",
        "care, 1%",
        "fan, 1%",
        "stride, 1%",
        "full, every cell",
    ]
    assert len(panels) == 10
    (shown,) = panels[0].images
    assert np.ma.filled(shown.get_array(), np.nan).tolist() == [[25.0]]
    assert ticks(panels[-1]) == ["20"]
