"""Names of the report engine under their former path, until every room imports them from there."""

from collections.abc import Sequence

from care_sim.reports.engine import contrasts
from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.engine.measures import (
    AVOIDED,
    BRAKED,
    DETECTED,
    DETECTION,
    GATE_COLLISION_POINTS,
    GATE_M,
    GATE_POINTS,
    Measure,
)
from care_sim.study.rows.reading import is_avoided
from care_sim.study.run_config import Row

__all__ = [
    "AVOIDED",
    "BRAKED",
    "DETECTED",
    "DETECTION",
    "GATE_COLLISION_POINTS",
    "GATE_M",
    "GATE_POINTS",
    "Contrast",
    "Measure",
    "contrast",
    "contrast_of_cases",
    "preventable",
]


def contrast(
    measure: Measure, ours: Sequence[Row] | None, theirs: Sequence[Row] | None
) -> Contrast | None:
    """`ours` minus `theirs`, paired by seed; None without shared seeds that have the measure."""
    return contrasts.contrast(measure, measure.units(ours or ()), measure.units(theirs or ()))


def contrast_of_cases(
    measure: Measure, ours: Sequence[Row] | None, theirs: Sequence[Row] | None
) -> Contrast | None:
    """The same of rows whose `seed` is a pair of case and seed, where cases are drawn."""
    of_ours, of_theirs = (measure.units(rows or ()) for rows in (ours, theirs))
    return contrasts.contrast(measure, of_ours, of_theirs, by_cases=True)


def preventable(full: Sequence[Row], rows: Sequence[Row]) -> list[Row]:
    """The rows of the seeds on which the full scan avoids the collision."""
    spared = {row["seed"] for row in full if is_avoided(row)}
    return [row for row in rows if row["seed"] in spared]
