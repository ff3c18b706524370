"""What the paper says of its nuScenes evaluation (Secs. 5.2 to 5.4): numbers by budget, and their
sentences.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, TTFD, Ratio
from care_sim.reports.protocol.differences import (
    DENSE_LESS_SPARSE,
    Comparison,
    PolicyPair,
    SceneThird,
)
from care_sim.study.rows.settings import Setting

PAPER_BUDGETS = (0.10, 0.20, 0.35)


@dataclass(frozen=True)
class Claim:
    """What the paper says of one difference at one budget, in the unit of the measure.

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
    """What the paper says of one difference by budget, and the sentence or table it stands in."""

    by_budget: Mapping[float, Claim]
    source: str

    def at(self, budget: float) -> Claim | None:
        """The claim for a budget, None where nothing is said."""
        return self.by_budget.get(budget)

    def any_at(self, budgets: Iterable[float]) -> bool:
        """Whether anything is said at one of these budgets."""
        return any(budget in self.by_budget for budget in budgets)


class PublishedLevel(NamedTuple):
    """What the paper says of one policy, None where nothing: recalls and their shares of the full
    scan's in %, TTFD in keyframes.
    """

    first: float | None = None
    first_of_full: float | None = None
    overall: float | None = None
    overall_of_full: float | None = None
    ttfd: float | None = None


_TABLE_1 = (
    "Table 1: Paired per-scene bootstrap contrasts, in points of recall with 95% confidence "
    "intervals."
)
_HISTORY = (
    "Against the history policy, the first-sighting gain is not free at tight budgets: in the "
    "paired per-scene contrast used for all intervals, overall recall moves by -0.8, -0.5, and "
    "+0.6 points at 10%, 20%, and 35%, a budget-dependent Pareto choice that we report as such "
    "rather than as a uniform win."
)
_ALIKE = "Equal scene weights give 5.3, 5.2, and 4.2 points, so event-rich scenes do not drive it."
_TTFD = (
    "Descriptively, on a single seed CARE lowers the mean censored TTFD of the history policy from "
    "3.76 to 3.64, 3.60 to 3.47, and 3.45 to 3.33 keyframes, a shift of about 0.12 keyframes (60 "
    "ms); no interval claim is made for TTFD."
)
_UNCERTAINTY = (
    "It attains the best overall recall of all policies, exceeding CARE by 1.0, 2.2, and 0.5 "
    "points with intervals excluding zero, because it re-examines regions that returned points "
    "without a confident detection."
)
_BEAMS = (
    "Beam reduction shows the opposite behavior: its first-sighting recall is statistically tied "
    "with CARE at 20% and 35% and 2.0 points behind at 10%, while it gives up 17.4, 11.5, and 6.4 "
    "points of overall recall (Table 1), so CARE gives the better joint trade-off."
)
_CAMERA = (
    "The all-camera control shows that the camera cue, not the history state, drives the "
    "first-sighting gain: the two are tied on first sightings at all three budgets."
)
_UNIFORM = (
    "The history+uniform control falls below plain history at every budget, so an undirected "
    "reserve costs more than it returns."
)
_ORACLE = (
    "An oracle variant sharpens this point: replacing the forecast of every tracked object with "
    "its true next position, an upper bound on any learned region predictor, moves first-sighting "
    "recall by at most 0.5 points in a single-seed diagnostic run, and every interval contains "
    "zero. Within the same run CARE stays 3.7 to 4.7 points above this oracle, so what it adds is "
    "information about objects that have no track yet, not a better forecast. The oracle raises "
    "overall recall by 0.5 to 0.7 points, as expected from perfect placement on tracked objects."
)
_PRIORITY = (
    "Priority ordering is structural: on the full split the variant changes first-sighting recall "
    "by at most 0.2 points, with overall recall of 0.380, 0.418, and 0.457."
)
_GUARD = (
    "At the 10% budget, relative to CARE without forgetting, unguarded forgetting loses 1.8 points "
    "of near-field recall on objects within 20 m, interval [-2.9,-0.5], a quarter-scale guard "
    "loses 1.5 points [-2.7,-0.2], and the default shows no significant loss, -0.5 [-1.7,+0.4], "
    "while releasing 24 cells per keyframe. At 20% even the default pays 3.1 points [-4.7,-1.5], "
    "so forgetting is a tool for the tightest budgets."
)
_LEARNED = (
    "The learned scorer matches CARE on first-sighting recall but loses 0.6 to 2.4 points of "
    "overall recall at every budget (Table 1)."
)
_DENSE = (
    "In the densest third of the scenes, ranked by tracked-object count, CARE gains 0.7 and 1.0 "
    "points of overall recall over the all-camera reserve at 20% and 35%. The dense-minus-sparse "
    "difference of 0.7 and 1.3 points excludes zero, and the same pattern appears when scenes are "
    "ranked by explained detections instead. Sparse scenes are tied, and the stratified "
    "first-sighting contrasts are tied apart from a 1.3-point loss in the middle third at 20%."
)
_CAUSAL = (
    "Delaying the camera detections by one full keyframe, so the reserve only sees half-second-old "
    "evidence, still recovers 4.6, 5.3, and 2.6 points over history: same-frame camera input is "
    "not required."
)
_CEILING = (
    "A full scan reaches 0.245 first-sighting and 0.494 overall recall; CARE at 35% recovers 88% "
    "and 94% of these ceilings against 70% and 93% for history, so it closes most of the "
    "allocation-controlled gap."
)
_MECHANICAL = (
    "At 10% the unexplained wedges alone fill the reserve on 79% of keyframes, and the realized "
    "allocation changes on only 17% of keyframes, against 68% at 35%."
)
GATE = (
    "The effect-size gate fixed before the runs, five points of first-sighting recall, is met at "
    "10% and 20%; the 35% gain stays positive but below it."
)


