"""Levels by hardware, and the lead of the policy that knows it, with known answers."""

from care_sim.reports.tables.firing import firing_tables
from care_sim.study.designs.firing import FIRINGS, firing_study
from tests.helpers.made_plays import study
from tests.helpers.made_rows import row


def distance(config):
    """Tiles cost every policy a metre but the one that knows them."""
    return 14.0 if config.firing == "tiles:4x8" and config.policy != "care-units" else 15.0


def test_first_detections_have_a_column_a_hardware_and_leads_are_paired_by_seed():
    rows = [row(config, distance(config)) for config in firing_study(range(3))]
    levels, leads = firing_tables(rows)
    assert levels.columns == ("policy", "budget", *FIRINGS)
    assert levels.rows[1] == ("care", "3%", "15.0", "14.0", *["15.0"] * 6)
    assert levels.rows[-1] == ("full", "100%", *["15.0"] * 8)
    assert [line[0] for line in leads.rows[1:5]] == ["care", "care-sightlines", "rows", "place"]
    assert leads.rows[1][2:4] == ("+0.0 [0.0,0.0]", "+1.0 [1.0,1.0]")
    # Without the policy that knows its hardware there is no lead.
    assert len(firing_tables([each for each in rows if each["policy"] == "full"])) == 1


def test_recalls_stand_by_hardware_and_leads_are_paired_by_scene():
    common = {"budgets": (0.1,), "seeds": (0,)}
    plays = [
        *study({"care": (6, 6), "care-units": (6, 6)}, **common),
        *study({"care": (2, 3), "care-units": (6, 5)}, firing="tiles", **common),
        *study({"full": (9, 8)}),
    ]
    levels, leads = firing_tables(plays)
    assert levels.columns == ("policy", "budget", "cells", "tiles:4x8")
    assert levels.rows[1] == ("care", "10%", "30.0", "10.0")
    assert levels.rows[3] == ("full", "100%", "45.0", "45.0")
    assert leads.rows[1] == ("care", "10%", "+0.0 [0.0,0.0]", "+20.0 [20.0,20.0]")
