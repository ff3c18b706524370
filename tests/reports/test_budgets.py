"""The table and the figure of B90, by results made by hand."""

from dataclasses import replace

import pytest

from care_sim.evaluation.smallest_budget import BUDGETS
from care_sim.reports.budgets import (
    budget_tables,
    budgets_table,
    format_budget,
    format_ratio,
    ideas_table,
)
from care_sim.reports.figures.budgets import budgets_figure
from care_sim.reports.figures.leaderboard import leaderboard_figure
from care_sim.reports.figures.styles import CALM
from care_sim.reports.recorded import sources_table
from care_sim.reports.table import Bold
from care_sim.study.benchmark.suite import Entry
from tests.helpers.made_budgets import ALWAYS, HALF_WAY, NEVER, made_budgets

PLAIN = Entry("care-sector", (("residual", False),))
RESULTS = (
    made_budgets("boxes", NEVER, ALWAYS),
    made_budgets(PLAIN, (0.1, 0.2, 0.3, 0.8, 1.0, 1.0, 1.0), ALWAYS),
    made_budgets("care-sector", HALF_WAY, ALWAYS),
    made_budgets("full", ALWAYS),
    made_budgets("place", ALWAYS, ALWAYS, NEVER, NEVER),
)


def test_the_smallest_budget_comes_first_with_what_holds_it_back():
    rows = [tuple(map(str, row)) for row in budgets_table(RESULTS).rows]
    assert rows == [
        ("1", "care-sector", "2.4 [2.4, 2.4]", "emerging", "2.4", *["≤0.5"] * 3, ""),
        (
            "2",
            "care-sector residual=False",
            "3.9 [3.9, 3.9]",
            "emerging",
            "3.9",
            *["≤0.5"] * 3,
            "1.58 [1.58, 1.58]",
        ),
        # Entries that never get there are tied.
        (
            "3-4",
            "boxes",
            "never [never, never]",
            "emerging, 50.0% at 20%",
            "never",
            *["≤0.5"] * 3,
            "never",
        ),
        (
            "3-4",
            "place",
            "never [never, never]",
            "kept, 50.0% at 20% (+1)",
            *["≤0.5"] * 2,
            *["never"] * 2,
            "never",
        ),
        # The full scan takes no rank.
        ("", "full", "≤0.5 [≤0.5, ≤0.5]", "", *["≤0.5"] * 4, "0.20 [0.20, 0.20]"),
    ]


def test_results_without_a_rank_stand_below_all_others():
    late, early = (
        made_budgets(Entry("mine:Bound", label=label), curve, recorded=DRIVES, tags=("privileged",))
        for label, curve in (("late", HALF_WAY), ("early", ALWAYS))
    )
    entries = [made_budgets(name, NEVER, recorded=DRIVES) for name in ("care-sector", "boxes")]
    results = [late, early, *entries]
    order = ["care-sector", "boxes", "early (mine:Bound) †", "late (mine:Bound) †"]
    whole, *each = budget_tables(results)
    assert [row[:2] for row in whole.rows] == [*zip(["1-2", "1-2", "", ""], order, strict=True)]
    for table in each:
        assert [row[1] for row in table.rows] == order
    assert [row[0] for row in sources_table(results).rows] == order
    (axes,) = leaderboard_figure(results).axes
    assert [label.get_text() for label in axes.get_yticklabels()] == order[::-1]


def test_entries_whose_paired_ratio_includes_1_share_ranks():
    """One is ahead in 11 streets, the other one in 10, so that their B90 differ, but could be the
    other way round. Both are behind a third.
    """
    late = made_budgets("care", (0.1, 0.2, 0.3, 0.8, 1.0, 1.0, 1.0), streets=21)
    early = made_budgets("boxes", HALF_WAY, streets=21)
    pairs = list(zip(early.rows, late.rows, strict=True))
    rows = [tuple(pair[(n + k) % 2] for n, pair in enumerate(pairs)) for k in (0, 1)]
    tied = [replace(early, rows=rows[0]), replace(late, rows=rows[1])]
    assert tied[0].score.budget < tied[1].score.budget
    table = budgets_table([*tied, made_budgets("place", ALWAYS, streets=21)])
    assert [row[0] for row in table.rows] == ["1", "2-3", "2-3"]


