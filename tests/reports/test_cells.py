from care_sim.reports.cells import StudyCells
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.rows.reading import key_of
from tests.helpers.made_rows import rows

ROWS = [
    *rows("care", [15.0, 16.0]),
    *(row | {"tags": "privileged"} for row in rows("history-oracle", [9.0, 12.0])),
]


def key(policy, **fields):
    return key_of(EpisodeConfig("dense", policy, 0.03, **fields).row())


def test_cells_and_differences_are_found_by_key():
    played = StudyCells(ROWS)
    assert played.cell(key("care")).detection.median == 15.5
    assert played.difference(key("care"), key("history-oracle")).mean == 5.0
    assert played.policies == ["care", "history-oracle"]


def test_what_was_not_played_is_none():
    played = StudyCells(ROWS)
    assert not played.has(key("care", camera_latency=1))
    assert played.cell(key("history")) is None
    assert played.difference(key("care"), key("history")) is None


def test_policies_that_no_car_can_have_are_marked():
    played = StudyCells(ROWS)
    assert [played.marked(policy) for policy in played.policies] == ["care", "history-oracle †"]
    assert played.notes(["care"]) == ()
    assert played.notes(played.policies) == ("† knows the truth: no policy of a car.",)


def test_a_number_is_the_same_key_as_an_int_and_as_a_float():
    whole, real = (key("care-sbf", policy_parameters=(("k_safe", value),)) for value in (1, 1.0))
    assert whole == real != key("care-sbf")
