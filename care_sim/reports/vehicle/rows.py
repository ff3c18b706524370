"""The rows of the vehicle study, and what its tables make of their columns."""

from collections.abc import Sequence

import numpy as np

from care_sim.core.arrays import Integers
from care_sim.evaluation.censoring import quartiles
from care_sim.reports.formatting import median
from care_sim.reports.group_rows import GroupRows
from care_sim.study.designs.vehicle import PLAYED_IN_PART
from care_sim.study.rows.reading import detections
from care_sim.study.run_config import Row


class VehicleRows(GroupRows):
    """The rows of the vehicle study."""

    def further(self, policies: Sequence[str]) -> list[str]:
        """The policies, then those that joined in."""
        known = {*policies, *PLAYED_IN_PART}
        return [*policies, *(policy for policy in self.tags if policy not in known)]


def total(rows: Sequence[Row], column: str) -> int:
    """The sum of a column."""
    return int(sum(row[column] for row in rows))


def joined(rows: Sequence[Row], column: str) -> Integers:
    """The lists of a column, one after the other."""
    return np.array([value for row in rows for value in row[column]], np.int64)


def share(part: int, whole: int) -> str:
    """A part in per cent; empty of nothing."""
    return f"{100 * part / whole:.1f}%" if whole else ""


def mean_over_forecasts(rows: Sequence[Row], column: str) -> float:
    """The mean of a column over episodes, each weighed by its forecasts; NaN without any."""
    seen = [row for row in rows if row["forecasts"]]
    if not seen:
        return np.nan
    weights = [row["forecasts"] for row in seen]
    return float(np.average([row[column] for row in seen], weights=weights))


def outcome(rows: Sequence[Row]) -> str:
    """Median first detection in metres, of how many episodes where some met nobody, and how many
    episodes ended with a collision.
    """
    if not rows:
        return ""
    found = detections(rows)
    met = f" ({len(found)})" if len(found) < len(rows) else ""
    hits = sum(row["collision"] for row in rows)
    return f"{median(quartiles(found))}{met}, {hits}/{len(rows)}"
