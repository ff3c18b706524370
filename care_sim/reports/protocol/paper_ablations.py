"""What the paper says of its ablations, on every fourth scene of nuScenes (Sec. 5.4)."""

from typing import NamedTuple

from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, Ratio
from care_sim.reports.protocol import quotes
from care_sim.reports.protocol.paper import PAPER_BUDGETS, Claim, Claims
from care_sim.study.designs.ablations import (
    CONFIDENCE,
    DECAY,
    GUARD,
    LATENCY,
    MARGINS,
    RESERVE_FRACTION,
    RESERVE_ORDER,
    SIGMA,
)

USUAL = "usual"
"""The base of a level that is compared with the usual one."""
NEAR_FIELD = "range/below 20 m"
"""The stratum of the paper's near field."""


class LevelChange(NamedTuple):
    """A level of the ablation with this title less `base`, a policy or `USUAL`: in one measure, of
    all objects or `within` one stratum.
    """

    title: str
    level: str
    base: str
    ratio: Ratio
    within: str = ""


_TO_A_POINT = Claims(dict.fromkeys(PAPER_BUDGETS, Claim(0, at_most=1.0)), quotes.RESERVE)
_GAP = Claims(dict.fromkeys(PAPER_BUDGETS, Claim(1, 3.3, upper=6.3)), quotes.MARGIN)
_STRICTER = Claims({0.10: Claim(-1, -1.0), 0.20: Claim(0), 0.35: Claim(0)}, quotes.MARGIN)
_DELAYED = Claims({0.10: Claim(1, 4.6), 0.20: Claim(1, 5.3), 0.35: Claim(1, 2.6)}, quotes.CAUSAL)
_PRIORITY = Claims(dict.fromkeys(PAPER_BUDGETS, Claim(0, at_most=0.2)), quotes.PRIORITY)
_UNGUARDED = Claims({0.10: Claim(-1, -1.8, (-2.9, -0.5))}, quotes.GUARD)
_QUARTER = Claims({0.10: Claim(-1, -1.5, (-2.7, -0.2))}, quotes.GUARD)
# "No significant loss" is a tie.
_GUARDED = Claims(
    {0.10: Claim(0, -0.5, (-1.7, 0.4)), 0.20: Claim(-1, -3.1, (-4.7, -1.5))}, quotes.GUARD
)
PUBLISHED_CHANGES = {
    LevelChange(RESERVE_FRACTION.title, "0.15", USUAL, FIRST_SIGHTING): _TO_A_POINT,
    LevelChange(RESERVE_FRACTION.title, "0.5", USUAL, FIRST_SIGHTING): _TO_A_POINT,
    LevelChange(MARGINS.title, "1, 1", "history", FIRST_SIGHTING): _GAP,
    LevelChange(MARGINS.title, "4, 2", "history", FIRST_SIGHTING): _GAP,
    LevelChange(CONFIDENCE.title, "0.5", USUAL, FIRST_SIGHTING): _STRICTER,
    LevelChange(LATENCY.title, "1", "history", FIRST_SIGHTING): _DELAYED,
    LevelChange(
        RESERVE_ORDER.title, "care-priority: then explained", USUAL, FIRST_SIGHTING
    ): _PRIORITY,
    LevelChange(GUARD.title, "0", "care", OVERALL, NEAR_FIELD): _UNGUARDED,
    # A quarter of the default scale, which is 2.
    LevelChange(GUARD.title, "0.5", "care", OVERALL, NEAR_FIELD): _QUARTER,
    LevelChange(GUARD.title, "2", "care", OVERALL, NEAR_FIELD): _GUARDED,
}
PUBLISHED_ON_ALL_LEVELS = {each.title: quotes.KNOBS for each in (GUARD, SIGMA, DECAY)}
"""By the title of an ablation: what the paper says of its levels together."""
PUBLISHED_RELEASE = {0.10: 24.0}
"""Cells that the default guard releases a keyframe, by budget."""
