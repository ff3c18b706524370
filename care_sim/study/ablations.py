"""The paper's ablations (Sec. 5.4) in the closed loop: one thing varied at a time, and a fixed table each."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from care_sim.forgetting import ForgettingRules
from care_sim.study.config import EpisodeConfig
from care_sim.study.contrasts import DETECTION, contrast
from care_sim.study.entries import interval, spread
from care_sim.study.episode import Row
from care_sim.study.factors import USUAL, Level, Place
from care_sim.study.summary import Cell, Groups, Key, grouped, summarise
from care_sim.study.table import Table

PLACES = (Place("dartout", 0.03), Place("dartout", 0.10), Place("dense", 0.02), Place("dense", 0.03))
"""The dart-out at the paper's tightest budget and at the one it reports, the dense street at the tightest and
below: with more the reserve holds every wedge whole, and nothing that is varied here could show.
"""
OTHERS = ("history", "all-camera")


@dataclass(frozen=True)
class Ablation:
    """A policy at several levels of one thing, beside `references`, which feel its changes of conditions too."""

    title: str
    policy: str
    levels: tuple[Level, ...]
    references: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def is_usual(self, level: Level) -> bool:
        """Whether nothing departs from the defaults at this level."""
        return level.key(PLACES[0], self.policy) == USUAL.key(PLACES[0], self.policy)

    def beside(self, also: Sequence[str]) -> tuple[str, ...]:
        """The references, and `also` wherever those of the paper stand."""
        return (*self.references, *(also if self.references == OTHERS else ()))


def _conditions(name: str, values: Iterable[Any]) -> tuple[Level, ...]:
    return tuple(Level(f"{value:g}", {name: value}) for value in values)


def _margins(columns: int, rows: int) -> Level:
    return Level(f"{columns}, {rows}", {"azimuth_margin": columns, "elevation_margin": rows})


def _rules(name: str, values: Iterable[float]) -> tuple[Level, ...]:
    default = getattr(ForgettingRules(), name)
    return tuple(Level(f"{value:g}", parameters={} if value == default else {name: float(value)}) for value in values)


ABLATIONS = (
    Ablation("reserve fraction rho", "care", _conditions("reserve_fraction", (0.15, 0.3, 0.5)), OTHERS),
    Ablation(
        "angular margin of hulls and wedges, columns and rows",
        "care",
        tuple(_margins(*margins) for margins in ((1, 1), (2, 1), (4, 2))),
        OTHERS,
        ("Halved, the margin keeps its one row: there is no half of one.",),
    ),
    Ablation("least confidence of the camera", "care", _conditions("camera_confidence", (0.25, 0.5)), OTHERS),
    Ablation("age of the camera's detections, keyframes", "care", _conditions("camera_latency", (0, 1)), OTHERS),
    Ablation("seed of the shared floor", "care", _conditions("floor_seed", (0, 1, 2)), OTHERS),
    Ablation(
        "order of the reserve",
        "care",
        (
            Level("unexplained alone"),
            Level("care-priority: then explained", policy="care-priority"),
            Level("care-sbf: so too, with forgetting", policy="care-sbf"),
        ),
    ),
    Ablation(
        "scale k_safe of the guard, 0: unguarded", "care-sbf", _rules("k_safe", (0, 0.25, 0.5, 1, 1.5, 2)), ("care",)
    ),
    Ablation("localisation margin sigma_pos, m", "care-sbf", _rules("position_sigma_m", (0, 0.2, 0.4, 0.8)), ("care",)),
    Ablation(
        "margin forgotten a keyframe, columns", "care-sbf", _rules("decay_per_keyframe", (0.25, 0.5, 1, 2)), ("care",)
    ),
)
POLICIES = {"full", *OTHERS, *(level.policy or ablation.policy for ablation in ABLATIONS for level in ablation.levels)}
"""The policies of the study itself."""


def configurations(seeds: Sequence[int], also: Sequence[str] = ()) -> list[EpisodeConfig]:
    """Every ablation in every place, and the full scan; `also` are further policies to stand beside `care`."""
    made = [config for place in PLACES for config in USUAL.configurations(place, ["full"], seeds)]
    for place, ablation in product(PLACES, ABLATIONS):
        for level in ablation.levels:
            made += level.configurations(place, [ablation.policy], seeds)
            made += level.for_others().configurations(place, ablation.beside(also), seeds)
    return list(dict.fromkeys(made))


def ablation_tables(rows: Sequence[Row]) -> list[Table]:
    """A table an ablation: levels and paired differences, place by place."""
    cells, groups = {cell.key: cell for cell in summarise(rows)}, grouped(rows)
    also = [policy for policy in dict.fromkeys(row["policy"] for row in rows) if policy not in POLICIES]
    return [_table(ablation, cells, groups, also) for ablation in ABLATIONS]


def _table(ablation: Ablation, cells: Mapping[Key, Cell], groups: Groups, also: Sequence[str]) -> Table:
    beside = ablation.beside(also)
    columns = ("level", "first detection m", "braked", *(f"minus {other}" for other in ("usual", *beside)))
    lines: list[tuple[str, ...]] = []
    for place in PLACES:
        lines.append((str(place),))
        for level in ablation.levels:
            ours = level.key(place, ablation.policy)
            usual = None if ablation.is_usual(level) else USUAL.key(place, ablation.policy)
            others = (usual, *(level.for_others().key(place, policy) for policy in beside))
            differences = (_difference(ours, other, groups) for other in others)
            name = level.label if usual else f"{level.label} (usual)"
            lines.append((name, *_levels(cells.get(ours)), *differences))
    return Table(f"{ablation.policy}: {ablation.title}", columns, tuple(lines), ablation.notes)


def _difference(ours: Key, other: Key | None, groups: Groups) -> str:
    return interval(contrast(DETECTION, groups.get(ours), groups.get(other))) if other else ""


def _levels(cell: Cell | None) -> tuple[str, str]:
    return (spread(cell.detection), f"{cell.braked}/{cell.episodes}") if cell else ("", "")
