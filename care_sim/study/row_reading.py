"""What a row of the closed loop says: its setting, its policy, its first detection.

Rows of one scenario under the same conditions form a setting; in it, the rows of a policy at a
budget form a cell.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from care_sim.base.checks import is_number
from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import CAMERA_FAULTS, UNUSED_BY_FULL_SCAN
from care_sim.evaluation.censoring import Reading
from care_sim.study.episode_config import PLAIN_FIELDS, EpisodeConfig
from care_sim.study.run_config import Row

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
        return ", ".join(
            [
                self.scenario,
                *(f"{name.replace('_', ' ')} {value}" for name, value in self.conditions),
            ]
        )

    def for_full(self) -> "Setting":
        """The setting in which the full scan of the same world is found."""
        return Setting(
            self.scenario,
            tuple(pair for pair in self.conditions if pair[0] not in UNUSED_BY_FULL_SCAN),
        )


Key = tuple[Setting, str, float]
"""Setting, policy with its parameters, budget."""


Groups = Mapping[Key, Sequence[Row]]


def setting_of(row: Row) -> Setting:
    """The setting a row belongs to."""
    names = [name for name in row if name in PLAIN_FIELDS or name.startswith("scenario.")]
    changed = [
        (n, row[n])
        for n in names
        if n not in _AXES and row[n] is not None and row[n] != _USUAL.get(n)
    ]
    return Setting(
        row["scenario"], tuple(sorted((n.removeprefix("scenario."), v) for n, v in changed))
    )


def key_of(row: Row) -> Key:
    """The cell a row belongs to."""
    return setting_of(row), policy_of(row), row["budget"]


def policy_of(row: Row) -> str:
    """The policy with its parameters."""
    return with_parameters(row, "policy")


def with_parameters(row: Row, kind: str) -> str:
    """The name in the column `kind`, with the parameters in the columns whose names begin with it
    and a dot.
    """
    given = [
        (name.removeprefix(f"{kind}."), value)
        for name, value in row.items()
        if name.startswith(f"{kind}.")
    ]
    return " ".join(
        [row[kind], *(f"{name}={_text(value)}" for name, value in given if value is not None)]
    )


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


def detection(row: Row) -> Reading:
    """Detection distance in metres; of an actor never detected, the most it can have been.

    Raises InvalidInput for a row that has neither.
    """
    distance = row["detection_distance_m"]
    most = row["undetected_to_m"]
    if distance is None and most is None:
        raise InvalidInput(
            f"{row['scenario']} {row['policy']} seed {row['seed']}: one of detection_distance_m "
            "and undetected_to_m must be given"
        )
    return Reading(float(most), censored=True) if distance is None else Reading(float(distance))
