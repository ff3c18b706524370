import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.evaluation.ncap_score import Ending, ending, score

SPEEDS = st.floats(0.1, 60.0)


@pytest.mark.parametrize(
    ("impact", "expected", "how"),
    [
        (None, 5.0, Ending.AVOIDED),
        (0.0, 4.0, Ending.MITIGATED),
        (2.5, 3.0, Ending.MITIGATED),
        (5.0, 2.0, Ending.MITIGATED),
        (10.0, 0.0, Ending.HIT),
        (10.2, 0.0, Ending.HIT),
    ],
)
def test_the_score_falls_from_four_to_nothing_with_the_speed_of_the_impact(impact, expected, how):
    assert score(impact, 10.0) == pytest.approx(expected)
    assert ending(impact, 10.0) is how


@given(SPEEDS, SPEEDS, SPEEDS)
def test_a_slower_impact_never_scores_less(one, other, reference):
    slow, fast = sorted((one, other))
    assert 0.0 <= score(fast, reference) <= score(slow, reference) <= 4.0 < score(None, reference)
