"""The vehicle study beside the paper's figures (Sec. 5.5): the age of the camera's evidence, a
camera that fails, an error of the pose, the guard at standstill.
"""

from collections.abc import Callable, Sequence

import numpy as np

from care_sim.core.arrays import Integers
from care_sim.evaluation.censoring import quartiles
from care_sim.reports.engine.contrasts import contrast_of_rows
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.measures import AVOIDED, DETECTION
from care_sim.reports.engine.tables import under_headings
from care_sim.reports.formatting import interval, median, spread_of_counts
from care_sim.reports.protocol.formatting import PAPER, papers
from care_sim.reports.table import Table, TableRow
from care_sim.reports.tables.mechanism import CELLS_AT_APPEARANCE, VEHICLE_CELLS
from care_sim.study.designs import vehicle as design
from care_sim.study.designs.variants import Group, Variant
from care_sim.study.rows.reading import detections
from care_sim.study.run_config import REFERENCE, Row
from care_sim.study.vehicle_play import ASKED

_Entries = Callable[[Group, Variant, Sequence[Row]], TableRow]
"""The entries of a level in a group of places, given the rows of CARE there."""
_FIRST_AND_HIT = "first detection, m, and collisions"
_EVIDENCE = (
    "The reserve uses the newest camera frame at or before each decision, rotating wedge "
    "directions by the ego yaw change over the gap; this evidence is 0.11 to 0.14 s old on average "
    "against the 0.30 s keyframe spacing, and 0.42 s at the 95th percentile."
)
_GUARD = (
    "At standstill the guard equaled k_safe s_0 = 4.00 m on all 570 keyframes, and the margin of "
    "Eq. 4 kept the net release near zero, the intended conservative behavior."
)


class VehicleRows:
    """The rows of the study by group of places, level and policy."""

    def __init__(self, rows: Sequence[Row]):
        self.frame = Frame(rows)

    def of(self, group: Group, level: Variant, policy: str) -> list[Row]:
        """The rows of all places of a group, none where nothing was played. Their `seed` names
        place and seed: policies are paired by world.
        """
        return [
            row | {"seed": (number, row["seed"])}
            for number, place in enumerate(group.places)
            for row in self.frame.of(level.key(place, policy))
        ]

    def further(self, policies: Sequence[str]) -> list[str]:
        """The policies, then those that joined in."""
        known = {*policies, *design.PLAYED_IN_PART}
        return [*policies, *(policy for policy in self.frame.policies if policy not in known)]


def vehicle_tables(rows: Sequence[Row]) -> list[Table]:
    """Evidence, the camera that fails, the pose, the guard."""
    study = VehicleRows(rows)
    return [
        Table(
            f"Evidence of {REFERENCE}",
            ("camera", "mean age, s", "95th percentile, s", "boxes turned", "held, compensated",
             "held, without"),
            (
                *_by_level(study, design.EVIDENCE_GROUPS, design.EVIDENCE_LEVELS, _evidence),
                (PAPER, "0.11 to 0.14", "0.42", "", "", ""),
            ),
            ("Held: wedges that hold the centre of their object, of boxes turned by a column.",),
            papers((_EVIDENCE,)),
        ),
        _compensation(study),
        _fallback(study),
        *(_cost(study, group, levels) for group, levels in design.BLACKOUTS.items()),
        Table(
            f"Forecasts of {REFERENCE} with an error of the pose",
            ("pose", "mean error, m", "mean of the episodes' 95th percentiles, m", "held by Eq. 4",
             "held by a full hull", *(f"released, {rules.label}" for rules in design.FORGETTING),
             "way driven", "car stands"),
            _by_level(study, design.POSE_GROUPS, design.POSE_LEVELS, _forecasts),
            ("Held: forecasts within the margin. Released: cells per keyframe.",),
            papers((_GUARD,)),
        ),
        *(_pose(study, group) for group in design.POSE_GROUPS),
        _guard(rows),
    ]  # fmt: skip


def _by_level(
    study: VehicleRows, groups: Sequence[Group], levels: Sequence[Variant], entries: _Entries
) -> tuple[TableRow, ...]:
    """A row per level that CARE has played, below the name of each group of places."""
    return under_headings(
        {
            group.name: [
                (level.label, *entries(group, level, rows))
                for level in levels
                if (rows := study.of(group, level, REFERENCE))
            ]
            for group in groups
        }
    )


def _evidence(_group: Group, _level: Variant, rows: Sequence[Row]) -> TableRow:
    """Ages of the evidence, and what wedges hold with and without compensation."""
    ages = _joined(rows, "evidence_ages_ms") / 1e3
    told = (f"{ages.mean():.2f}", f"{np.percentile(ages, 95):.2f}") if len(ages) else ("", "")
    turned = total(rows, "turned_boxes")
    held = (_share(total(rows, name), turned) for name in ("turned_held", "unturned_held"))
    return (*told, _share(turned, total(rows, "boxes")), *held)


def _compensation(study: VehicleRows) -> Table:
    others = [policy for policy in study.further(design.EVIDENCE_POLICIES) if policy != REFERENCE]

    def entries(group: Group, level: Variant, rows: Sequence[Row]) -> TableRow:
        # The seeds of a case are nearly copies of it, those of a drive are drives of their own.
        by_cases = len(group.places) > 1
        # Without lag there is nothing to compensate, and nothing is played twice.
        without = (
            study.of(group, design.uncompensated(level), REFERENCE) if design.is_late(level) else []
        )
        beside = (outcome(study.of(group, level, policy)) for policy in others)
        return (outcome(rows), outcome(without), *beside, *_less(rows, without, by_cases))

    return Table(
        f"What compensation of the car's turn buys: {_FIRST_AND_HIT}",
        ("camera", REFERENCE, "without compensation", *map(study.frame.marked, others),
         "compensation buys, m", "collisions avoided, points"),
        _by_level(study, design.EVIDENCE_GROUPS, design.EVIDENCE_LEVELS, entries),
    )  # fmt: skip


