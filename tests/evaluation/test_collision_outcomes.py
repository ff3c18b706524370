import pytest

from care_sim.evaluation.outcomes import collision_outcome


@pytest.mark.parametrize(
    ("impact_kph", "outcome"),
    [
        (None, "avoided"),
        (0.0, "mitigated"),
        (48.9, "mitigated"),
        (49.1, "hit"),
        (50.0, "hit"),
    ],
)
def test_a_kilometre_per_hour_is_no_mitigation(impact_kph, outcome):
    impact_mps = None if impact_kph is None else impact_kph / 3.6
    assert collision_outcome(impact_mps, 50 / 3.6) == outcome
