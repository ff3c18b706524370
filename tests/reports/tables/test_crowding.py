import pytest

from care_sim.reports.table import Bold
from care_sim.reports.tables.crowding import Crowd, crowding_tables
from tests.helpers.made_rows import CROWD, rows


def test_the_tables_give_difference_interval_and_medians_of_every_policy():
    late = rows("uncertainty", [9.0] * 5, scenario_parameters=(("vehicles", 5),))
    gaps, intervals, joined, _, medians = crowding_tables([*CROWD, *late])
    assert [line[:2] for line in gaps.rows] == [
        ("0", "+0.0"), ("5", Bold("-0.5")), ("9", Bold("-7.0*")), ("12", Bold("≤-12.0*")),
    ]  # fmt: skip
    assert [isinstance(line[1], Bold) for line in gaps.rows] == [False, True, True, True]
    assert gaps.notes[0].endswith("interval without 0: 3%: 9, 12.")
    assert intervals.rows[2] == ("9", "-7.0* [-7.0,-7.0]")
    assert joined.title.endswith("first detection of uncertainty minus care, m")
    assert joined.rows[1] == ("5", "-6.0*")
    assert medians.title.endswith("care/all-camera/uncertainty, m")
    assert medians.rows[1] == ("5", "15.0/14.5/9.0", "15.0")
    assert medians.rows[3] == ("12", "15.0/n.d./-", "15.0")


@pytest.mark.parametrize(
    ("camera", "collapsed"),
    [
        ([12.0] * 5, [5]),
        ([12.1] * 5, []),
        ([15.0, 15.0, 15.0, 15.0, None], []),
        ([8.0], []),
    ],
)
def test_a_collapse_needs_three_metres_and_an_interval_without_zero(camera, collapsed):
    study = [*rows("all-camera", camera), *rows("care", [15.0] * len(camera))]
    assert Crowd([row | {"scenario.vehicles": 5} for row in study]).collapsed(0.03) == collapsed
