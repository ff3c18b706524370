"""The leaderboard: its order, who takes no place, what is compared."""

from dataclasses import replace

import pytest

from care_sim.reports.figures.leaderboard import leaderboard_figure, score_chart
from care_sim.reports.leaderboard import leaderboard_table, leads_table
from care_sim.reports.table import Bold
from care_sim.study.benchmark.suite import Entry
from tests.helpers.made_results import made_result

FULL = made_result("full", share=1)
GOOD = made_result("good", share=0.8)
PLACE = made_result("place", share=0.4, tags=("causal", "learned", "control"))
ORACLE = made_result("oracle", share=0.9, tags=("privileged",))
LOW = made_result("low", share=0.1)


def test_the_highest_score_comes_first_and_what_no_car_can_have_takes_no_place():
    table = leaderboard_table([LOW, PLACE, ORACLE, GOOD, FULL])
    assert [row[:2] for row in table.rows] == [
        ("", "full"),
        ("", "oracle †"),
        ("1", "good"),
        ("2", "place"),
        ("3", "low"),
    ]
    assert any(note.startswith("†") for note in table.notes)
    line = table.rows[2]
    assert line[3:5] == ("80.0", "80.0")
    assert line[2].startswith(line[6])


def test_each_is_held_against_the_control_where_that_was_played():
    same = made_result("same", share=0.4)
    leads = {row[1]: row[-1] for row in leaderboard_table([GOOD, PLACE, same, LOW]).rows}
    for result in (GOOD, LOW):
        lead = leads[result.entry.name]
        points = result.score().mean - PLACE.score().mean
        assert float(lead.split()[0]) == pytest.approx(points, abs=0.05)
        assert isinstance(lead, Bold)
    assert (leads["place"], leads["same"]) == ("", "+0.0 [0.0,0.0]")
    assert not isinstance(leads["same"], Bold)
    without = leaderboard_table([GOOD, LOW])
    assert without.columns[-1] == "ideal camera"
    assert {len(row) for row in without.rows} == {len(without.columns)}


def test_a_lead_in_one_part_alone_stands_under_that_part():
    lost = tuple(
        row._replace(reached=0) if (row.part, row.camera) == ("tests", "measured") else row
        for row in GOOD.rows
    )
    elsewhere = replace(GOOD, entry=Entry("elsewhere"), rows=lost)
    table = leads_table([GOOD, elsewhere, LOW], "good")
    assert table.columns == ("policy", "drives", "tests", "streets", "score, ideal camera")
    line, low = table.rows
    assert line[:2] + line[3:] == ("elsewhere", *["+0.0 [0.0,0.0]"] * 3)
    assert line[2].startswith("-80.0 [")
    assert [isinstance(cell, Bold) for cell in line] == [False, False, True, False, False]
    assert low[0] == "low"
    assert leads_table([GOOD, LOW], "place") is None
    assert leads_table([GOOD], "good") is None


def test_a_trial_says_that_it_is_one():
    tenth = [GOOD.cut_to_tenth(), LOW.cut_to_tenth()]
    for table in (leaderboard_table(tenth), leads_table(tenth, "good")):
        assert table.notes[0].startswith("A trial with the tenth of the worlds that --quick plays")


def test_equal_scores_of_one_name_stand_in_one_order_and_are_told_apart_by_their_code():
    two = [replace(GOOD, made_by={"policy_code": code}) for code in ("abcdefgh", "12345678")]
    names = [row[1] for row in leaderboard_table(two).rows]
    assert names == ["good #abcdefg", "good #1234567"]
    (axes,) = leaderboard_figure(two).axes
    assert [text.get_text() for text in axes.get_yticklabels()] == names[::-1]


def test_the_chart_shows_every_score_with_its_interval_and_who_uses_no_camera():
    seeing = replace(
        GOOD, rows=tuple(row._replace(hash=f"{row.camera} {row.hash}") for row in GOOD.rows)
    )
    scores = [each.score() for each in (LOW, PLACE, seeing)]
    (axes,) = score_chart([PLACE, seeing, LOW]).axes
    bars = [bar for container in axes.containers[1::2] for bar in container]
    assert [bar.get_width() for bar in bars] == pytest.approx([score.mean for score in scores])
    ends = [line.get_segments()[0][:, 0] for line in axes.collections]
    assert ends == [pytest.approx([score.low, score.high]) for score in scores]
    assert bars[0].get_facecolor() == bars[1].get_facecolor() != bars[2].get_facecolor()
