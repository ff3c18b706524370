"""The tables of the vehicle study: evidence, the camera that fails, the pose, the guard."""

from collections.abc import Callable, Sequence

import numpy as np

from care_sim.reports.engine.contrasts import contrast_of_rows
from care_sim.reports.engine.measures import AVOIDED, DETECTION
from care_sim.reports.formatting import interval, spread_of_counts
from care_sim.reports.mechanism.paper import CELLS_AT_APPEARANCE, VEHICLE_CELLS
from care_sim.reports.protocol.formatting import PAPER
from care_sim.reports.protocol.notes import papers
from care_sim.reports.table import Table, TableRow
from care_sim.reports.vehicle import paper
from care_sim.reports.vehicle.rows import (
    VehicleRows,
    joined,
    mean_over_forecasts,
    outcome,
    share,
    total,
)
from care_sim.study.designs.variants import Group, Variant
from care_sim.study.designs.vehicle import (
    BLACKOUTS,
    EVIDENCE_GROUPS,
    EVIDENCE_LEVELS,
    EVIDENCE_POLICIES,
    FALLBACK_POLICIES,
    FORGETTING,
    POSE_GROUPS,
    POSE_LEVELS,
    POSE_POLICIES,
    forgetting,
    is_late,
    uncompensated,
)
from care_sim.study.run_config import REFERENCE, Row
from care_sim.study.vehicle.play import ASKED

_Entries = Callable[[Group, Variant, Sequence[Row]], TableRow]
"""The entries of a level in a group of places, given the rows of CARE there."""
_FIRST_AND_HIT = "first detection, m, and collisions"


def vehicle_tables(rows: Sequence[Row]) -> list[Table]:
    """Evidence, the camera that fails, the pose, the guard."""
    study = VehicleRows(rows)
    return [
        Table(
            f"Evidence of {REFERENCE}",
            ("camera", "mean age, s", "95th percentile, s", "boxes turned", "held, compensated",
             "held, without"),
            (
                *_by_level(study, EVIDENCE_GROUPS, EVIDENCE_LEVELS, _evidence),
                (PAPER, *paper.EVIDENCE_AGES_S, "", "", ""),
            ),
            ("Held: wedges that hold the centre of their object, of boxes turned by a column.",),
            papers((paper.EVIDENCE,)),
        ),
        _compensation(study),
        _fallback(study),
        *(_cost(study, group, levels) for group, levels in BLACKOUTS.items()),
        Table(
            f"Forecasts of {REFERENCE} with an error of the pose",
            ("pose", "mean error, m", "mean of the episodes' 95th percentiles, m", "held by Eq. 4",
             "held by a full hull", *(f"released, {rules.label}" for rules in FORGETTING),
             "way driven", "car stands"),
            tuple(_by_level(study, POSE_GROUPS, POSE_LEVELS, _forecasts)),
            ("Held: forecasts within the margin. Released: cells per keyframe.",),
            papers((paper.GUARD,)),
        ),
        *(_pose(study, group) for group in POSE_GROUPS),
        _guard(study),
    ]  # fmt: skip


def _by_level(
    study: VehicleRows, groups: Sequence[Group], levels: Sequence[Variant], entries: _Entries
) -> list[TableRow]:
    """A row per level that CARE has played, below the name of each group of places."""
    lines: list[TableRow] = []
    for group in groups:
        lines.append((group.name,))
        played = ((level, study.of(group, level, REFERENCE)) for level in levels)
        lines += [(level.label, *entries(group, level, rows)) for level, rows in played if rows]
    return lines


def _evidence(_group: Group, _level: Variant, rows: Sequence[Row]) -> TableRow:
    """Ages of the evidence, and what wedges hold with and without compensation."""
    ages = joined(rows, "evidence_ages_ms") / 1e3
    told = (f"{ages.mean():.2f}", f"{np.percentile(ages, 95):.2f}") if len(ages) else ("", "")
    turned = total(rows, "turned_boxes")
    held = (share(total(rows, name), turned) for name in ("turned_held", "unturned_held"))
    return (*told, share(turned, total(rows, "boxes")), *held)


def _compensation(study: VehicleRows) -> Table:
    others = [policy for policy in study.further(EVIDENCE_POLICIES) if policy != REFERENCE]

    def entries(group: Group, level: Variant, rows: Sequence[Row]) -> TableRow:
        # The seeds of a case are nearly copies of it, those of a drive are drives of their own.
        by_cases = len(group.places) > 1
        # Without lag there is nothing to compensate, and nothing is played twice.
        without = study.of(group, uncompensated(level), REFERENCE) if is_late(level) else []
        beside = (outcome(study.of(group, level, policy)) for policy in others)
        gains = (
            interval(contrast_of_rows(measure, rows, without, by_cases))
            for measure in (DETECTION, AVOIDED)
        )
        return (outcome(rows), outcome(without), *beside, *gains)

    return Table(
        f"What compensation of the car's turn buys: {_FIRST_AND_HIT}",
        ("camera", REFERENCE, "without compensation", *map(study.marked, others),
         "compensation buys, m", "collisions avoided, points"),
        tuple(_by_level(study, EVIDENCE_GROUPS, EVIDENCE_LEVELS, entries)),
    )  # fmt: skip


