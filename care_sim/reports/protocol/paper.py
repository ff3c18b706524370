"""The paper's nuScenes evaluation (Secs. 5.2 to 5.4): differences and levels by budget, and the
sentences that give them.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, TTFD, Ratio
from care_sim.reports.protocol import quotes
from care_sim.reports.protocol.comparisons import (
    DENSE_LESS_SPARSE,
    Comparison,
    PolicyPair,
    SceneThird,
)
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
from care_sim.study.rows.reading import Setting

PAPER_BUDGETS = (0.10, 0.20, 0.35)


@dataclass(frozen=True)
class Claim:
    """Claim of the paper about one difference at one budget, in the unit of the measure.

    `sign`: 1 where the first named has more, -1 where it has less, 0 where the paper calls the two
    tied. All else is None where the paper does not tell it. `ends` are those of its 95% interval;
    a range of differences runs from `mean` to `upper`; a tie differs by `at_most` so much.
    """

    sign: int
    mean: float | None = None
    ends: tuple[float, float] | None = None
    upper: float | None = None
    at_most: float | None = None


@dataclass(frozen=True)
class Claims:
    """Claims of the paper about one difference by budget, and the sentence or table it stands
    in.
    """

    by_budget: Mapping[float, Claim]
    source: str

    def at(self, budget: float) -> Claim | None:
        """The claim for a budget, None where nothing is said."""
        return self.by_budget.get(budget)

    def any_at(self, budgets: Iterable[float]) -> bool:
        """Whether anything is said at one of these budgets."""
        return any(budget in self.by_budget for budget in budgets)


class PublishedLevel(NamedTuple):
    """Levels of one policy in the paper, None where it gives none: recalls and their shares of the
    full scan's in %, TTFD in keyframes.
    """

    first: float | None = None
    first_of_full: float | None = None
    overall: float | None = None
    overall_of_full: float | None = None
    ttfd: float | None = None


_Said = float | tuple[float, float, float] | Claim | None
"""A difference, one with the ends of its interval, any other claim; None where nothing is said."""


def _said(source: str, *by_budget: _Said) -> Claims:
    """One claim for each budget of the paper, or the same claim for all."""
    every = by_budget * len(PAPER_BUDGETS) if len(by_budget) == 1 else by_budget
    claims = dict(zip(PAPER_BUDGETS, map(_claim, every), strict=True))
    return Claims({budget: claim for budget, claim in claims.items() if claim}, source)


def _claim(said: _Said) -> Claim | None:
    """A difference is a claim of more or of less: the sign is that of the mean."""
    if said is None or isinstance(said, Claim):
        return said
    mean, *ends = said if isinstance(said, tuple) else (said,)
    return Claim(1 if mean > 0 else -1, mean, (ends[0], ends[1]) if ends else None)


_MORE = Claim(1)
_LESS = Claim(-1)
_TIED = Claim(0)

# Differences as the tables take them. Where the paper words one the other way round ("the policy
# gives up 17.4 points"), the sign here is that of the first named.
_PLAIN: dict[Comparison, Claims] = {
    PolicyPair("care", "history", FIRST_SIGHTING): _said(
        quotes.TABLE_1, (5.2, 4.3, 6.2), (5.2, 4.3, 6.2), (4.3, 3.5, 5.1)
    ),
    PolicyPair("care", "uncertainty", FIRST_SIGHTING): _said(
        quotes.TABLE_1, (3.5, 2.6, 4.4), (2.7, 1.7, 3.8), (2.1, 1.1, 3.1)
    ),
    PolicyPair("care", "beam-reduce", FIRST_SIGHTING): _said(quotes.BEAMS, 2.0, _TIED, _TIED),
    PolicyPair("care", "all-camera", FIRST_SIGHTING): _said(quotes.CAMERA, _TIED),
    PolicyPair("care", "learned-scorer", FIRST_SIGHTING): _said(quotes.LEARNED, _TIED),
    PolicyPair("care", "history-oracle", FIRST_SIGHTING): _said(
        quotes.ORACLE, Claim(1, 3.7, upper=4.7)
    ),
    PolicyPair("history-oracle", "history", FIRST_SIGHTING): _said(
        quotes.ORACLE, Claim(0, at_most=0.5)
    ),
    # The paper does not say in which measure it falls below, so that both are tested.
    PolicyPair("history-uniform", "history", FIRST_SIGHTING): _said(quotes.UNIFORM, _LESS),
    PolicyPair("care-priority", "care", FIRST_SIGHTING): _said(
        quotes.PRIORITY, Claim(0, at_most=0.2)
    ),
    PolicyPair("care", "history", FIRST_SIGHTING, equal_scenes=True): _said(
        quotes.EQUAL_SCENES, 5.3, 5.2, 4.2
    ),
    PolicyPair("care", "history", OVERALL): _said(quotes.HISTORY_OVERALL, -0.8, -0.5, 0.6),
    PolicyPair("care", "uncertainty", OVERALL): _said(quotes.UNCERTAINTY, -1.0, -2.2, -0.5),
    PolicyPair("care", "beam-reduce", OVERALL): _said(
        quotes.TABLE_1, (17.4, 15.9, 19.0), (11.5, 10.4, 12.7), (6.4, 5.4, 7.5)
    ),
    PolicyPair("care", "learned-scorer", OVERALL): _said(
        quotes.TABLE_1, (2.4, 1.9, 3.0), (0.7, 0.4, 1.0), (0.6, 0.3, 0.9)
    ),
    PolicyPair("care", "all-camera", OVERALL): _said(
        quotes.TABLE_1, (-0.13, -0.26, -0.01), (0.5, 0.3, 0.8), (0.7, 0.4, 1.0)
    ),
    PolicyPair("history-oracle", "history", OVERALL): _said(
        quotes.ORACLE, Claim(1, 0.5, upper=0.7)
    ),
    PolicyPair("history-uniform", "history", OVERALL): _said(quotes.UNIFORM, _LESS),
    # "No significant loss" is a tie. The paper gives no number at 35%.
    PolicyPair("care-sbf", "care", OVERALL, "range/below 20 m"): _said(
        quotes.GUARD, Claim(0, -0.5, (-1.7, 0.4)), (-3.1, -4.7, -1.5), None
    ),
    PolicyPair("care", "history", TTFD): _said(quotes.MEAN_TTFD, -0.12, -0.13, -0.12),
    SceneThird("dense", "tracks", OVERALL): _said(quotes.DENSE, None, 0.7, 1.0),
    SceneThird("sparse", "tracks", OVERALL): _said(quotes.DENSE, None, _TIED, _TIED),
    SceneThird(DENSE_LESS_SPARSE, "tracks", OVERALL): _said(quotes.DENSE, None, 0.7, 1.3),
    SceneThird("dense", "tracks", FIRST_SIGHTING): _said(quotes.DENSE, _TIED),
    SceneThird("middle", "tracks", FIRST_SIGHTING): _said(quotes.DENSE, _TIED, -1.3, _TIED),
    SceneThird("sparse", "tracks", FIRST_SIGHTING): _said(quotes.DENSE, _TIED),
    # "The same pattern" is a sign without a number.
    SceneThird(DENSE_LESS_SPARSE, "explained", OVERALL): _said(quotes.DENSE, None, _MORE, _MORE),
}
_STRICT_CAUSAL: dict[Comparison, Claims] = {
    PolicyPair("care", "history", FIRST_SIGHTING): _said(quotes.CAUSAL, 4.6, 5.3, 2.6),
}
PUBLISHED_LEVELS = {
    ("full", 1.0): PublishedLevel(24.5, 100.0, 49.4, 100.0),
    ("care", 0.10): PublishedLevel(ttfd=3.64),
    ("care", 0.20): PublishedLevel(ttfd=3.47),
    ("care", 0.35): PublishedLevel(first_of_full=88.0, overall_of_full=94.0, ttfd=3.33),
    ("history", 0.10): PublishedLevel(ttfd=3.76),
    ("history", 0.20): PublishedLevel(ttfd=3.60),
    ("history", 0.35): PublishedLevel(first_of_full=70.0, overall_of_full=93.0, ttfd=3.45),
    ("care-priority", 0.10): PublishedLevel(overall=38.0),
    ("care-priority", 0.20): PublishedLevel(overall=41.8),
    ("care-priority", 0.35): PublishedLevel(overall=45.7),
}
"""By policy and budget."""
LEVEL_SOURCES = (quotes.CEILING, quotes.MEAN_TTFD, quotes.PRIORITY)
PUBLISHED_ALLOCATIONS = {"all-camera": {0.10: 17.0, 0.35: 68.0}}
"""Share of keyframes in % on which a policy's allocation differs from that of CARE, by budget."""
ALLOCATION_SOURCE = quotes.MECHANICAL


def published_level(ratio: Ratio, policy: str, budget: float) -> float | None:
    """A recall in % that the paper gives of a policy, itself or as a share of the full scan's; None
    where it gives neither, and for TTFD.
    """
    if ratio not in (FIRST_SIGHTING, OVERALL):
        return None
    own, full = (
        PUBLISHED_LEVELS.get(key, PublishedLevel()) for key in ((policy, budget), ("full", 1.0))
    )
    level, share, ceiling = (
        (own.first, own.first_of_full, full.first)
        if ratio is FIRST_SIGHTING
        else (own.overall, own.overall_of_full, full.overall)
    )
    # A share of the ceiling is a level once it is multiplied by the ceiling.
    if level is not None or share is None or ceiling is None:
        return level
    return share * ceiling / 100


def claims_about(setting: Setting) -> Mapping[Comparison, Claims]:
    """Return the paper's claims under these conditions, whatever the detector is; none for films of
    a source of one's own.
    """
    if not setting.has_paper:
        return {}
    if setting.strict_causal:
        return _STRICT_CAUSAL
    return {} if setting.conditions else _PLAIN


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
