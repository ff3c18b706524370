"""A score for how a Euro NCAP test went."""

BEST_SCORE = 5.0
"""Of a test without a contact."""
_MOST_OF_A_HIT = 4.0


def score(impact: float | None, reference: float) -> float:
    """5 without an impact, else 4 max(0, 1 - impact / reference), speeds in m/s (Ljungbergh et al.
    2024, NeuroNCAP).
    """
    if impact is None:
        return BEST_SCORE
    return _MOST_OF_A_HIT * max(0.0, 1.0 - impact / reference)