def test_entries_whose_intervals_overlap_have_ranks_where_one_is_always_ahead():
    """Every second street is easy. On each street, one entry has 98% of what the other one has."""
    hard, easy = (0.0, 0.0, 0.1, 0.5, 0.9, 1.0, 1.0), (0.5, 0.8, 0.9, 1.0, 1.0, 1.0, 1.0)
    ahead, behind = (
        [made_budgets(name, [share * own for own in curve], streets=20) for curve in (hard, easy)]
        for name, share in (("care", 1.0), ("boxes", 0.98))
    )
    mixed = [replace(one, rows=one.rows[::2] + other.rows[1::2]) for one, other in (behind, ahead)]
    table = budgets_table(mixed)
    assert [row[:2] for row in table.rows] == [("1", "care"), ("2", "boxes")]
    assert mixed[1].score.high > mixed[0].score.low


def test_times_and_names_tell_entries_apart():
    slow = made_budgets(
        "mine:Mine", HALF_WAY, policy_ms=(1.25, 40.0), made_by={"policy_code": "ab"}
    )
    table = budgets_table([slow, made_budgets("mine:Mine", ALWAYS)])
    assert table.columns[-1] == "ms"
    assert [(row[1], row[-1]) for row in table.rows] == [
        ("mine:Mine #", ""),
        ("mine:Mine #ab", "1.2 / 40.0"),
    ]


def test_without_the_yardstick_there_are_no_ratios():
    table = budgets_table(RESULTS[:2])
    assert table.columns[-1] == "people kept"
    assert {len(row) for row in table.rows} == {len(table.columns)}
    assert "80 worlds (streets), centerpoint" in table.title


def test_a_trial_is_named_as_one():
    assert not any("trial" in note for note in budgets_table(RESULTS).notes)
    trial = budgets_table([made_budgets("care", HALF_WAY, quick=True)])
    assert any("trial" in note for note in trial.notes)


@pytest.mark.parametrize(
    ("budget", "text"), [(0.005, "≤0.5"), (0.0051, "0.5"), (0.2, "20.0"), (float("inf"), "never")]
)
def test_budgets_in_percent(budget, text):
    assert format_budget(budget) == text


DRIVES = [f"nuscenes/scene-{n:04d}" for n in range(5)]


def test_parts_stand_side_by_side_and_the_worse_one_is_the_score():
    results = [
        made_budgets("care-sector", HALF_WAY, recorded=DRIVES),
        made_budgets("tuned-place", ALWAYS, recorded=DRIVES, later=NEVER),
        made_budgets("boxes", NEVER, recorded=DRIVES, later=ALWAYS),
    ]
    whole, streets, drives = budget_tables(results)
    assert whole.columns[3:] == ("held back by", "streets", "recorded", "times care-sector")
    assert [tuple(map(str, row[1:6])) for row in whole.rows] == [
        ("care-sector", "2.4 [2.4, 2.4]", "streets: emerging (+7)", *["2.4 [2.4, 2.4]"] * 2),
        (
            "tuned-place",
            "never [never, never]",
            "recorded: emerging, 50.0% at 20% (+3)",
            "≤0.5 [≤0.5, ≤0.5]",
            "never [never, never]",
        ),
        (
            "boxes",
            "never [never, never]",
            "streets: emerging, 50.0% at 20% (+3)",
            "never [never, never]",
            "≤0.5 [≤0.5, ≤0.5]",
        ),
    ]
    assert "85 worlds (streets 80, recorded 5)" in whole.title
    assert "5 worlds (recorded)" in drives.title
    assert [row[1] for row in streets.rows] == ["tuned-place", "care-sector", "boxes"]
    assert [row[1] for row in drives.rows] == ["boxes", "care-sector", "tuned-place"]


