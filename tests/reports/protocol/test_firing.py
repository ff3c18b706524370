"""Recalls by hardware, on plays with known answers."""

from care_sim.reports.protocol.firing import firing_tables
from tests.helpers.made_plays import study

FREE = {"care": (6, 6), "care-units": (6, 6)}
TILES = {"care": (2, 3), "care-units": (6, 5)}
ROWS = [
    *study(FREE, budgets=(0.1,), seeds=(0,)),
    *study(TILES, budgets=(0.1,), seeds=(0,), firing="tiles"),
    *study({"full": (9, 8)}),
]


def tables():
    return {table.title.partition(": ")[2]: table for table in firing_tables(ROWS)}


def test_recalls_stand_by_hardware_with_the_full_scan_beside():
    table = tables()["first-sighting recall by hardware, %"]
    assert table.columns == ("policy", "budget", "cells", "tiles:4x8")
    assert table.rows == (
        ("care", "10%", "30.0", "10.0"),
        ("care-units", "10%", "30.0", "30.0"),
        ("full", "100%", "45.0", "45.0"),
    )
    assert tables()["overall recall by hardware, %"].rows[0][2:] == ("60.0", "30.0")


def test_the_lead_is_paired_by_scene():
    table = tables()["first-sighting recall by hardware, care-units minus each, points"]
    assert table.rows == (("care", "10%", "+0.0 [0.0,0.0]", "+20.0 [20.0,20.0]"),)
