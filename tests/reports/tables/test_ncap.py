"""Scores, tables and the figure of the Euro NCAP tests, from rows made by hand."""

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.reports.figures.study_maps import ncap_figures
from care_sim.reports.table import Bold
from care_sim.reports.tables.ncap import impact_of, ncap_headline, ncap_tables
from care_sim.study.designs.standards import NcapCase
from care_sim.study.episode_config import grid
from care_sim.study.rows.reading import with_added_columns
from tests.helpers.made_rows import row


def played(policy, test, impacts, ego=20.0, target=5.0, reported=None, budget=0.03):
    """A row a seed, with these speeds of impact in km/h, None without one."""
    case = NcapCase(test, ego, target, reported)
    configs = grid(
        ["ncap"], [policy], [budget], range(len(impacts)), scenario_parameters=case.parameters
    )
    return [
        row(config, 9.0, collision=kph is not None, impact_speed_mps=kph and kph / 3.6)
        for config, kph in zip(configs, impacts, strict=True)
    ]


def study(*groups):
    return with_added_columns([one for group in groups for one in group])


MADE = study(
    played("full", "CPNA-25", [None] * 5),
    played("full", "CPNCO-50", [None] * 5, reported=True),
    played("full", "CPNCO-50", [None] * 5, reported=False),
    played("care", "CPNA-25", [None] * 5),
    played("care", "CPNCO-50", [None] * 5, reported=True),
    played("care", "CPNCO-50", [10.0] * 5, reported=False),
    played("fan", "CPNA-25", [10.0, 10.0, 10.0, 10.0, None]),
    played("fan", "CPNCO-50", [10.0] * 5, reported=True),
    played("fan", "CPNCO-50", [20.0] * 5, reported=False),
)


def test_endings_scores_and_their_differences_by_test_and_in_all():
    endings, differences = ncap_tables(MADE)
    in_all = (
        ("in all, cars reported", "10/0/0 5.00", "10/0/0 5.00", "1/9/0 2.30"),
        ("in all, cars unreported", "10/0/0 5.00", "5/5/0 3.50", "1/4/5 1.30"),
    )
    assert endings.columns == ("test", "full", "care", "fan")
    assert endings.rows[2] == ("CPNCO-50 unreported", "5/0/0 5.00", "0/5/0 2.00", "0/0/5 0.00")
    assert endings.rows[-2:] == in_all == ncap_headline(MADE).rows[1:]
    assert [line[0] for line in differences.rows[:7]] == [
        *("in all, cars reported: minus care", "fan", "full"),
        *("in all, cars reported: minus the best control", "best control", "care", "full"),
    ]
    # By seed the fan has 2.00 four times and 3.50 once, CARE always 5: minus 3 and minus 1.5.
    assert differences.rows[1][1].startswith("-2.70 [-3.00,")
    assert isinstance(differences.rows[1][1], Bold)
    assert differences.rows[4] == ("best control", "fan")
    assert differences.rows[9] == ("full", "+1.50 [1.50,1.50]")


def test_every_test_weighs_the_same_and_only_shared_seeds_and_cases_are_pairs():
    slow = [played("care", "CPNA-25", [None], ego=speed) for speed in (10.0, 20.0, 30.0)]
    table, *_ = ncap_tables(study(*slow, played("care", "CPFA-50", [20.0], target=8.0)))
    assert table.rows[-1] == ("in all", "3/0/1 2.50")
    theirs = [
        *played("history", "CPNA-25", [None, 10.0]),
        *played("history", "CPNA-75", [20.0] * 2),
    ]
    rows = study(played("care", "CPNA-25", [None] * 3), theirs, played("fan", "CPNA-75", [None]))
    assert ncap_tables(rows)[1].rows[1:3] == (("history", "-1.50 [-3.00,0.00]"), ("fan", ""))


def test_speeds_of_impact_are_those_of_closing_on_a_target_that_goes_ahead():
    for test, expected in (("CPNA-25", (30.0, 50.0)), ("CPLA-50", (25.0, 45.0))):
        (one,) = played("care", test, [30.0], ego=50.0)
        assert [3.6 * speed for speed in impact_of(one)] == pytest.approx(expected)
    with pytest.raises(InvalidInput, match="unknown test 'CPXX'"):
        impact_of({**one, "scenario.test": "CPXX"})


def test_the_figure_has_a_panel_for_every_policy_and_budget():
    more = [*MADE, *study(played("care", "CPNA-25", [20.0] * 5, ego=40.0, budget=0.1))]
    figure = ncap_figures(more)["ncap"]
    panels = {
        axes.get_title(loc="left"): np.ma.filled(axes.images[0].get_array(), np.nan)
        for axes in figure.axes
        if axes.images
    }
    assert {"full, 100%", "fan, 3%", "fan, 10%"} < {*panels}
    # Lines downwards, speeds to the right: 20 and 40 km/h.
    assert panels["care, 3%"][:, 0] == pytest.approx([5.0, 2.0, 5.0])
    assert np.isnan(panels["care, 3%"][:, 1]).all()
    assert panels["care, 10%"][2, 1] == pytest.approx(2.0)


def test_full_scans_alone_have_their_tables():
    full = study(played("full", "CPNA-25", [None]))
    (table,) = ncap_tables(full)
    line = "1/0/0 5.00"
    assert table.rows == (("budget 100%",), ("CPNA-25", line), ("in all", line))
    assert ncap_figures(full)["ncap"].axes
