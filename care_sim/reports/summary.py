"""What the episodes of one cell of a study say together: medians, counts, regret.

Rows of one scenario under the same conditions form a setting; in it, the rows of a policy at a
budget form a cell. Actors that were never detected are handled as `care_sim.evaluation.censoring`
says.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from care_sim.evaluation.censoring import Quartiles, Reading, quartiles
from care_sim.reports.contrasts import DETECTION, Contrast, contrast
from care_sim.study.row_reading import Groups, Key, detection, full_of, grouped, tags_of_row
from care_sim.study.run_config import Row
from care_sim.study.settings import Setting


@dataclass(frozen=True)
class Cell:
    """A policy at a budget in a setting. Distances in metres.

    `tags` of the policy; `never` counts the episodes without a detection; `closest_pass` and
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
    return sum(
        not reading.censored and reading.value >= bounds[seed] for seed, reading in found.items()
    )
