"""The charts of the first-sighting protocol: what a pointer reads off the levels."""

import pytest

from tests.helpers.made_plays import found, play, study

pytest.importorskip("altair")

from care_sim.reports.page.protocol_charts import protocol_charts


def levels(rows):
    """The values of the chart of levels, by panel, policy and budget."""
    (chart,) = (each for each in protocol_charts(rows) if "against the budget" in each.title)
    return {
        (value["panel"], value["policy"], value["budget"]): value
        for value in chart.spec["data"]["values"]
        if value["by"] == "here"
    }


def test_a_level_tells_its_share_of_the_full_scans():
    shown = levels(study({"care": (6, 5), "full": (8, 8)}))
    assert shown["first-sighting recall", "care", "10%"]["of_full"] == "75 [75,75]"
    assert shown["overall recall", "care", "35%"]["of_full"] == "62 [62,62]"
    assert shown["overall recall", "full scan", "100%"]["of_full"] == "100"
    alone = levels(study({"care": (6, 5)}))
    assert {value["of_full"] for value in alone.values()} == {""}


def test_a_share_is_the_quotient_of_the_two_levels_beside_it():
    """The full scan finds nothing in the last scene, where CARE finds one event."""
    counts = {"care": (4, 1), "full": (4, 0)}
    rows = [
        play(f"{n}", policy, found(5, sighted), [sighted] * 5, budget=budget)
        for policy, both in counts.items()
        for budget in ((1.0,) if policy == "full" else (0.1, 0.2))
        for n, sighted in enumerate([both[0]] * 6 + [both[1]])
    ]
    shown = levels(rows)
    care, full = (
        shown["first-sighting recall", *each]["value"]
        for each in (("care", "10%"), ("full scan", "100%"))
    )
    share = shown["first-sighting recall", "care", "10%"]["of_full"]
    assert share.startswith(f"{100 * care / full:.0f} [")
    assert share == "104 [100,119]"
