from care_sim.reports.table import Bold
from care_sim.reports.tables.crowding import Crowd, crowding_tables
from care_sim.study.designs.crowding import crowding_study
from tests.helpers.made_rows import CROWD, rows


def test_the_tables_give_difference_interval_and_medians():
    gaps, intervals, medians = crowding_tables(CROWD)
    assert [line[0] for line in gaps.rows] == ["0", "5", "9", "12"]
    assert [line[1] for line in gaps.rows] == ["+0.0", "-0.5", "-7.0*", "≤-12.0*"]
    assert [isinstance(line[1], Bold) for line in gaps.rows] == [False, True, True, True]
    assert intervals.rows[2] == ("9", "-7.0* [-7.0,-7.0]")
    assert medians.rows[2] == ("9", "15.0/8.0", "15.0")
    assert medians.rows[3] == ("12", "15.0/n.d.", "15.0")
    assert gaps.notes[0].endswith("interval without 0: 3%: 9, 12.")


def test_a_collapse_needs_three_metres_and_an_interval_without_zero():
    def crowd(camera):
        study = [rows("all-camera", camera), rows("care", [15.0] * len(camera))]
        return Crowd([row | {"scenario.vehicles": 5} for policy in study for row in policy])

    assert crowd([12.0] * 5).collapsed(0.03) == [5]
    assert crowd([12.1] * 5).collapsed(0.03) == []
    assert crowd([15.0, 15.0, 15.0, 15.0, None]).collapsed(0.03) == []
    assert crowd([8.0]).collapsed(0.03) == []


def test_a_further_policy_is_compared_with_care_too():
    late = rows("uncertainty", [9.0] * 5, scenario_parameters=(("vehicles", 5),))
    tables = crowding_tables([*CROWD, *late])
    assert [table.title.partition(": ")[2] for table in tables] == [
        "first detection of all-camera minus care, m",
        "first detection of all-camera minus care, m, with intervals",
        "first detection of uncertainty minus care, m",
        "first detection of uncertainty minus care, m, with intervals",
        "median first detection, care/all-camera/uncertainty, m",
    ]
    assert tables[2].rows[1] == ("5", "-6.0*")
    assert tables[4].rows[1] == ("5", "15.0/14.5/9.0", "15.0")
    played = {config.policy for config in crowding_study([0], ["uncertainty"])}
    assert played == {"all-camera", "care", "full", "uncertainty"}
