"""What the episodes of one cell of a study say together: medians, counts, regret.

Rows of one scenario under the same conditions form a setting; in it, the rows of a policy at a budget
form a cell. Actors that were never detected are handled as `care_sim.evaluation.censoring` says.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from care_sim.base.errors import is_number
from care_sim.core.conditions import CAMERA_FAULTS, UNFELT_BY_FULL
from care_sim.evaluation.censoring import Quartiles, Reading, quartiles
from care_sim.reports.contrasts import DETECTION, Contrast, contrast, detection
from care_sim.study.episode_config import PLAIN_FIELDS, EpisodeConfig
from care_sim.study.task import Row

Conditions = tuple[tuple[str, Any], ...]

_AXES = ("scenario", "policy", "budget", "seed")
_USUAL = {field.name: field.default for field in fields(EpisodeConfig)}


@dataclass(frozen=True, order=True)
class Setting:
    """A scenario and the conditions in which it departs from the defaults."""

    scenario: str
    conditions: Conditions = ()

    @property
    def faults(self) -> bool:
        """Whether the camera is impaired."""
        return any(name in CAMERA_FAULTS for name, _ in self.conditions)

    @property
    def label(self) -> str:
        """A heading."""
        return ", ".join([self.scenario, *(f"{name.replace('_', ' ')} {value}" for name, value in self.conditions)])

    def for_full(self) -> "Setting":
        """The setting in which the full scan of the same world is found."""
        return Setting(self.scenario, tuple(pair for pair in self.conditions if pair[0] not in UNFELT_BY_FULL))


Key = tuple[Setting, str, float]
"""Setting, policy with its parameters, budget."""
Groups = Mapping[Key, Sequence[Row]]


@dataclass(frozen=True)
class Cell:
    """A policy at a budget in a setting. Distances in metres.

    `tags` of the policy; `never` counts the episodes without a detection; `closest_pass` and `clearance` are over
    the episodes in which the actor came into the camera's view, None when there are none. `regret`: detection
    distance of the full scan of the same world minus this policy's, 0 at best, and `as_full` the episodes in which
    the policy detects no later; None for `full` and without it.
    """

    setting: Setting
    policy: str
    budget: float
    tags: tuple[str, ...]
    episodes: int
    never: int
    detection: Quartiles
    braked: int
    closest_pass: Quartiles | None
    clearance: Quartiles | None
    collisions: int
    regret: Contrast | None
    as_full: int | None

    @property
    def key(self) -> Key:
        """Where its rows are found."""
        return self.setting, self.policy, self.budget


def setting_of(row: Row) -> Setting:
    """The setting a row belongs to."""
    names = [name for name in row if name in PLAIN_FIELDS or name.startswith("scenario.")]
    changed = [(n, row[n]) for n in names if n not in _AXES and row[n] is not None and row[n] != _USUAL.get(n)]
    return Setting(row["scenario"], tuple(sorted((n.removeprefix("scenario."), v) for n, v in changed)))


def key_of(row: Row) -> Key:
    """The cell a row belongs to."""
    return setting_of(row), policy_of(row), row["budget"]


def policy_of(row: Row) -> str:
    """The policy with its parameters."""
    return with_parameters(row, "policy")


def with_parameters(row: Row, kind: str) -> str:
    """The name in the column `kind`, with the parameters in the columns whose names begin with it and a dot."""
    given = [(name.removeprefix(f"{kind}."), value) for name, value in row.items() if name.startswith(f"{kind}.")]
    return " ".join([row[kind], *(f"{name}={_text(value)}" for name, value in given if value is not None)])


def _text(value: Any) -> str:
    """The same for a number that was an int before a file held it."""
    return f"{value:g}" if is_number(value) else f"{value}"


def tags_of_row(row: Row) -> tuple[str, ...]:
    """Tags of the row's policy, such as privileged; none in a row that was not annotated."""
    return tuple((row.get("tags") or "").split("+"))


def grouped(rows: Sequence[Row]) -> dict[Key, list[Row]]:
    """The rows of every cell, in the order of their first rows."""
    groups: dict[Key, list[Row]] = {}
    for row in rows:
        groups.setdefault(key_of(row), []).append(row)
    return groups


def full_of(groups: Groups, setting: Setting) -> Sequence[Row] | None:
    """The full scans of the same worlds, None where they were not run."""
    return groups.get((setting.for_full(), "full", 1.0))


def summarise(rows: Sequence[Row]) -> list[Cell]:
    """The cells of a study, in the order of their first rows, settings kept together."""
    groups = grouped(rows)
    settings = list(dict.fromkeys(setting for setting, _, _ in groups))
    cells = [_cell(key, groups) for key in groups]
    return sorted(cells, key=lambda cell: (settings.index(cell.setting), cell.budget))


def _cell(key: Key, groups: Groups) -> Cell:
    setting, policy, budget = key
    rows = groups[key]
    detections = quartiles([detection(row) for row in rows])
    assert detections is not None
    full = None if policy == "full" else full_of(groups, setting)
    regret = contrast(DETECTION, full, rows)
    return Cell(
        setting=setting,
        policy=policy,
        budget=budget,
        tags=tags_of_row(rows[0]),
        episodes=len(rows),
        never=sum(detection(row).censored for row in rows),
        detection=detections,
        braked=sum(row["braked"] for row in rows),
        closest_pass=_quartiles(rows, "min_distance_m"),
        clearance=_quartiles(rows, "clearance_m"),
        collisions=sum(row["collision"] for row in rows),
        regret=regret,
        as_full=_no_later(rows, full or ()) if regret else None,
    )


def _quartiles(rows: Sequence[Row], column: str) -> Quartiles | None:
    return quartiles([Reading(row[column]) for row in rows if row[column] is not None])


def _no_later(rows: Sequence[Row], full: Sequence[Row]) -> int:
    bounds = {row["seed"]: detection(row).value for row in full}
    found = {row["seed"]: detection(row) for row in rows if row["seed"] in bounds}
    return sum(not reading.censored and reading.value >= bounds[seed] for seed, reading in found.items())
