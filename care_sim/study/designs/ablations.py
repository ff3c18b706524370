"""The paper's ablations (Sec. 5.4), in the closed and in the open loop: one thing is varied at a
time.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from care_sim.core.defaults import AS_DEMANDED, CELL_ORDERS
from care_sim.core.forgetting import ForgettingRules
from care_sim.sources.scenes import Scene, Source
from care_sim.study.designs.variants import USUAL_VARIANT, Place, Variant
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.play_config import PlayConfig
from care_sim.study.run_config import FULL

ABLATION_PLACES = (
    Place("dartout", 0.03),
    Place("dartout", 0.10),
    Place("dense", 0.02),
    Place("dense", 0.03),
)
"""The dart-out at the paper's tightest budget and at the one it reports, the dense street at the
tightest and below: with more the reserve holds every wedge whole, and nothing that is varied here
could show.
"""
_REFERENCES = ("history", "all-camera")
_USUAL_ORDERS = (AS_DEMANDED, "rows-down")


@dataclass(frozen=True)
class Ablation:
    """A policy at several levels of one thing, beside `references` under the same conditions."""

    title: str
    policy: str
    levels: tuple[Variant, ...]
    references: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def varies_conditions(self) -> bool:
        """Whether any policy feels what is varied."""
        return any(level.changes for level in self.levels)

    def beside(self, also: Sequence[str]) -> list[str]:
        """The references, and of further policies those that feel what is varied."""
        return [*self.references, *(also if self.varies_conditions else ())]


def _conditions(name: str, values: Iterable[Any]) -> tuple[Variant, ...]:
    return tuple(Variant(f"{value:g}", {name: value}) for value in values)


def _margins(columns: int, rows: int) -> Variant:
    return Variant(f"{columns}, {rows}", {"azimuth_margin": columns, "elevation_margin": rows})


def _rules(name: str, values: Iterable[float]) -> tuple[Variant, ...]:
    # The default value is the usual policy, whose rows carry no parameter.
    default = getattr(ForgettingRules(), name)
    return tuple(
        Variant(f"{value:g}", parameters={} if value == default else {name: float(value)})
        for value in values
    )


RESERVE_FRACTION = Ablation(
    "reserve fraction rho", "care", _conditions("reserve_fraction", (0.15, 0.3, 0.5)), _REFERENCES
)
MARGINS = Ablation(
    "angular margin of hulls and wedges, columns and rows",
    "care",
    tuple(_margins(*margins) for margins in ((1, 1), (2, 1), (4, 2))),
    _REFERENCES,
    ("Halved, the margin keeps its one row: there is no half of one.",),
)
CONFIDENCE = Ablation(
    "least confidence of the camera",
    "care",
    _conditions("camera_confidence", (0.25, 0.5)),
    _REFERENCES,
)
LATENCY = Ablation(
    "age of the camera's detections, keyframes",
    "care",
    _conditions("camera_latency", (0, 1)),
    _REFERENCES,
)
FLOOR_SEED = Ablation(
    "seed of the shared floor", "care", _conditions("floor_seed", (0, 1, 2)), _REFERENCES
)
RESERVE_ORDER = Ablation(
    "order of the reserve",
    "care",
    (
        Variant("unexplained alone"),
        Variant("care-priority: then explained", policy="care-priority"),
        Variant("care-sbf: so too, with forgetting", policy="care-sbf"),
    ),
)
GUARD = Ablation(
    "scale k_safe of the guard, 0: unguarded",
    "care-sbf",
    _rules("k_safe", (0, 0.25, 0.5, 1, 1.5, 2)),
    ("care",),
)
SIGMA = Ablation(
    "localisation margin sigma_pos, m",
    "care-sbf",
    _rules("position_sigma_m", (0, 0.2, 0.4, 0.8)),
    ("care",),
)
DECAY = Ablation(
    "margin forgotten a keyframe, columns",
    "care-sbf",
    _rules("decay_per_keyframe", (0.25, 0.5, 1, 2)),
    ("care",),
)
STATIC = Ablation(
    "speed tau_static below which a track stands still, m/s",
    "care-sbf",
    _rules("static_mps", (0, 0.25, 0.5, 1, 2)),
    ("care",),
)
CELL_ORDER = Ablation(
    "order of the cells inside a set",
    "care",
    (
        # The order in which the paper's policies list their sets.
        Variant("rows-down"),
        *(Variant(name, {"cell_order": name}) for name in CELL_ORDERS if name not in _USUAL_ORDERS),
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
ABLATIONS = (
    RESERVE_FRACTION,
    MARGINS,
    CONFIDENCE,
    LATENCY,
    FLOOR_SEED,
    RESERVE_ORDER,
    GUARD,
    SIGMA,
    DECAY,
)
"""Those of the closed loop."""
OPEN_ABLATIONS = (
    RESERVE_FRACTION,
    MARGINS,
    CONFIDENCE,
    LATENCY,
    RESERVE_ORDER,
    GUARD,
    SIGMA,
    DECAY,
    STATIC,
    CELL_ORDER,
    IDEAS,
)
"""Those of the open loop, with one floor as in the paper; the last is ours."""
_QUARTER = 4
"""The paper's ablations take every fourth scene (Sec. 5.4)."""


def ablation_study(seeds: Sequence[int], also: Sequence[str] = ()) -> list[EpisodeConfig]:
    """Every ablation in every place, and the full scan; `also` are further policies that feel the
    conditions.
    """
    made = [
        config
        for place in ABLATION_PLACES
        for config in USUAL_VARIANT.configurations(place, ["full"], seeds)
    ]
    # The policy itself at every level; the others under the conditions of the level, whose
    # parameters they do not have.
    for place, ablation in product(ABLATION_PLACES, ABLATIONS):
        for level in ablation.levels:
            made += level.configurations(place, [ablation.policy], seeds)
            made += level.for_others().configurations(place, ablation.beside(also), seeds)
    # The usual level comes in every ablation and is played once.
    return list(dict.fromkeys(made))


def quarter_of(scenes: Sequence[Scene]) -> list[Scene]:
    """One of every four scenes: of the first four the first, of the next four the second, and so
    on. Layouts of streets take turns by four, so that every fourth street is straight.
    """
    return [
        scene
        for number, scene in enumerate(scenes)
        if number % _QUARTER == number // _QUARTER % _QUARTER
    ]


def ablation_plays(
    source: Source, scenes: Sequence[Scene], budgets: Sequence[float], also: Sequence[str] = ()
) -> list[PlayConfig]:
    """Every ablation of the open loop at every budget, and the full scan; `also` are further
    policies that feel the conditions.
    """
    made = USUAL_VARIANT.plays(source, scenes, budgets, [FULL])
    for ablation in OPEN_ABLATIONS:
        for level in ablation.levels:
            made += level.plays(source, scenes, budgets, [ablation.policy])
            made += level.for_others().plays(source, scenes, budgets, ablation.beside(also))
    return list(dict.fromkeys(made))
