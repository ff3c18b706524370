"""How old the camera's evidence is, and what the compensation of the car's turn buys."""

from collections.abc import Iterator, Sequence

import numpy as np

from care_sim.reports.contrasts import AVOIDED, DETECTION, contrast, contrast_of_cases
from care_sim.reports.formatting import interval
from care_sim.reports.protocol.formatting import PAPER
from care_sim.reports.protocol.notes import papers
from care_sim.reports.table import Table, TableRow
from care_sim.reports.vehicle import paper
from care_sim.reports.vehicle.rows import VehicleRows, joined, outcome, share, total
from care_sim.study.designs.vehicle import (
    EVIDENCE_GROUPS,
    EVIDENCE_LEVELS,
    EVIDENCE_POLICIES,
    is_late,
    uncompensated,
)
from care_sim.study.run_config import REFERENCE, Row

_HELD = (
    "Of the camera boxes since whose picture the car has turned by a column or more, those whose "
    "wedge holds the centre of their object as it stands at the decision."
)


def evidence_table(study: VehicleRows) -> Table:
    """Ages of the evidence, and what wedges hold with and without compensation."""
    lines: list[TableRow] = []
    for group in EVIDENCE_GROUPS:
        lines.append((group.name,))
        for level in EVIDENCE_LEVELS:
            rows = study.of(group, level, REFERENCE)
            if rows:
                lines.append((level.label, *_ages(rows), *_held(rows)))
    lines.append((PAPER, *paper.EVIDENCE_AGES_S, "", "", ""))
    return Table(
        f"Evidence of {REFERENCE}",
        (
            "camera",
            "mean age, s",
            "95th percentile, s",
            "boxes turned",
            "held, compensated",
            "held, without",
        ),
        tuple(lines),
        (_HELD,),
        papers((paper.EVIDENCE,)),
    )


def _ages(rows: Sequence[Row]) -> TableRow:
    ages = joined(rows, "evidence_ages_ms") / 1e3
    if not len(ages):
        return "", ""
    return f"{ages.mean():.2f}", f"{np.percentile(ages, 95):.2f}"


def _held(rows: Sequence[Row]) -> TableRow:
    turned = total(rows, "turned_boxes")
    held = (share(total(rows, name), turned) for name in ("turned_held", "unturned_held"))
    return share(turned, total(rows, "boxes")), *held


def compensation_table(study: VehicleRows) -> Table:
    """First detections and collisions with and without compensation, beside other policies."""
    others = [policy for policy in study.further(EVIDENCE_POLICIES) if policy != REFERENCE]
    return Table(
        "What compensation of the car's turn buys: first detection, m, and collisions",
        (
            "camera",
            REFERENCE,
            "without compensation",
            *map(study.marked, others),
            "compensation buys, m",
            "collisions avoided, points",
        ),
        tuple(_compensation_lines(study, others)),
    )


def _compensation_lines(study: VehicleRows, others: Sequence[str]) -> Iterator[TableRow]:
    for group in EVIDENCE_GROUPS:
        # The seeds of a case are nearly copies of it, those of a drive are drives of their own.
        differ = contrast_of_cases if len(group.places) > 1 else contrast
        yield (group.name,)
        for level in EVIDENCE_LEVELS:
            rows = study.of(group, level, REFERENCE)
            if not rows:
                continue
            # Without lag there is nothing to compensate, and nothing is played twice.
            without = study.of(group, uncompensated(level), REFERENCE) if is_late(level) else []
            yield (
                level.label,
                outcome(rows),
                outcome(without),
                *(outcome(study.of(group, level, policy)) for policy in others),
                interval(differ(DETECTION, rows, without)),
                interval(differ(AVOIDED, rows, without)),
            )