def _fallback(study: VehicleRows) -> Table:
    """Whether the policies are one while the camera is away, and for how long after."""
    lines: list[TableRow] = []
    for group, level in (
        (group, level) for group, own in design.BLACKOUTS.items() for level in own
    ):
        rows = study.of(group, level, REFERENCE)
        dark = total(rows, "dark_keyframes")
        if not dark:
            continue
        cells = _joined(rows, "dark_entry_cells")
        covered = _joined(rows, "dark_entry_covered").astype(bool)
        alike = _joined(rows, "dark_entries_alike")
        apart = [row["apart_after_s"] for row in rows if row["apart_after_s"] is not None]
        lines.append(
            (
                f"{group.name}: {level.label}",
                f"{total(rows, 'dark_alike'):,} of {dark:,}",
                f"{int(alike.sum())} of {len(alike)}",
                spread_of_counts(cells[~covered]),
                spread_of_counts(cells[covered]),
                f"{np.median(apart):.1f} ({len(apart)} of {len(rows)})" if apart else "",
            )
        )
    lines.append((PAPER, "", "37 of 37", *CELLS_AT_APPEARANCE, ""))
    return Table(
        f"Allocations of {', '.join(ASKED)} on the belief of {REFERENCE} without a camera",
        ("camera", "keyframes alike", "new entries alike", "cells at first appearance",
         "inside coverage", "apart again after, s"),
        tuple(lines),
        ("Cells in the dilated hull of a new body: median [quartiles] (bodies).",),
        papers((VEHICLE_CELLS,)),
    )  # fmt: skip


def _cost(study: VehicleRows, group: Group, levels: Sequence[Variant]) -> Table:
    """Return a table of the cost of losing the camera for a time, and throughout."""
    lines: list[TableRow] = []
    for policy in study.further(design.FALLBACK_POLICIES):
        cells = [study.of(group, level, policy) for level in levels]
        if any(cells):
            lines.append(
                (study.frame.marked(policy), *map(outcome, cells), *_less(cells[0], cells[1]))
            )
    labels = [level.label for level in levels]
    lost = " minus ".join(labels[:2])
    columns = ("policy", *labels, f"{lost}, m", f"{lost}, points")
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
    way = f"{100 * np.mean([row['progress'] for row in drives]):.0f}%" if drives else ""
    return (
        *(f"{mean_over_forecasts(rows, name):.2f}" if forecasts else "" for name in errors),
        *(_share(total(rows, name), forecasts) for name in held),
        *(f"{total(rows, name) / keyframes:.1f}" for name in released),
        way,
        _share(total(drives, "standing_keyframes"), total(drives, "keyframes")),
    )


def _pose(study: VehicleRows, group: Group) -> Table:
    """First detections and collisions by policy and error of the pose."""
    played: dict[str, tuple[str, Sequence[Variant]]] = {
        study.frame.marked(each): (each, design.POSE_LEVELS)
        for each in study.further(design.POSE_POLICIES)
    }
    for rules in design.FORGETTING:
        levels = tuple(design.forgetting(level, rules) for level in design.POSE_LEVELS)
        played[f"care-sbf, {rules.label}"] = "care-sbf", levels
    return Table(
        f"{group.name}: {_FIRST_AND_HIT} with an error of the pose",
        ("policy", *(level.label for level in design.POSE_LEVELS)),
        tuple(
            (name, *(outcome(study.of(group, level, policy)) for level in levels))
            for name, (policy, levels) in played.items()
        ),
    )


def _guard(rows: Sequence[Row]) -> Table:
    """The guard of SBF at every keyframe at which a car stood, in all episodes of the study."""
    least, most = (
        [row[f"standing_guard_{end}_m"] for row in rows if row["standing_keyframes"]]
        for end in ("least", "most")
    )
    told = f"{min(least):.2f} to {max(most):.2f}" if least else ""
    return Table(
        "The guard of Eq. 3 at standstill",
        ("", "keyframes at which the car stood", "guard distance, m"),
        (
            ("here", f"{total(rows, 'standing_keyframes'):,}", told),
            (PAPER, "570", "4.00"),
        ),
        quotes=papers((_GUARD,)),
    )


def _less(ours: Sequence[Row], theirs: Sequence[Row], by_cases: bool = False) -> TableRow:
    """First detection and collisions avoided, of one side minus the other."""
    found = (contrast_of_rows(each, ours, theirs, by_cases) for each in (DETECTION, AVOIDED))
    return tuple(map(interval, found))


def total(rows: Sequence[Row], column: str) -> int:
    """The sum of a column."""
    return int(sum(row[column] for row in rows))


def _joined(rows: Sequence[Row], column: str) -> Integers:
    """The lists of a column, one after the other."""
    return np.array([value for row in rows for value in row[column]], np.int64)


def _share(part: int, whole: int) -> str:
    """A part in per cent; empty of nothing."""
    return f"{100 * part / whole:.1f}%" if whole else ""


def mean_over_forecasts(rows: Sequence[Row], column: str) -> float:
    """The mean of a column over episodes, each weighed by its forecasts; NaN without any."""
    seen = [row for row in rows if row["forecasts"]]
    if not seen:
        return np.nan
    return float(np.average([row[column] for row in seen], weights=[r["forecasts"] for r in seen]))


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
