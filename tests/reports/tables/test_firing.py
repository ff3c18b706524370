"""First detections by hardware, on rows made by hand."""

from care_sim.reports.tables.firing import firing_tables
from care_sim.study.designs.firing import FIRINGS, firing_study
from tests.helpers.made_rows import row


def distance(config):
    """Tiles cost every policy a metre but the one that knows them."""
    return 14.0 if config.firing == "tiles:4x8" and config.policy != "care-units" else 15.0


ROWS = [row(config, distance(config)) for config in firing_study(range(3))]


def test_a_policy_stands_once_a_budget_with_a_column_a_hardware():
    levels, _ = firing_tables(ROWS)
    assert levels.title == "dense: first detection by hardware, median, m"
    assert levels.columns == ("policy", "budget", *FIRINGS)
    assert levels.rows[0] == ("care", "3%", "15.0", "14.0", *["15.0"] * 6)
    assert levels.rows[-1] == ("full", "100%", *["15.0"] * 8)


def test_the_lead_is_that_of_the_policy_that_knows_its_hardware():
    _, leads = firing_tables(ROWS)
    assert leads.title == "dense: first detection by hardware, care-units minus each, m"
    assert [line[0] for line in leads.rows[:4]] == ["care", "care-sightlines", "rows", "place"]
    assert leads.rows[0][2:4] == ("+0.0 [0.0,0.0]", "+1.0 [1.0,1.0]")


def test_without_it_there_is_no_lead():
    (levels,) = firing_tables([each for each in ROWS if each["policy"] == "full"])
    assert [line[0] for line in levels.rows] == ["full"]
