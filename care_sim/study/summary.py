"""What the episodes of one cell of a study say together: medians, counts, paired differences.

Rows of one scenario under the same conditions form a setting; in it, the rows of a policy at a budget
form a cell. Policies are compared seed by seed, because a seed fixes world, faults and floor.

A first-sighting actor that is never detected has no detection distance. It ranks as 0 m, later than any
detection, in medians, quartiles and differences, and is counted beside them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from care_sim.evaluation.bootstrap import Interval, paired_difference
from care_sim.study.config import PLAIN_FIELDS, EpisodeConfig
from care_sim.study.episode import Row

Conditions = tuple[tuple[str, Any], ...]

_AXES = ("scenario", "policy", "budget", "seed")
_USUAL = {field.name: field.default for field in fields(EpisodeConfig)}
_OF_CAMERA = ("false_negative_rate", "camera_latency")
_UNFELT_BY_FULL = (*_OF_CAMERA, "reserve_fraction", "floor")
"""A scan of every cell asks neither the camera nor the allocator."""


@dataclass(frozen=True, order=True)
class Setting:
    """A scenario and the conditions in which it departs from the defaults."""

    scenario: str
    conditions: Conditions = ()

    @property
    def faults(self) -> bool:
        """Whether the camera is impaired."""
        return any(name in _OF_CAMERA for name, _ in self.conditions)

    @property
    def label(self) -> str:
        """A heading."""
        return ", ".join([self.scenario, *(f"{name.replace('_', ' ')} {value}" for name, value in self.conditions)])

    def for_full(self) -> "Setting":
        """The setting in which the full scan of the same world is found."""
        return Setting(self.scenario, tuple(pair for pair in self.conditions if pair[0] not in _UNFELT_BY_FULL))


@dataclass(frozen=True)
class Quartiles:
    """Lower quartile, median and upper quartile, and the number of values."""

    low: float
    median: float
    high: float
    count: int


@dataclass(frozen=True)
class Cell:
    """A policy at a budget in a setting. Distances in metres.

    `detection` ranks the `never` detected at 0 m; `closest_pass` and `clearance` are over the episodes
    in which the actor came into the camera's view, None when there are none. `vs_full` and `vs_care` are
    this policy's mean detection distance minus that of `full` or `care`, paired by seed: positive when this
    one detects earlier, None without shared seeds.
    """

    setting: Setting
    policy: str
    budget: float
    episodes: int
    never: int
    detection: Quartiles
    braked: int
    closest_pass: Quartiles | None
    clearance: Quartiles | None
    collisions: int
    vs_full: Interval | None
    vs_care: Interval | None


def setting_of(row: Row) -> Setting:
    """The setting a row belongs to."""
    names = [name for name in row if name in PLAIN_FIELDS or name.startswith("scenario.")]
    changed = [(n, row[n]) for n in names if n not in _AXES and row[n] is not None and row[n] != _USUAL.get(n)]
    return Setting(row["scenario"], tuple(sorted((n.removeprefix("scenario."), v) for n, v in changed)))


def policy_of(row: Row) -> str:
    """The policy with its parameters."""
    given = [f"{n.removeprefix('policy.')}={v}" for n, v in row.items() if n.startswith("policy.") and v is not None]
    return " ".join([row["policy"], *given])


def detection_distance(row: Row) -> float:
    """Metres; 0 for an actor that was never detected, later than any detection."""
    distance = row["detection_distance_m"]
    return 0.0 if distance is None else float(distance)


def quartiles(values: Sequence[float]) -> Quartiles | None:
    """Quartiles of values, linearly interpolated; None without values."""
    if not values:
        return None
    low, median, high = np.quantile(values, (0.25, 0.5, 0.75)).tolist()
    return Quartiles(low, median, high, len(values))


def summarise(rows: Sequence[Row]) -> list[Cell]:
    """The cells of a study, in the order of their first rows, settings kept together."""
    groups: dict[tuple[Setting, str, float], list[Row]] = {}
    for row in rows:
        groups.setdefault((setting_of(row), policy_of(row), row["budget"]), []).append(row)
    settings = list(dict.fromkeys(setting for setting, _, _ in groups))
    cells = [_cell(key, groups) for key in groups]
    return sorted(cells, key=lambda cell: (settings.index(cell.setting), cell.budget))


def _cell(key: tuple[Setting, str, float], groups: dict[tuple[Setting, str, float], list[Row]]) -> Cell:
    setting, policy, budget = key
    rows = groups[key]
    detection = quartiles([detection_distance(row) for row in rows])
    assert detection is not None
    full, care = groups.get((setting.for_full(), "full", 1.0)), groups.get((setting, "care", budget))
    return Cell(
        setting=setting,
        policy=policy,
        budget=budget,
        episodes=len(rows),
        never=sum(row["detection_distance_m"] is None for row in rows),
        detection=detection,
        braked=sum(row["braked"] for row in rows),
        closest_pass=quartiles([row["min_distance_m"] for row in rows if row["min_distance_m"] is not None]),
        clearance=quartiles([row["clearance_m"] for row in rows if row["clearance_m"] is not None]),
        collisions=sum(row["collision"] for row in rows),
        vs_full=None if policy == "full" else difference(rows, full),
        vs_care=None if policy == "care" else difference(rows, care),
    )


def difference(ours: Sequence[Row] | None, theirs: Sequence[Row] | None) -> Interval | None:
    """Mean detection distance of `ours` minus `theirs`, paired by seed; None without shared seeds."""
    a, b = ({row["seed"]: detection_distance(row) for row in rows or ()} for rows in (ours, theirs))
    seeds = sorted(set(a) & set(b))
    return paired_difference([a[s] for s in seeds], [b[s] for s in seeds]) if seeds else None
