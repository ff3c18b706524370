"""The paper's ablations (Sec. 5.4), in the closed and in the open loop: one factor varies at a
time.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

from care_sim.core.defaults import AS_DEMANDED, CELL_ORDERS
from care_sim.core.forgetting import ForgettingRules
from care_sim.sources.scenes import Scene, Source
from care_sim.study.designs.variants import USUAL_VARIANT, Place, Variant
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.play_config import PlayConfig
from care_sim.study.run_config import FULL

ABLATION_PLACES = tuple(
    Place(*place)
    for place in (("dartout", 0.03), ("dartout", 0.10), ("dense", 0.02), ("dense", 0.03))
)
"""The dart-out at the paper's tightest budget and at the reported one, the dense street at the
tightest and below. At larger budgets the reserve holds every wedge whole, and the varied factors
have no effect.
"""
_REFERENCES = ("history", "all-camera")
_QUARTER = 4
"""The paper's ablations take every fourth scene (Sec. 5.4)."""


@dataclass(frozen=True)
class Ablation:
    """A policy at several levels of one factor, beside `references` under the same conditions."""

    title: str
    policy: str
    levels: tuple[Variant, ...]
    references: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def beside(self, also: Sequence[str]) -> list[str]:
        """Return the references, and the further policies that depend on the factor."""
        varies_conditions = any(level.changes for level in self.levels)
        return [*self.references, *(also if varies_conditions else ())]


def _of_conditions(title: str, name: str, *values: float) -> Ablation:
    levels = tuple(Variant(f"{value:g}", {name: value}) for value in values)
    return Ablation(title, "care", levels, _REFERENCES)


def _of_rules(title: str, name: str, *values: float) -> Ablation:
    # The default value is the usual policy, whose rows carry no parameter.
    usual = getattr(ForgettingRules(), name)
    levels = (
        Variant(f"{value:g}", parameters={} if value == usual else {name: float(value)})
        for value in values
    )
    return Ablation(title, "care-sbf", tuple(levels), ("care",))


def _margins(columns: int, rows: int) -> Variant:
    return Variant(f"{columns}, {rows}", {"azimuth_margin": columns, "elevation_margin": rows})


RESERVE_FRACTION = _of_conditions("reserve fraction rho", "reserve_fraction", 0.15, 0.3, 0.5)
MARGINS = Ablation(
    "angular margin of hulls and wedges, columns and rows",
    "care",
    (_margins(1, 1), _margins(2, 1), _margins(4, 2)),
    _REFERENCES,
    ("Halved, the margin keeps its one row: there is no half of one.",),
)
CONFIDENCE = _of_conditions("least confidence of the camera", "camera_confidence", 0.25, 0.5)
LATENCY = _of_conditions("age of the camera's detections, keyframes", "camera_latency", 0, 1)
FLOOR_SEED = _of_conditions("seed of the shared floor", "floor_seed", 0, 1, 2)
RESERVE_ORDER = Ablation(
    "order of the reserve",
    "care",
    (
        Variant("unexplained alone"),
        Variant("care-priority: then explained", policy="care-priority"),
        Variant("care-sbf: so too, with forgetting", policy="care-sbf"),
    ),
)
GUARD = _of_rules("scale k_safe of the guard, 0: unguarded", "k_safe", 0, 0.25, 0.5, 1, 1.5, 2)
SIGMA = _of_rules("localisation margin sigma_pos, m", "position_sigma_m", 0, 0.2, 0.4, 0.8)
DECAY = _of_rules("margin forgotten a keyframe, columns", "decay_per_keyframe", 0.25, 0.5, 1, 2)
STATIC = _of_rules(
    "speed tau_static below which a track stands still, m/s", "static_mps", 0, 0.25, 0.5, 1, 2
)
CELL_ORDER = Ablation(
    "order of the cells inside a set",
    "care",
    (
        # The order in which the paper's policies list their sets.
        Variant("rows-down"),
        *(
            Variant(name, {"cell_order": name})
            for name in CELL_ORDERS
            if name not in (AS_DEMANDED, "rows-down")
        ),
    ),
    _REFERENCES,
)
IDEAS = Ablation(
    "ideas of care-sightlines, one left out at a time",
    "care-sightlines",
    (
        Variant("all of them"),
        Variant("without the camera", parameters={"camera": False}),
        Variant("without lines of sight ahead", parameters={"ahead": False}),
        Variant("without lines of sight", parameters={"ahead": False, "sight_lines": False}),
        Variant("without explained wedges", parameters={"explained": False}),
        Variant("without rows", parameters={"rows": False}),
        Variant("one round of a wedge", parameters={"wedge_rounds": 1}),
        Variant("without cores first", {"cell_order": "rows-down"}),
    ),
    ("care-spread", "care"),
    (
        "The references keep their camera and all else; without cores first they too list their "
        "sets row by row.",
    ),
)
_OF_BOTH_LOOPS = (RESERVE_FRACTION, MARGINS, CONFIDENCE, LATENCY)
_OF_POLICIES = (RESERVE_ORDER, GUARD, SIGMA, DECAY)
ABLATIONS = (*_OF_BOTH_LOOPS, FLOOR_SEED, *_OF_POLICIES)
"""Ablations of the closed loop."""
OPEN_ABLATIONS = (*_OF_BOTH_LOOPS, *_OF_POLICIES, STATIC, CELL_ORDER, IDEAS)
"""Ablations of the open loop, with one floor as in the paper; the last is ours."""


def ablation_study(seeds: Sequence[int], also: Sequence[str] = ()) -> list[EpisodeConfig]:
    """Return every ablation in every place, and the full scan. `also` are further policies that
    depend on the conditions.
    """
    made: list[EpisodeConfig] = []
    for place in ABLATION_PLACES:
        made += USUAL_VARIANT.configurations(place, [FULL], seeds)
    for place, (level, policies) in product(ABLATION_PLACES, _played(ABLATIONS, also)):
        made += level.configurations(place, policies, seeds)
    # The usual level comes in every ablation and is played once.
    return list(dict.fromkeys(made))


def ablation_plays(
    source: Source, scenes: Sequence[Scene], budgets: Sequence[float], also: Sequence[str] = ()
) -> list[PlayConfig]:
    """Return every ablation of the open loop at every budget, and the full scan. `also` are further
    policies that depend on the conditions.
    """
    made = USUAL_VARIANT.plays(source, scenes, budgets, [FULL])
    for level, policies in _played(OPEN_ABLATIONS, also):
        made += level.plays(source, scenes, budgets, policies)
    return list(dict.fromkeys(made))


def _played(ablations: Sequence[Ablation], also: Sequence[str]) -> list[tuple[Variant, list[str]]]:
    """Return the variants and policies of each ablation. The policy itself plays at every level,
    the others under the level's conditions, without its parameters.
    """
    played: list[tuple[Variant, list[str]]] = []
    for ablation in ablations:
        for level in ablation.levels:
            played += [(level, [ablation.policy]), (level.for_others(), ablation.beside(also))]
    return played


def quarter_of(scenes: Sequence[Scene]) -> list[Scene]:
    """Return one of every four scenes: the first of the first four, the second of the next four,
    and so on. Street layouts repeat every four scenes, so every fourth street would be straight.
    """
    return [
        scene
        for number, scene in enumerate(scenes)
        if number % _QUARTER == number // _QUARTER % _QUARTER
    ]