def _difference(
    mean: float, ends: tuple[float, float] | None = None, upper: float | None = None
) -> Claim:
    """A claim of more or of less: the sign is that of the mean."""
    return Claim(1 if mean > 0 else -1, mean, ends, upper)


def _everywhere(claim: Claim, source: str) -> Claims:
    """The same claim at all of the paper's budgets."""
    return Claims(dict.fromkeys(PAPER_BUDGETS, claim), source)


def _by_budget(*claims: Claim | None, source: str) -> Claims:
    """One claim per budget of the paper, None where it says nothing."""
    by_budget = zip(PAPER_BUDGETS, claims, strict=True)
    return Claims({budget: claim for budget, claim in by_budget if claim}, source)


_MORE = Claim(1)
_LESS = Claim(-1)
_TIED = Claim(0)

_PLAIN: dict[Comparison, Claims] = {
    PolicyPair("care", "history", FIRST_SIGHTING): _by_budget(
        _difference(5.2, (4.3, 6.2)),
        _difference(5.2, (4.3, 6.2)),
        _difference(4.3, (3.5, 5.1)),
        source=_TABLE_1,
    ),
    PolicyPair("care", "uncertainty", FIRST_SIGHTING): _by_budget(
        _difference(3.5, (2.6, 4.4)),
        _difference(2.7, (1.7, 3.8)),
        _difference(2.1, (1.1, 3.1)),
        source=_TABLE_1,
    ),
    PolicyPair("care", "beam-reduce", FIRST_SIGHTING): _by_budget(
        _difference(2.0), _TIED, _TIED, source=_BEAMS
    ),
    PolicyPair("care", "all-camera", FIRST_SIGHTING): _everywhere(_TIED, _CAMERA),
    PolicyPair("care", "learned-scorer", FIRST_SIGHTING): _everywhere(_TIED, _LEARNED),
    PolicyPair("care", "history-oracle", FIRST_SIGHTING): _everywhere(
        _difference(3.7, upper=4.7), _ORACLE
    ),
    PolicyPair("history-oracle", "history", FIRST_SIGHTING): _everywhere(
        Claim(0, at_most=0.5), _ORACLE
    ),
    PolicyPair("history-uniform", "history", FIRST_SIGHTING): _everywhere(_LESS, _UNIFORM),
    PolicyPair("care-priority", "care", FIRST_SIGHTING): _everywhere(
        Claim(0, at_most=0.2), _PRIORITY
    ),
    PolicyPair("care", "history", FIRST_SIGHTING, equal_scenes=True): _by_budget(
        _difference(5.3), _difference(5.2), _difference(4.2), source=_ALIKE
    ),
    PolicyPair("care", "history", OVERALL): _by_budget(
        _difference(-0.8), _difference(-0.5), _difference(0.6), source=_HISTORY
    ),
    PolicyPair("care", "uncertainty", OVERALL): _by_budget(
        _difference(-1.0), _difference(-2.2), _difference(-0.5), source=_UNCERTAINTY
    ),
    PolicyPair("care", "beam-reduce", OVERALL): _by_budget(
        _difference(17.4, (15.9, 19.0)),
        _difference(11.5, (10.4, 12.7)),
        _difference(6.4, (5.4, 7.5)),
        source=_TABLE_1,
    ),
    PolicyPair("care", "learned-scorer", OVERALL): _by_budget(
        _difference(2.4, (1.9, 3.0)),
        _difference(0.7, (0.4, 1.0)),
        _difference(0.6, (0.3, 0.9)),
        source=_TABLE_1,
    ),
    PolicyPair("care", "all-camera", OVERALL): _by_budget(
        _difference(-0.13, (-0.26, -0.01)),
        _difference(0.5, (0.3, 0.8)),
        _difference(0.7, (0.4, 1.0)),
        source=_TABLE_1,
    ),
    PolicyPair("history-oracle", "history", OVERALL): _everywhere(
        _difference(0.5, upper=0.7), _ORACLE
    ),
    PolicyPair("history-uniform", "history", OVERALL): _everywhere(_LESS, _UNIFORM),
    PolicyPair("care-sbf", "care", OVERALL, "range/below 20 m"): _by_budget(
        Claim(0, -0.5, (-1.7, 0.4)), _difference(-3.1, (-4.7, -1.5)), None, source=_GUARD
    ),
    PolicyPair("care", "history", TTFD): _by_budget(
        _difference(-0.12), _difference(-0.13), _difference(-0.12), source=_TTFD
    ),
    SceneThird("dense", "tracks", OVERALL): _by_budget(
        None, _difference(0.7), _difference(1.0), source=_DENSE
    ),
    SceneThird("sparse", "tracks", OVERALL): _by_budget(None, _TIED, _TIED, source=_DENSE),
    SceneThird(DENSE_LESS_SPARSE, "tracks", OVERALL): _by_budget(
        None, _difference(0.7), _difference(1.3), source=_DENSE
    ),
    SceneThird("dense", "tracks", FIRST_SIGHTING): _everywhere(_TIED, _DENSE),
    SceneThird("middle", "tracks", FIRST_SIGHTING): _by_budget(
        _TIED, _difference(-1.3), _TIED, source=_DENSE
    ),
    SceneThird("sparse", "tracks", FIRST_SIGHTING): _everywhere(_TIED, _DENSE),
    SceneThird(DENSE_LESS_SPARSE, "explained", OVERALL): _by_budget(
        None, _MORE, _MORE, source=_DENSE
    ),
}
_STRICT_CAUSAL: dict[Comparison, Claims] = {
    PolicyPair("care", "history", FIRST_SIGHTING): _by_budget(
        _difference(4.6), _difference(5.3), _difference(2.6), source=_CAUSAL
    ),
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
LEVEL_SOURCES = (_CEILING, _TTFD, _PRIORITY)
PUBLISHED_ALLOCATIONS = {"all-camera": {0.10: 17.0, 0.35: 68.0}}
"""Share of keyframes in % on which a policy's allocation differs from that of CARE, by budget."""
ALLOCATION_SOURCE = _MECHANICAL


def published_level(ratio: Ratio, policy: str, budget: float) -> float | None:
    """A recall in % that the paper gives of a policy, itself or as a share of the full scan's; None
    where it gives neither, and for TTFD.
    """
    said = PUBLISHED_LEVELS.get((policy, budget), PublishedLevel())
    full = PUBLISHED_LEVELS["full", 1.0]
    if ratio is FIRST_SIGHTING:
        own = said.first
        share = said.first_of_full
        ceiling = full.first
    elif ratio is OVERALL:
        own = said.overall
        share = said.overall_of_full
        ceiling = full.overall
    else:
        return None
    if own is not None or share is None or ceiling is None:
        return own
    return share * ceiling / 100


def claims_about(setting: Setting) -> Mapping[Comparison, Claims]:
    """What the paper says under these conditions, whatever the films and the detector are."""
    if setting.strict_causal:
        return _STRICT_CAUSAL
    return {} if setting.conditions else _PLAIN
