import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.evaluation.outcomes import score

SPEEDS = st.floats(0.1, 60.0)


@pytest.mark.parametrize(
    ("impact", "expected"),
    [
        (None, 5.0),
        (0.0, 4.0),
        (2.5, 3.0),
        (5.0, 2.0),
        (10.0, 0.0),
        (10.2, 0.0),
    ],
)
def test_the_score_falls_from_four_to_nothing_with_the_speed_of_the_impact(impact, expected):
    assert score(impact, 10.0) == pytest.approx(expected)


@given(SPEEDS, SPEEDS, SPEEDS)
def test_a_slower_impact_never_scores_less(one, other, reference):
    slow, fast = sorted((one, other))
    assert 0.0 <= score(fast, reference) <= score(slow, reference) <= 4.0 < score(None, reference)
