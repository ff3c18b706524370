"""The rows of a study of the mechanism by policy and scene, and their sums."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from care_sim.base.checks import check_known
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.evaluation.allocation_differences import AllocationDifference
from care_sim.evaluation.detection_order import DetectionOrder, detection_order
from care_sim.evaluation.miss_reasons import MISS_REASONS
from care_sim.evaluation.ray_shares import RAY_SHARES, shares_of_credit
from care_sim.evaluation.reserve_use import ReserveUse
from care_sim.study.mechanism_play import (
    ACCOUNT_COLUMNS,
    BELIEF_MARKS,
    BELIEF_SUMS,
    DIFFERING,
    RECEIVED,
)
from care_sim.study.rows.reading import policy_of, setting_of, tags_of_row
from care_sim.study.run_config import FULL, REFERENCE, Row


@dataclass(frozen=True)
class NewEntries:
    """The events of the shared belief, by mask (e,).

    `pictured` have an image box, `tracked` a track of their own already; forecasts of others alone
    explain those that are `falsely_explained`. The driver and the full scan miss those that are
    `missed` and `missed_by_full`.
    """

    pictured: Mask
    tracked: Mask
    falsely_explained: Mask
    missed: Mask
    missed_by_full: Mask


class MechanismRows:
    """The rows of one study: one driver, one budget, one setting. Policies are named with their
    parameters; the full scan is none of them.

    Raises InvalidInput for rows that do not tell of the same events of a scene, and for one that
    lacks what its policy must have.
    """

    def __init__(self, rows: Sequence[Row]):
        _check(rows)
        budgeted = [row for row in rows if row["policy"] != FULL]
        self.scenes = list(dict.fromkeys(row["scene"] for row in rows))
        self.driver: str = rows[0]["driver"]
        self.tags = {policy_of(row): tags_of_row(row) for row in budgeted}
        self._rows = {(policy_of(row), row["scene"]): row for row in budgeted}
        self._full = {row["scene"]: row for row in rows if row["policy"] == FULL}
        # All budgeted rows share setting and budget; a study that holds nothing but full scans has
        # their own.
        first = (budgeted or rows)[0]
        self.setting = setting_of(first)
        self.budget: float = first["budget"]

    @property
    def policies(self) -> tuple[str, ...]:
        """All but the full scan, in the order of their first rows."""
        return tuple(self.tags)

    @property
    def as_in_paper(self) -> bool:
        """Whether the paper's figures are of the same: the belief is CARE's, the films are no
        source's of one's own, and nothing departs from the default conditions.
        """
        return self.driver == REFERENCE and self.setting.as_in_paper

    @property
    def events(self) -> int:
        """First sightings of all scenes."""
        every = {row["scene"]: row for row in (*self._full.values(), *self._rows.values())}
        return sum(len(row["ttfds"]) for row in every.values())

    def reserve_use(self) -> ReserveUse:
        """Sums over the keyframes of the shared belief."""
        names = ("keyframes", "filled", "filled_rho", "explained_cells", "untaken_cells")
        return ReserveUse(*self._sums(self.driver, names))

    def entries(self) -> NewEntries:
        """The events of the shared belief, of the scenes that the full scan has too."""
        columns: list[list[bool]] = [[], [], [], [], []]
        for row, full in self._with_full(self.driver):
            marks = [row[name] for name in ("pictured", "tracked", "falsely_explained")]
            late = [[delay > 0 for delay in one["ttfds"]] for one in (row, full)]
            for column, values in zip(columns, (*marks, *late), strict=True):
                column.extend(values)
        return NewEntries(*(np.array(column, bool) for column in columns))

    def difference(self, policy: str) -> AllocationDifference:
        """How often the policy would fire otherwise than the driver on its belief."""
        names = ("keyframes", "differing_keyframes", "differing_cells")
        return AllocationDifference(*self._sums(policy, names))

    def received(self, policy: str) -> tuple[Integers, Mask]:
        """(e,) cells that the policy would fire at each event of the shared belief, and whether it
        appears inside coverage; of the scenes that driver and policy have.
        """
        pairs = [*self._pairs(policy, self.driver)]
        cells = [cell for row, _ in pairs for cell in row["received"]]
        covered = [mark for _, driving in pairs for mark in driving["covered"]]
        return np.array(cells, np.int64), np.array(covered, bool)

    def order(self, first: str, second: str) -> DetectionOrder:
        """Which of two policies found the events first, each on its own play."""
        return sum(
            (detection_order(a["ttfds"], b["ttfds"]) for a, b in self._pairs(first, second)),
            DetectionOrder(),
        )

    def credit(self, first: str, second: str) -> tuple[Floats, Mask]:
        """(e, 5) the part of every ray share in each event that the `first` caught at once and the
        `second` missed, and (e,) whether the first had a track of it already.
        """
        caught = [np.empty((0, len(RAY_SHARES)))]
        tracked = [np.empty(0, bool)]
        for ours, theirs in self._pairs(first, second):
            rays = np.array([ours[f"rays_{share}"] for share in RAY_SHARES], np.int64).T
            won = (np.array(ours["ttfds"]) == 0) & (np.array(theirs["ttfds"]) > 0)
            caught.append(shares_of_credit(rays[won]))
            tracked.append(np.array(ours["tracked"], bool)[won])
        return np.concatenate(caught), np.concatenate(tracked)

    def found_by_full(self, policy: str) -> int:
        """Events that the full scan finds at once, of the scenes that both have."""
        return sum(full["ttfds"].count(0) for _, full in self._with_full(policy))

    def misses(self, policy: str) -> dict[str, int]:
        """By reason, the events that the full scan finds at once and the policy does not."""
        counts = dict.fromkeys(MISS_REASONS, 0)
        for row, full in self._with_full(policy):
            for reason, delay in zip(row["misses"], full["ttfds"], strict=True):
                if reason and delay == 0:
                    counts[reason] += 1
        return counts

    def _sums(self, policy: str, names: Sequence[str]) -> list[int]:
        return [sum(row[name] for row in self._of(policy)) for name in names]

    def _of(self, policy: str) -> Iterator[Row]:
        return (self._rows[policy, scene] for scene in self.scenes if (policy, scene) in self._rows)

    def _pairs(self, first: str, second: str) -> Iterator[tuple[Row, Row]]:
        """The rows of two policies, scene by scene, of the scenes that both have."""
        for row in self._of(first):
            if (second, row["scene"]) in self._rows:
                yield row, self._rows[second, row["scene"]]

    def _with_full(self, policy: str) -> Iterator[tuple[Row, Row]]:
        for row in self._of(policy):
            if row["scene"] in self._full:
                yield row, self._full[row["scene"]]


def _check(rows: Sequence[Row]) -> None:
    """Raise InvalidInput for what no study writes: a file may be anybody's."""
    events = {row["scene"]: len(row["ttfds"]) for row in rows}
    for row in rows:
        place = f"scene {row['scene']}, {row['policy']}"
        if row["driver"] != rows[0]["driver"]:
            raise InvalidInput(
                f"{place}: all rows must have one driver, got {row['driver']} beside "
                f"{rows[0]['driver']}"
            )
        for name in _needed(row):
            if row[name] is None:
                raise InvalidInput(f"{place}: {name} must be given")
            if isinstance(row[name], tuple) and len(row[name]) != events[row["scene"]]:
                raise InvalidInput(
                    f"{place}: {name} must tell of the {events[row['scene']]} events of the scene, "
                    f"got {len(row[name])}"
                )
        for reason in row["misses"]:
            if reason:
                check_known("reason for a miss", reason, MISS_REASONS)


def _needed(row: Row) -> tuple[str, ...]:
    """What the row of its policy must have."""
    if row["policy"] == FULL:
        return ACCOUNT_COLUMNS
    if row["policy"] == row["driver"]:
        return (*ACCOUNT_COLUMNS, RECEIVED, *BELIEF_SUMS, *BELIEF_MARKS)
    return (*ACCOUNT_COLUMNS, RECEIVED, *DIFFERING)
