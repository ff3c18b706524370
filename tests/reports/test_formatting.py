import pytest

from care_sim.evaluation.bootstrap import Interval
from care_sim.evaluation.censoring import Bound, Difference
from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.engine.measures import BRAKED, DETECTION
from care_sim.reports.formatting import interval, mean
from care_sim.reports.table import Bold


def made(measure, bound, *numbers, pairs=30, cautious=None):
    return Contrast(
        measure, Difference(Interval(*numbers), bound, pairs, Interval(*(cautious or numbers)))
    )


@pytest.mark.parametrize(
    ("contrast", "text", "bold"),
    [
        (made(DETECTION, Bound.EXACT, 3.0, 2.0, 4.0), "+3.0* [2.0,4.0]", True),
        (made(DETECTION, Bound.EXACT, 0.2, 0.04, 0.4), "+0.2 [0.04,0.4]", True),
        (made(DETECTION, Bound.EXACT, 0.04, 0.02, 0.06), "+0.04 [0.02,0.1]", True),
        (made(DETECTION, Bound.EXACT, -0.04, -0.06, -0.02), "-0.04 [-0.1,-0.02]", True),
        (made(DETECTION, Bound.EXACT, 0.004, 0.002, 0.006), "+0.00 [0.0,0.01]", False),
        (made(DETECTION, Bound.EXACT, -0.01, -0.04, 0.0), "+0.0 [-0.04,0.0]", False),
        (made(DETECTION, Bound.AT_MOST, -8.0, -9.0, -7.0), "≤-8.0* [-9.0,-7.0]", True),
        (
            made(DETECTION, Bound.AT_LEAST, -8.0, -9.0, -7.0, cautious=(-1.0, -2.0, 0.5)),
            "≥-8.0 [-9.0,-7.0]",
            False,
        ),
        (
            made(DETECTION, Bound.OPEN, 8.0, 7.0, 9.0, cautious=(2.0, 1.0, 3.0)),
            "~+8.0 [7.0,9.0]",
            True,
        ),
        (made(DETECTION, Bound.EXACT, 8.0, 8.0, 8.0, pairs=1), "+8.0", False),
        (made(BRAKED, Bound.EXACT, 4.9, 1.2, 9.0), "+5 [1,9]", True),
        (made(BRAKED, Bound.EXACT, 5.0, 0.3, 9.0), "+5* [0.3,9]", True),
    ],
)
def test_sign_mean_asterisk_interval_and_bold(contrast, text, bold):
    entry = interval(contrast)
    assert (entry, isinstance(entry, Bold)) == (text, bold)
    assert (mean(contrast), isinstance(mean(contrast), Bold)) == (text.partition(" ")[0], bold)


def test_what_was_not_compared_is_left_empty():
    assert interval(None) == mean(None) == ""
