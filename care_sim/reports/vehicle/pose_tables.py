"""What an error of the car's pose does to forecasts, to the margin of Eq. 4 and to first
detections; and the guard at standstill.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from care_sim.core.forgetting import VEHICLE_SIGMA_M
from care_sim.reports.protocol.formatting import PAPER
from care_sim.reports.protocol.notes import papers
from care_sim.reports.table import Table, TableRow
from care_sim.reports.vehicle import paper
from care_sim.reports.vehicle.rows import VehicleRows, mean_over_forecasts, outcome, share, total
from care_sim.study.designs.variants import Group, Variant
from care_sim.study.designs.vehicle import (
    FORGETTING,
    POSE_GROUPS,
    POSE_LEVELS,
    POSE_POLICIES,
    forgetting,
)
from care_sim.study.run_config import REFERENCE, Row

_MARGINS = (
    "Held: forecasts whose error in azimuth lies within the columns of Eq. 4 at sigma_pos "
    f"{VEHICLE_SIGMA_M} m, and within the margin of a full hull. Released: cells of full hulls per "
    "keyframe that CARE+SBF would give up on the same tracks, by its sigma_pos."
)

_DRIVEN = (
    "Of drives: share of the way that was driven, mean, and of all keyframes those at which the "
    "car stands, for whatever reason."
)


def forecast_table(study: VehicleRows) -> Table:
    """Errors of forecasts, what the margins hold of them, and what forgetting releases."""
    lines: list[TableRow] = []
    for group in POSE_GROUPS:
        lines.append((group.name,))
        for level in POSE_LEVELS:
            rows = study.of(group, level, REFERENCE)
            if rows:
                lines.append((level.label, *_forecasts(rows)))
    return Table(
        f"Forecasts of {REFERENCE} with an error of the pose",
        (
            "pose",
            "mean error, m",
            "mean of the episodes' 95th percentiles, m",
            "held by Eq. 4",
            "held by a full hull",
            *(f"released, {rules.label}" for rules in FORGETTING),
            "way driven",
            "car stands",
        ),
        tuple(lines),
        (_MARGINS, _DRIVEN),
        papers((paper.GUARD,)),
    )


def _forecasts(rows: Sequence[Row]) -> TableRow:
    forecasts = total(rows, "forecasts")
    keyframes = total(rows, "keyframes")
    return (
        *(
            f"{mean_over_forecasts(rows, name):.2f}" if forecasts else ""
            for name in ("forecast_error_m", "forecast_error_p95_m")
        ),
        *(share(total(rows, f"forecasts_in_{name}"), forecasts) for name in ("eq4", "margin")),
        *(
            f"{total(rows, name) / keyframes:.1f}"
            for name in ("released_cells", "released_cells_vehicle")
        ),
        *_driven(rows),
    )


def _driven(rows: Sequence[Row]) -> TableRow:
    """Of drives alone: only they have a way."""
    drives = [row for row in rows if row.get("progress") is not None]
    if not drives:
        return "", ""
    standing = total(drives, "standing_keyframes")
    driven = float(np.mean([row["progress"] for row in drives]))
    return f"{100 * driven:.0f}%", share(standing, total(drives, "keyframes"))


def pose_tables(study: VehicleRows) -> list[Table]:
    """In every place, first detections and collisions by policy and error of the pose."""
    return [
        Table(
            f"{group.name}: first detection, m, and collisions with an error of the pose",
            ("policy", *(level.label for level in POSE_LEVELS)),
            tuple(_pose_lines(study, group)),
        )
        for group in POSE_GROUPS
    ]


def _pose_lines(study: VehicleRows, group: Group) -> Iterator[TableRow]:
    def line(name: str, policy: str, levels: Sequence[Variant]) -> TableRow:
        return (name, *(outcome(study.of(group, level, policy)) for level in levels))

    for policy in study.further(POSE_POLICIES):
        yield line(study.marked(policy), policy, POSE_LEVELS)
    for rules in FORGETTING:
        levels = [forgetting(level, rules) for level in POSE_LEVELS]
        yield line(f"care-sbf, {rules.label}", "care-sbf", levels)


def guard_table(study: VehicleRows) -> Table:
    """The guard of SBF at every keyframe at which a car stood, in all episodes of the study."""
    standing = [row for row in study.rows if row["standing_keyframes"]]
    least = min((row["standing_guard_least_m"] for row in standing), default=None)
    most = max((row["standing_guard_most_m"] for row in standing), default=None)
    told = "" if least is None or most is None else f"{least:.2f} to {most:.2f}"
    return Table(
        "The guard of Eq. 3 at standstill",
        ("", "keyframes at which the car stood", "guard distance, m"),
        (
            ("here", f"{total(study.rows, 'standing_keyframes'):,}", told),
            (PAPER, paper.STANDING_KEYFRAMES, paper.STANDING_GUARD_M),
        ),
        quotes=papers((paper.GUARD,)),
    )
