"""The best policy against the best control, and the table that ends a study, of rows whose answers
are known.
"""

import pytest

from care_sim.policies import tags_of
from care_sim.reports.findings import gate_tables, headline, leads, leads_tables, ties
from care_sim.reports.table import Bold
from care_sim.study.episode_config import EpisodeConfig
from tests.helpers import made_plays
from tests.helpers.made_rows import row

WAVERING = (15.0, 17.0, 16.0, 16.0, 15.5, 16.5)


def episodes(distances, seeds=range(6), budget=0.03, **more):
    """Rows of every seed by policy: a distance, or one a seed; None is never."""
    return [
        row(
            EpisodeConfig("dense", policy, 1.0 if policy == "full" else budget, seed),
            given[seed] if isinstance(given, tuple) else given,
            tags="+".join(tags_of(policy)),
            **more.get(policy, {}),
        )
        for policy, given in distances.items()
        for seed in seeds
    ]


def lines(rows):
    """Best, best control, difference, interval and gate of every lead."""
    return [lead.row[3:] for lead in leads(rows)]


@pytest.mark.parametrize(
    ("distances", "line", "sign"),
    [
        ({"care": 16.0, "fan": 12.0, "rows": 11.0}, ("fan", "+4.0*", "[4.0,4.0]", "care"), 1),
        ({"care": 10.0, "fan": 16.0}, ("fan", "-6.0*", "[-6.0,-6.0]", "fan"), -1),
        ({"care": 16.1, "fan": WAVERING}, ("fan", "+0.1", "[-0.4,0.6]", "no"), 0),
        # Below the gate of 2.5 m.
        ({"care": 16.0, "fan": 15.0}, ("fan", "+1.0", "[1.0,1.0]", "no"), 1),
        # No control was played, and no car can have the oracle.
        ({"care": 16.0, "history-oracle": 20.0}, ("", "", "", ""), 0),
    ],
)  # fmt: skip
def test_the_best_stands_beside_the_best_control(distances, line, sign):
    (lead,) = leads(episodes({"history": 8.0, "full": 17.0, **distances}))
    assert lead.row == ("dense", "3%", "first detection, m", "care", *line)
    assert lead.sign == sign
    assert isinstance(lead.row[5], Bold) == (sign != 0)


def test_where_nobody_is_to_compare_there_is_no_lead():
    for distances in (
        {"care": 16.0, "history-oracle": 20.0, "full": 17.0},
        {"fan": 16.0, "rows": 15.0, "full": 17.0},
        {"care": None, "history": None},
    ):
        assert leads_tables(episodes(distances)) == ties(episodes(distances)) == []


def test_seeds_that_a_policy_lacks_count_for_nobody_and_four_are_too_few():
    rows = episodes({"care": (2.0, 16.0, 16.0, 16.0, 16.0, 16.0), "history": 15.0})
    # Care is behind by the mean of all seeds, and ahead on those that both have.
    without = [one for one in rows if (one["policy"], one["seed"]) != ("history", 0)]
    assert [lines(each)[0][0] for each in (rows, without)] == ["history", "care"]
    apart = [*episodes({"care": 16.0}), *episodes({"history": 8.0}, seeds=range(2, 8))]
    assert leads(apart) == []


def test_collisions_count_where_a_full_scan_prevents_them():
    hit = {"fan": {"collision": True}}
    rows = episodes({"care": 16.0, "fan": 16.0, "full": 17.0}, **hit)
    assert leads(rows)[1].row[2:] == (
        "collisions avoided, points", "care", "fan", "+100*", "[100,100]", "care"
    )  # fmt: skip
    assert lines([each for each in rows if each["policy"] != "full"]) == lines(rows)
    doomed = episodes({"care": 16.0, "fan": 8.0, "full": 17.0}, **hit, full={"collision": True})
    assert len(lines(doomed)) == 1


def test_a_bound_reaches_the_gate_only_where_the_worst_case_does():
    missed = (None, *(16.0,) * 29)
    for control, reaches in ((14.0, "no"), (4.0, "care")):
        (line,) = lines(episodes({"care": missed, "place": control}, seeds=range(30)))
        assert line[2].startswith("≤+")
        assert line[-1] == reaches


def test_the_sentence_counts_ties_leads_and_what_trails_in_plain_settings():
    at = {0.01: 15.0, 0.03: 12.0, 0.05: 20.0, 0.1: 16.0}
    rows = [
        one
        for budget, place in at.items()
        for one in episodes({"care": 16.0, "place": place}, budget=budget)
    ]
    late = [one | {"camera_latency": 2} for one in rows]
    assert ties([*late, *rows], plain=True) == [
        "The best control ties the best policy in 1 of 4 comparisons (first detection, m), leads "
        "in 1, trails in 2."
    ]
    assert "2 of 8 comparisons" in ties([*late, *rows])[0]
    (table,) = leads_tables(rows)
    assert [line[5] for line in table.rows] == ["+1.0", "+4.0*", "-4.0*", "+0.0"]
    # Without a plain setting those with conditions are shown.
    assert leads(late, plain=True)[0].setting == "dense, camera latency 2"


def test_medians_of_main_and_further_policies_and_of_the_best_control():
    distances = {
        "history": (4.0, 5.0, 6.0), "care": (15.0, 16.0, 17.0), "care-sbf": (15.0,) * 3,
        "random": (9.0,) * 3, "full": (18.0,) * 3, "rows": (12.0, 13.0, None),
    }  # fmt: skip
    # On the two seeds that both have, `rows` is ahead. The fan lacks the late one.
    rows = episodes(distances, range(3)) + episodes({"fan": (11.0, 12.0)}, range(2))
    table = headline(rows)
    assert table.columns == (
        "scenario", "budget", "history", "care", "random", "best control", "full",
    )  # fmt: skip
    assert table.rows == (("dense", "3%", "5.0", "16.0", "9.0", "12.0 rows", "18.0"),)


def test_the_open_loop_has_its_levels_its_leads_and_the_papers_gate():
    found = {"care": (12, 6), "history": (4, 6), "rows": (9, 6), "full": (15, 9)}
    plays = made_plays.study(found, seeds=(0,), budgets=(0.1,))
    table = headline(plays)
    assert table.columns[2:] == ("history", "care", "best control", "full")
    assert table.rows[0][1:] == ("10%", "20.0", "60.0", "45.0 rows", "75.0")
    (lead,) = leads(plays)
    assert lead.row[:6] == (
        "generated streets, detector returns", "10%", "first sightings, points", "care", "rows",
        "+15.0",
    )  # fmt: skip
    (gate,) = gate_tables(plays)
    assert gate.rows[0][3:6] == ("care", "history", "+40.0")
    assert gate.rows[0][-1] == "care"
    assert gate_tables([each | {"false_negative_rate": 0.2} for each in plays]) == []


def test_a_control_that_lacks_hard_scenes_is_not_the_best():
    """Place finds 10 of 20 events in the two scenes that it has, rows 12 there and none beyond."""
    plays = made_plays.study({"place": (10, 5), "rows": (12, 5)}, seeds=(0,), budgets=(0.1,))
    easy = ("scene 000", "scene 001")
    kept = [each for each in plays if each["policy"] == "rows" or each["scene"] in easy]
    for each in kept:
        if each["policy"] == "rows" and each["scene"] not in easy:
            each |= {"sighted": 0.0}
    assert headline(kept).rows[0][-2] == "20.0 rows"
