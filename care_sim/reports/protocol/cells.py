"""The plays of a study by cell, for comparisons of one setting with another."""

from collections.abc import Sequence

import numpy as np

from care_sim.evaluation.scene_contrasts import Ratio, Tallies, ratio_level
from care_sim.reports.protocol.differences import MeasuredDifference, difference_between
from care_sim.reports.protocol.rows import plays_by_setting
from care_sim.study.rows.reading import Key
from care_sim.study.run_config import Row


class PlayCells:
    """What the plays of every cell found, of all objects or `within` one stratum."""

    def __init__(self, rows: Sequence[Row]):
        self._plays = {plays.setting: plays for plays in plays_by_setting(rows)}

    def tallies(self, key: Key, within: str = "") -> Tallies:
        """The mean tally over floor seeds of every scene; none of a cell that was not played."""
        setting, policy, budget = key
        plays = self._plays.get(setting)
        return plays.tallies(policy, budget, within) if plays else {}

    def level(self, ratio: Ratio, key: Key, within: str = "") -> float | None:
        """A measure over all scenes; None where nothing is to be found or was played."""
        return ratio_level(ratio, self.tallies(key, within)).by_event

    def difference(
        self, ratio: Ratio, ours: Key, theirs: Key, within: str = ""
    ) -> MeasuredDifference | None:
        """One cell less another, paired by scene; None without a shared one."""
        return difference_between(ratio, self.tallies(ours, within), self.tallies(theirs, within))

    def mean(self, column: str, key: Key) -> float | None:
        """A column of the plays; None where not all of them tell it."""
        setting, policy, budget = key
        plays = self._plays.get(setting)
        rows = plays.rows(policy, budget) if plays else ()
        told = [row[column] for row in rows if row.get(column) is not None]
        return float(np.mean(told)) if told and len(told) == len(rows) else None
