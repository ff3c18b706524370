"""The rows of a study by cell: medians, counts and regret of each, and how two of them differ.

Rows of one scenario under the same conditions form a setting; in it, the rows of a policy at a
budget form a cell. Actors that were never detected are handled as `care_sim.evaluation.censoring`
says.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from care_sim.evaluation.censoring import Quartiles, Reading, quartiles
from care_sim.reports.contrasts import DETECTION, Contrast, contrast
from care_sim.reports.formatting import marked, tag_notes
from care_sim.study.rows.reading import (
    Groups,
    Key,
    detection,
    detections,
    full_of,
    grouped,
    tags_of_row,
)
from care_sim.study.rows.settings import Setting
from care_sim.study.run_config import Row

NO_ACTOR = Quartiles(None, None, None, 0)
"""Of a cell whose drives all meet nobody."""


@dataclass(frozen=True)
class Cell:
    """A policy at a budget in a setting. Distances in metres.

    `tags` of the policy; `met` counts the episodes with a first-sighting actor, `never` those of
    them without a detection, and `detection` is over them; `closest_pass` and
    `clearance` are over the episodes in which the actor came into the camera's view, None when
    there are none. `regret`: detection distance of the full scan of the same world minus this
    policy's, 0 at best, and `as_full` the episodes in which the policy detects no later; None for
    `full` and without it.
    """

    setting: Setting
    policy: str
    budget: float
    tags: tuple[str, ...]
    episodes: int
    met: int
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


def summarise(rows: Sequence[Row]) -> list[Cell]:
    """The cells of a study, in the order of their first rows, settings kept together."""
    groups = grouped(rows)
    settings = list(dict.fromkeys(setting for setting, _, _ in groups))
    cells = [_cell(key, groups) for key in groups]
    # The sort is stable, so that the policies of a budget keep the order of their rows.
    return sorted(cells, key=lambda cell: (settings.index(cell.setting), cell.budget))


def _cell(key: Key, groups: Groups) -> Cell:
    setting, policy, budget = key
    rows = groups[key]
    found = detections(rows)
    full = None if policy == "full" else full_of(groups, setting)
    # Full minus policy: a policy that detects later than the full scan has positive regret.
    regret = contrast(DETECTION, full, rows)
    return Cell(
        setting=setting,
        policy=policy,
        budget=budget,
        tags=tags_of_row(rows[0]),
        episodes=len(rows),
        met=len(found),
        never=sum(reading.censored for reading in found),
        detection=quartiles(found) or NO_ACTOR,
        braked=sum(row["braked"] for row in rows),
        closest_pass=_quartiles(rows, "min_distance_m"),
        clearance=_quartiles(rows, "clearance_m"),
        collisions=sum(row["collision"] for row in rows),
        regret=regret,
        as_full=_no_later(rows, full or ()) if regret else None,
    )


def _quartiles(rows: Sequence[Row], column: str) -> Quartiles | None:
    # An actor that never came into view was never passed: the episode has no value and is left out.
    return quartiles([Reading(row[column]) for row in rows if row[column] is not None])


def _no_later(rows: Sequence[Row], full: Sequence[Row]) -> int:
    bounds = {row["seed"]: found.value for row in full if (found := detection(row)) is not None}
    found_in = {row["seed"]: detection(row) for row in rows if row["seed"] in bounds}
    return sum(
        # An actor that neither detected is no success: a censored reading does not count.
        reading is not None and not reading.censored and reading.value >= bounds[seed]
        for seed, reading in found_in.items()
    )


class StudyCells:
    """What a study has played so far; cells without rows are None."""

    def __init__(self, rows: Sequence[Row]):
        self.rows = rows
        self.tags = {row["policy"]: tags_of_row(row) for row in rows}
        self._groups = grouped(rows)
        self._cells = {cell.key: cell for cell in summarise(rows)}

    @property
    def policies(self) -> list[str]:
        """Their names, in the order of their first rows."""
        return list(self.tags)

    def has(self, key: Key) -> bool:
        """Whether there are rows."""
        return key in self._groups

    def cell(self, key: Key) -> Cell | None:
        """What was measured."""
        return self._cells.get(key)

    def difference(self, ours: Key, theirs: Key) -> Contrast | None:
        """First detection in one cell minus that in another, on the seeds that both have."""
        return contrast(DETECTION, self._groups.get(ours), self._groups.get(theirs))

    def marked(self, policy: str) -> str:
        """A policy's name, with a mark when no car can have it."""
        return marked(policy, self.tags.get(policy, ()))

    def notes(self, policies: Iterable[str]) -> tuple[str, ...]:
        """What the marks of these policies mean."""
        return tag_notes(self.tags.get(policy, ()) for policy in policies)
