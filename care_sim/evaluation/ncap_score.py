"""How a Euro NCAP test went: avoided, mitigated or hit, and a score for it."""

from enum import StrEnum

BEST_SCORE = 5.0
"""Of a test without a contact."""
_MOST_OF_A_HIT = 4.0


class Ending(StrEnum):
    """How a test ended."""

    AVOIDED = "avoided"
    MITIGATED = "mitigated"
    HIT = "hit"


def ending(impact: float | None, reference: float) -> Ending:
    """How a test ended, by the speed of the impact (m/s, None without one).

    A contact is mitigated where it is slower than `reference`, at which a car hits that does not
    brake.
    """
    if impact is None:
        return Ending.AVOIDED
    return Ending.MITIGATED if impact < reference else Ending.HIT


def score(impact: float | None, reference: float) -> float:
    """5 without an impact, else 4 max(0, 1 - impact / reference), speeds in m/s (Ljungbergh et al.
    2024, NeuroNCAP).
    """
    if impact is None:
        return BEST_SCORE
    return _MOST_OF_A_HIT * max(0.0, 1.0 - impact / reference)
