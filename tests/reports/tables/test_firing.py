"""Levels by hardware, and the lead of the policy that knows it, in the open loop. The published
rows hold the numbers of the closed loop.
"""

from care_sim.reports.tables.sweep import firing_tables
from tests.helpers.made_plays import study


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
    # Without the policy that knows its hardware there is no lead.
    assert len(firing_tables([each for each in plays if each["policy"] != "care-units"])) == 1