def _fallback(study: VehicleRows) -> Table:
    """Whether the policies are one while the camera is away, and for how long after."""
    lines: list[TableRow] = []
    for group, levels in BLACKOUTS.items():
        for level in levels:
            rows = study.of(group, level, REFERENCE)
            if not total(rows, "dark_keyframes"):
                continue
            cells = joined(rows, "dark_entry_cells")
            covered = joined(rows, "dark_entry_covered").astype(bool)
            entries = joined(rows, "dark_entries_alike")
            apart = [row["apart_after_s"] for row in rows if row["apart_after_s"] is not None]
            lines.append(
                (
                    f"{group.name}: {level.label}",
                    f"{total(rows, 'dark_alike'):,} of {total(rows, 'dark_keyframes'):,}",
                    f"{int(entries.sum())} of {len(entries)}",
                    spread_of_counts(cells[~covered]),
                    spread_of_counts(cells[covered]),
                    f"{np.median(apart):.1f} ({len(apart)} of {len(rows)})" if apart else "",
                )
            )
    lines.append((PAPER, "", paper.ENTRIES_ALIKE, *CELLS_AT_APPEARANCE, ""))
    return Table(
        f"Allocations of {', '.join(ASKED)} on the belief of {REFERENCE} without a camera",
        ("camera", "keyframes alike", "new entries alike", "cells at first appearance",
         "inside coverage", "apart again after, s"),
        tuple(lines),
        ("Cells in the dilated hull of a new body: median [quartiles] (bodies).",),
        papers((VEHICLE_CELLS,)),
    )  # fmt: skip


def _cost(study: VehicleRows, group: Group, levels: Sequence[Variant]) -> Table:
    """What it costs that the camera is away for a time, and throughout."""
    lines: list[TableRow] = []
    for policy in study.further(FALLBACK_POLICIES):
        cells = [study.of(group, level, policy) for level in levels]
        if any(cells):
            lost = (
                contrast_of_rows(measure, cells[0], cells[1]) for measure in (DETECTION, AVOIDED)
            )
            lines.append((study.marked(policy), *map(outcome, cells), *map(interval, lost)))
    on, times, _ = (level.label for level in levels)
    labels = (level.label for level in levels)
    columns = ("policy", *labels, f"{on} minus {times}, m", f"{on} minus {times}, points")
    title = f"{group.name}: what a camera that fails costs, {_FIRST_AND_HIT}"
    return Table(title, columns, tuple(lines))


def _forecasts(_group: Group, _level: Variant, rows: Sequence[Row]) -> TableRow:
    """Errors of forecasts, what the margins hold of them, and what forgetting releases."""
    forecasts, keyframes = total(rows, "forecasts"), total(rows, "keyframes")
    errors = ("forecast_error_m", "forecast_error_p95_m")
    held = ("forecasts_in_eq4", "forecasts_in_margin")
    released = ("released_cells", "released_cells_vehicle")
    # Only drives have a way.
    drives = [row for row in rows if row.get("progress") is not None]
    way = float(np.mean([row["progress"] for row in drives])) if drives else 0.0
    return (
        *(f"{mean_over_forecasts(rows, name):.2f}" if forecasts else "" for name in errors),
        *(share(total(rows, name), forecasts) for name in held),
        *(f"{total(rows, name) / keyframes:.1f}" for name in released),
        f"{100 * way:.0f}%" if drives else "",
        share(total(drives, "standing_keyframes"), total(drives, "keyframes")) if drives else "",
    )


def _pose(study: VehicleRows, group: Group) -> Table:
    """First detections and collisions by policy and error of the pose."""
    played: list[tuple[str, str, Sequence[Variant]]]
    played = [(study.marked(each), each, POSE_LEVELS) for each in study.further(POSE_POLICIES)]
    played += [
        (f"care-sbf, {rules.label}", "care-sbf",
         tuple(forgetting(level, rules) for level in POSE_LEVELS))
        for rules in FORGETTING
    ]  # fmt: skip
    return Table(
        f"{group.name}: {_FIRST_AND_HIT} with an error of the pose",
        ("policy", *(level.label for level in POSE_LEVELS)),
        tuple(
            (name, *(outcome(study.of(group, level, policy)) for level in levels))
            for name, policy, levels in played
        ),
    )


def _guard(study: VehicleRows) -> Table:
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
