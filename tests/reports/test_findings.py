"""The best policy against the best control, of rows whose answers are known."""

import pytest

from care_sim.policies import tags_of
from care_sim.reports.findings import (
    gate_tables,
    leads_of_episodes,
    leads_of_plays,
    leads_tables,
    ties,
)
from care_sim.reports.table import Bold
from care_sim.study.episode_config import EpisodeConfig
from tests.helpers import made_plays
from tests.helpers.made_rows import row

SEEDS = range(6)
WAVERING = (15.0, 17.0, 16.0, 16.0, 15.5, 16.5)
SOMETIMES = (16.0, 16.0, 16.0, 16.0, 16.0, None)


def episodes(distances, seeds=SEEDS, budget=0.03, **more):
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
    return [lead.row[3:] for lead in leads_of_episodes(rows)]


@pytest.mark.parametrize(
    ("distances", "line", "sign"),
    [
        ({"care": 16.0, "fan": 12.0, "rows": 11.0}, ("fan", "+4.0*", "[4.0,4.0]", "care"), 1),
        ({"care": 10.0, "fan": 16.0}, ("fan", "-6.0*", "[-6.0,-6.0]", "fan"), -1),
        ({"care": 16.0, "fan": 16.0}, ("fan", "+0.0", "[0.0,0.0]", "no"), 0),
        ({"care": 16.1, "fan": WAVERING}, ("fan", "+0.1", "[-0.4,0.6]", "no"), 0),
        # Below the gate of 2.5 m.
        ({"care": 16.0, "fan": 15.0}, ("fan", "+1.0", "[1.0,1.0]", "no"), 1),
        # No control was played.
        ({"care": 16.0}, ("", "", "", ""), 0),
        # No car can have the oracle.
        ({"care": 16.0, "history-oracle": 20.0}, ("", "", "", ""), 0),
    ],
)  # fmt: skip
def test_the_best_stands_beside_the_best_control(distances, line, sign):
    (lead,) = leads_of_episodes(episodes({"history": 8.0, "full": 17.0, **distances}))
    assert lead.row == ("dense", "3%", "first detection, m", "care", *line)
    assert lead.sign == sign
    assert isinstance(lead.row[5], Bold) == (sign != 0)


@pytest.mark.parametrize("distances", [
    {"care": 16.0, "history-oracle": 20.0, "full": 17.0},
    {"fan": 16.0, "rows": 15.0, "full": 17.0},
    {"care": None, "history": None},
])  # fmt: skip
def test_where_nobody_is_to_compare_there_is_no_lead(distances):
    assert leads_of_episodes(episodes(distances)) == []
    assert leads_tables([]) == ties([]) == []


def test_fewer_than_five_shared_seeds_give_no_lead():
    assert leads_of_episodes(episodes({"care": 16.0, "history": 8.0}, seeds=range(4))) == []
    # Six seeds of each, of which four are shared.
    apart = [*episodes({"care": 16.0}), *episodes({"history": 8.0}, seeds=range(2, 8))]
    assert leads_of_episodes(apart) == []


def test_a_seed_that_a_policy_lacks_counts_for_nobody():
    rows = episodes({"care": (2.0, 16.0, 16.0, 16.0, 16.0, 16.0), "history": 15.0})
    # Care is behind by the mean of all seeds, and ahead on those that both have.
    without = [one for one in rows if (one["policy"], one["seed"]) != ("history", 0)]
    assert [lines(each)[0][0] for each in (rows, without)] == ["history", "care"]


def test_collisions_count_where_a_full_scan_prevents_them():
    hit = {"fan": {"collision": True}}
    rows = episodes({"care": 16.0, "fan": 16.0, "full": 17.0}, **hit)
    assert lines(rows)[1] == ("care", "fan", "+100*", "[100,100]", "care")
    assert lines([each for each in rows if each["policy"] != "full"]) == lines(rows)
    doomed = episodes({"care": 16.0, "fan": 8.0, "full": 17.0}, **hit, full={"collision": True})
    assert len(lines(doomed)) == 1


def test_a_bound_reaches_the_gate_only_where_the_worst_case_does():
    missed = (None, *(16.0,) * 29)
    for control, reaches in ((14.0, "no"), (4.0, "care")):
        (line,) = lines(episodes({"care": missed, "place": control}, seeds=range(30)))
        assert line[2].startswith("≤+")
        assert line[-1] == reaches


def test_the_sentence_counts_ties_leads_and_what_trails():
    at = {0.01: 15.0, 0.03: 12.0, 0.05: 20.0, 0.1: 16.0}
    rows = [
        one
        for budget, place in at.items()
        for one in episodes({"care": 16.0, "place": place}, budget=budget)
    ]
    leads = leads_of_episodes(rows)
    assert [lead.budget for lead in leads] == [*at]
    assert ties(leads) == [
        "The best control ties the best policy in 1 of 4 comparisons (first detection, m), leads "
        "in 1, trails in 2."
    ]
    (table,) = leads_tables(leads)
    assert [line[5] for line in table.rows] == ["+1.0", "+4.0*", "-4.0*", "+0.0"]


def test_conditions_can_be_left_out():
    late = [one | {"camera_latency": 2} for one in episodes({"care": 16.0, "fan": 15.0})]
    rows = [*late, *episodes({"care": 16.0, "fan": 15.0})]
    assert len(leads_of_episodes(rows)) == 2
    assert [lead.setting for lead in leads_of_episodes(rows, conditions=False)] == ["dense"]


def test_the_open_loop_has_its_leads_and_the_papers_gate():
    plays = made_plays.study(
        {"care": (12, 6), "history": (4, 6), "rows": (9, 6), "full": (15, 9)},
        seeds=(0,),
        budgets=(0.1,),
    )
    (lead,) = leads_of_plays(plays)
    assert lead.row[:6] == (
        "generated streets, detector returns", "10%", "first sightings, points", "care", "rows",
        "+15.0",
    )  # fmt: skip
    (gate,) = gate_tables(plays)
    assert gate.rows[0][3:6] == ("care", "history", "+40.0")
    assert gate.rows[0][-1] == "care"
    assert gate_tables([each | {"false_negative_rate": 0.2} for each in plays]) == []


def test_the_papers_gate_names_history_where_that_is_ahead():
    plays = made_plays.study({"care": (4, 6), "history": (12, 6)}, seeds=(0,), budgets=(0.1,))
    (gate,) = gate_tables(plays)
    assert gate.rows[0][-1] == "history"