def test_fewer_than_five_worlds_of_a_part_carry_no_interval():
    results = [
        made_budgets("care-sector", HALF_WAY, recorded=DRIVES[:4]),
        made_budgets(PLAIN, (0.1, 0.2, 0.3, 0.8, 1.0, 1.0, 1.0), ALWAYS, recorded=DRIVES[:4]),
    ]
    whole, streets, drives = budget_tables(results)
    assert [row[2] for row in whole.rows] == ["2.4", "3.9"]
    assert whole.rows[1][-1] == "1.58"
    assert not isinstance(whole.rows[1][-1], Bold)
    assert whole.rows[0][4:6] == ("2.4 [2.4, 2.4]", "2.4")
    assert [row[2] for row in streets.rows] == ["2.4 [2.4, 2.4]", "3.9 [3.9, 3.9]"]
    told = "Fewer than 5 worlds carry no interval."
    assert [told in table.notes[0] for table in (whole, streets, drives)] == [True, False, True]


def test_the_idea_that_is_worth_most_comes_first():
    whole = made_budgets("care-sector", HALF_WAY, recorded=DRIVES, later=HALF_WAY)
    later = made_budgets(PLAIN, (0.1, 0.2, 0.3, 0.8, 1.0, 1.0, 1.0), recorded=DRIVES)
    nothing = replace(whole, entry=Entry("care-sector", (("rows", False),)))
    never = made_budgets("boxes", HALF_WAY, recorded=DRIVES, later=NEVER)
    table = ideas_table(whole, {"rows": nothing, "camera": never, "residual": later})
    assert table.columns[3:] == ("times care-sector", "streets", "recorded")
    assert [(row[0], *row[2:]) for row in table.rows] == [
        (
            "without camera",
            "recorded: emerging, 50.0% at 20% (+3)",
            "never",
            "1.00 [1.00, 1.00]",
            "never",
        ),
        ("without residual", "streets: emerging (+7)", *["1.58 [1.58, 1.58]"] * 3),
        ("without rows", "streets: emerging (+7)", *["1.00 [1.00, 1.00]"] * 3),
    ]


def test_recorded_drives_by_source():
    names = [*(f"kitti/{n:04d}" for n in range(5)), *DRIVES[:2]]
    early, late = ALWAYS, HALF_WAY
    one = made_budgets("care", HALF_WAY, recorded=names, later=early)
    two = made_budgets("boxes", HALF_WAY, recorded=names, later=late)
    # In nuScenes alone the first one is late.
    rows = tuple(
        row._replace(got=other.got) if str(row.world).startswith("nuscenes") else row
        for row, other in zip(one.rows, two.rows, strict=True)
    )
    table = sources_table([replace(one, rows=rows), two])
    assert table.columns == ("policy", "all", "kitti", "nuscenes")
    assert [row[0] for row in table.rows] == ["care", "boxes"]
    assert [row[2:] for row in table.rows] == [
        ("≤0.5 [≤0.5, ≤0.5]", "2.4"),
        ("2.4 [2.4, 2.4]", "2.4"),
    ]
    # 5 drives have all, and 2 have 20% at 1% and 80% at 2%: 77 and 94% of all.
    assert table.rows[0][1].startswith("1.7 [")
    assert "nuscenes: 2 drives, a full scan has 16 emerging" in " ".join(table.notes)
    assert "actors were missed" not in table.markdown()


def test_a_figure_has_a_row_of_panels_per_part():
    figure = budgets_figure([made_budgets("care", HALF_WAY, recorded=DRIVES, later=NEVER)])
    assert len(figure.axes) == 8
    assert [axes.get_ylabel() for axes in figure.axes[::4]] == [
        "streets, % of a full scan's",
        "recorded, % of a full scan's",
    ]
    heights = [axes.get_lines()[1].get_ydata()[-1] for axes in figure.axes[::4]]
    assert heights == pytest.approx([100, 50])


