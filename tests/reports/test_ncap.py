"""Scores, tables and the figure of the Euro NCAP tests, from rows made by hand."""

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.reports.figures.study_maps import ncap_figures
from care_sim.reports.ncap import NcapRows, impact_of, overall
from care_sim.reports.table import Bold
from care_sim.reports.tables.ncap import ncap_tables
from care_sim.study.designs.ncap import NcapCase
from care_sim.study.episode_config import grid
from care_sim.study.rows.reading import with_added_columns
from tests.helpers.made_rows import row

SEEDS = range(5)


def played(policy, test, impacts, ego=20.0, target=5.0, reported=None, budget=0.03):
    """A row a seed, with these speeds of impact in km/h, None without one."""
    case = NcapCase(test, ego, target, reported)
    configs = grid(
        ["ncap"], [policy], [budget], range(len(impacts)), scenario_parameters=case.parameters
    )
    return [
        row(
            config,
            9.0,
            collision=impact is not None,
            impact_speed_mps=None if impact is None else impact / 3.6,
        )
        for config, impact in zip(configs, impacts, strict=True)
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


def test_endings_and_scores_of_tests_and_in_all():
    table = ncap_tables(MADE)[0]
    assert table.columns == ("test", "full", "care", "fan")
    assert table.rows == (
        ("budget 3%",),
        ("CPNCO-50 reported", "5/0/0 5.00", "5/0/0 5.00", "0/5/0 2.00"),
        ("CPNCO-50 unreported", "5/0/0 5.00", "0/5/0 2.00", "0/0/5 0.00"),
        ("CPNA-25", "5/0/0 5.00", "5/0/0 5.00", "1/4/0 2.60"),
        ("in all, cars reported", "10/0/0 5.00", "10/0/0 5.00", "1/9/0 2.30"),
        ("in all, cars unreported", "10/0/0 5.00", "5/5/0 3.50", "1/4/5 1.30"),
    )


def test_differences_in_all_against_care_and_the_best_control():
    rows = ncap_tables(MADE)[1].rows
    assert [line[0] for line in rows] == [
        "in all, cars reported: minus care",
        "fan",
        "full",
        "in all, cars reported: minus the best control",
        "best control",
        "care",
        "full",
        "in all, cars unreported: minus care",
        "fan",
        "full",
        "in all, cars unreported: minus the best control",
        "best control",
        "care",
        "full",
    ]
    # By seed the fan has 2.00 four times and 3.50 once, CARE always 5: minus 3 and minus 1.5.
    assert rows[1][1].startswith("-2.70 [-3.00,")
    assert isinstance(rows[1][1], Bold)
    assert rows[4] == ("best control", "fan")
    assert rows[9] == ("full", "+1.50 [1.50,1.50]")


def test_every_test_weighs_the_same_however_many_speeds_it_has():
    slow = [played("care", "CPNA-25", [None], ego=speed) for speed in (10.0, 20.0, 30.0)]
    rows = NcapRows(study(*slow, played("care", "CPFA-50", [20.0], target=8.0)))
    assert overall(rows.scores(("care", 0.03), rows.lines)) == pytest.approx(2.5)


def test_only_shared_seeds_and_cases_are_pairs():
    ours = played("care", "CPNA-25", [None, None, None])
    theirs = played("history", "CPNA-25", [None, 10.0])
    theirs += played("history", "CPNA-75", [20.0, 20.0])
    rows = NcapRows(study(ours, theirs))
    found = rows.difference(("care", 0.03), ("history", 0.03), rows.lines)
    assert found.difference.pairs == 2
    assert found.mean == pytest.approx(1.5)
    assert rows.difference(("care", 0.03), ("fan", 0.03), rows.lines) is None


@pytest.mark.parametrize(
    ("test", "ego", "target", "expected"),
    [
        ("CPNA-25", 50.0, 5.0, (30.0, 50.0)),
        # A target that goes ahead: the speeds of closing.
        ("CPLA-50", 50.0, 5.0, (25.0, 45.0)),
        ("CCRm", 80.0, 20.0, (10.0, 60.0)),
        ("CCRs", 50.0, 0.0, (30.0, 50.0)),
        ("CCRb", 50.0, 50.0, (30.0, 50.0)),
    ],
)
def test_speeds_of_impact_and_reference(test, ego, target, expected):
    (one,) = played("care", test, [30.0], ego=ego, target=target)
    assert [3.6 * speed for speed in impact_of(one)] == pytest.approx(expected)


def test_a_test_that_nobody_knows_is_one_line():
    (one,) = played("care", "CPNA-25", [None])
    with pytest.raises(InvalidInput, match="unknown test 'CPXX'"):
        impact_of({**one, "scenario.test": "CPXX"})


def test_the_figure_has_a_panel_for_every_policy_and_budget():
    more = [*MADE, *study(played("care", "CPNA-25", [20.0] * 5, ego=40.0, budget=0.1))]
    figure = ncap_figures(more)["ncap"]
    panels = [axes for axes in figure.axes if axes.images and axes.get_title(loc="left")]
    titles = [axes.get_title(loc="left") for axes in panels]
    assert titles == ["full, 100%", "care, 3%", "fan, 3%", "full, 100%", "care, 10%", "fan, 10%"]
    assert [label.get_text() for label in panels[-1].get_xticklabels()] == ["20", "40"]
    care = panels[1].images[0].get_array()
    # Lines downwards, speeds to the right: 20 and 40 km/h.
    assert np.ma.filled(care, np.nan)[:, 0] == pytest.approx([5.0, 2.0, 5.0])
    assert np.all(np.ma.getmaskarray(care)[:, 1] | np.isnan(np.ma.filled(care, np.nan))[:, 1])
    assert np.ma.filled(panels[4].images[0].get_array(), np.nan)[2, 1] == pytest.approx(2.0)


def test_a_study_without_controls_care_or_a_full_scan_has_its_tables():
    rows = study(played("history", "CPNA-25", [None]))
    (table,) = ncap_tables(rows)
    assert table.rows[-1] == ("in all", "1/0/0 5.00")
    full = study(played("full", "CPNA-25", [None]))
    assert ncap_tables(full)[0].rows[0] == ("budget 100%",)
    assert ncap_figures(full)["ncap"].axes
