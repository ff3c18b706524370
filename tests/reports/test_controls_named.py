"""The best control of each budget in words."""

import pytest

from care_sim.reports.controls import named_by_budget


@pytest.mark.parametrize(
    ("controls", "words"),
    [
        ({0.03: "fan"}, "fan at every budget"),
        ({0.01: "fan", 0.03: "fan"}, "fan at every budget"),
        ({0.01: "fan", 0.03: "rows", 0.05: "fan"}, "fan at 1%, 5% and rows at 3%"),
    ],
)
def test_each_control_is_named_once(controls, words):
    assert named_by_budget(controls) == words