def test_every_count_has_a_panel_and_every_entry_a_curve():
    figure = budgets_figure(RESULTS)
    assert [axes.get_title(loc="left") for axes in figure.axes] == [
        "emerging",
        "entering",
        "kept",
        "people kept",
    ]
    line, *curves = figure.axes[0].get_lines()
    assert {*line.get_ydata()} == {90.0}
    assert len(curves) == len(RESULTS)
    names = ["care-sector", "care-sector residual=False", "boxes", "place", "full"]
    assert {text.get_text() for text in figure.axes[-1].texts} == {*names}
    drawn = dict(zip(names, curves, strict=True))
    assert [*drawn["care-sector"].get_ydata()] == pytest.approx([10, 20, 80, 100, 100, 100, 100])
    assert [*drawn["boxes"].get_xdata()] == pytest.approx([100 * budget for budget in BUDGETS])
    # Entries of one policy have one colour and their own kind of line.
    one, other = drawn["care-sector"], drawn["care-sector residual=False"]
    assert one.get_color() == other.get_color() != drawn["boxes"].get_color()
    assert one.get_linestyle() != other.get_linestyle()


def test_the_first_seven_results_have_a_name_in_their_colour_and_others_are_grey():
    results = [made_budgets("place", HALF_WAY), *(made_budgets(f"p{n}", ALWAYS) for n in range(8))]
    *_, last = budgets_figure(results).axes
    names = {text.get_text(): text.get_color() for text in last.texts}
    assert {*names} == {"place", *(f"p{n}" for n in range(6))}
    drawn = [line.get_color() for line in last.get_lines()[1:]]
    assert sorted(drawn) == sorted([*names.values(), CALM, CALM])


def test_the_figure_of_the_leaderboard_has_a_line_per_entry_and_never_at_its_end():
    (axes,) = leaderboard_figure(RESULTS).axes
    names = [label.get_text() for label in axes.get_yticklabels()]
    assert names == ["full", "place", "boxes", "care-sector residual=False", "care-sector"]
    emerging, *_ = (dots.get_offsets() for dots in axes.collections)
    assert [*emerging[:, 0]] == pytest.approx([0.5, 0.5, 32.0, 3.87, 2.45], abs=0.01)
    assert axes.get_xticklabels()[-1].get_text() == "never"
    budgets = axes.lines[0].get_xdata()
    assert [*budgets] == pytest.approx([0.5, 32.0, 32.0, 3.87, 2.45], abs=0.01)


def test_few_worlds_rank_nobody():
    ranked, few = (
        [made_budgets("care-sector", HALF_WAY, streets=n), made_budgets("boxes", NEVER, streets=n)]
        for n in (5, 4)
    )
    assert [row[0] for row in budgets_table(ranked).rows] == ["1", "2"]
    table = budgets_table(few)
    assert [row[0] for row in table.rows] == ["", ""]
    assert not any("Tied" in note for note in table.notes)


def test_ratios_are_to_the_published_entry_of_the_name():
    own, published = made_budgets("care-sector", NEVER), made_budgets("care-sector", HALF_WAY)
    table = budgets_table([own, published])
    assert [row[-1] for row in table.rows] == ["", "never"]


def test_a_ratio_says_which_of_the_two_never_gets_there():
    found, never = made_budgets("care", HALF_WAY), made_budgets("boxes", NEVER)
    for text, told in (
        (format_ratio(found, never), "other never"),
        (format_ratio(never, found), "never"),
    ):
        assert (text, type(text)) == (told, Bold)
    assert format_ratio(never, never) == "both never"
    # In some draws of worlds, the second policy gets there.
    rows = (*found.rows[:60], *never.rows[60:])
    text = format_ratio(found, replace(never, rows=rows))
    assert text.startswith("other never [0.00, 0.8")
