"""The table that ends a study on a terminal: a level of each main policy per setting and budget."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from rich.console import Console

from care_sim.base.errors import percent
from care_sim.evaluation.censoring import quartiles
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, among, ratio_level
from care_sim.reports.engine.controls import BEST_CONTROL, best_control, is_control
from care_sim.reports.formatting import median
from care_sim.reports.protocol.formatting import written
from care_sim.reports.protocol.rows import HISTORY, plays_by_setting
from care_sim.reports.table import Table, TableRow
from care_sim.study.rows.reading import (
    detection,
    detections,
    full_of,
    grouped,
    policy_of,
    tags_of_row,
)
from care_sim.study.run_config import FULL, REFERENCE, Row

MOST_LINES = 15
"""Lines of a table at the end of a study."""
_MAIN = (HISTORY, "all-camera", REFERENCE)
_OTHERS = 2
"""Further policies in the table of levels."""


@dataclass
class _Line:
    """The levels of a setting at a budget by policy: as text, and as a number for the controls."""

    setting: str
    budget: float
    full: str
    texts: dict[str, str] = field(default_factory=dict)
    controls: dict[str, float | None] = field(default_factory=dict)


def shortened(table: Table, console: Console) -> Table:
    """The first rows of a table, as many as a console shows in `MOST_LINES`."""
    shown = table
    kept = len(table.rows)
    while kept > 1 and len(console.render_lines(shown.rich(), pad=False)) > MOST_LINES:
        kept -= 1
        # A heading alone says nothing.
        while len(table.rows[kept - 1]) == 1 and kept > 1:
            kept -= 1
        note = f"{kept} of {len(table.rows)} rows; --verbose prints all."
        shown = replace(table, rows=table.rows[:kept], notes=(note,))
    return shown


def medians(rows: Sequence[Row]) -> Table:
    """Median first detections in metres, of plain settings if there are any."""
    groups = grouped(rows)
    tags = {policy_of(row): tags_of_row(row) for row in rows}
    settings = dict.fromkeys(setting for setting, policy, _ in groups if policy != FULL)
    plain = [setting for setting in settings if not setting.conditions]
    lines = []
    for setting in plain or settings:
        full = median(quartiles(detections(full_of(groups, setting) or ())))
        for budget in sorted({at for of, p, at in groups if of == setting and p != FULL}):
            own = {policy: groups.get((setting, policy, budget), []) for policy in tags}
            texts = {p: median(quartiles(detections(held))) for p, held in own.items() if held}
            controls = {p: own[p] for p in texts if is_control(tags[p])}
            lines.append(_Line(setting.label, budget, full, texts, _means(controls)))
    return _table("First detection: median, m", lines, tags)


def _means(controls: Mapping[str, Sequence[Row]]) -> dict[str, float | None]:
    """Mean first detections on the seeds that all controls have: a control that lacks a seed with a
    late actor would win by that.
    """
    distances = {
        policy: {row["seed"]: found.value for row in rows if (found := detection(row)) is not None}
        for policy, rows in controls.items()
    }
    seeds = sorted(set.intersection(*map(set, distances.values()))) if distances else []
    return {
        policy: float(np.mean([by[seed] for seed in seeds])) if seeds else None
        for policy, by in distances.items()
    }


def recalls(rows: Sequence[Row]) -> Table:
    """Shares of first sightings that are detected in their first keyframe, in percent."""
    lines = []
    tags: dict[str, tuple[str, ...]] = {}
    for plays in plays_by_setting(rows):
        tags |= plays.tags
        full = written(FIRST_SIGHTING, plays.level(FIRST_SIGHTING, FULL, 1.0).by_event)
        controls = [policy for policy in plays.policies if is_control(plays.tags[policy])]
        for budget in plays.budgets:
            line = _Line(plays.setting.label, budget, full)
            for policy in plays.policies:
                level = plays.level(FIRST_SIGHTING, policy, budget).by_event
                line.texts[policy] = written(FIRST_SIGHTING, level)
            # A control that lacks a hard scene would win by that.
            tallies = {policy: plays.tallies(policy, budget) for policy in controls}
            played = {policy: own for policy, own in tallies.items() if own}
            shared = set.intersection(*map(set, played.values())) if played else set()
            for policy, own in played.items():
                line.controls[policy] = ratio_level(FIRST_SIGHTING, among(own, shared)).by_event
            lines.append(line)
    return _table("First sightings detected in their first keyframe, %", lines, tags)


def _table(title: str, lines: Sequence[_Line], tags: Mapping[str, tuple[str, ...]]) -> Table:
    played = [policy for policy in tags if policy != FULL and not is_control(tags[policy])]
    main = [policy for policy in _MAIN if policy in played]
    # A variant of CARE in the paper, which lies on CARE in all its scenes.
    others = [policy for policy in played if policy not in (*_MAIN, "care-sbf")][:_OTHERS]
    shown = [*main, *others] or played
    control = (BEST_CONTROL,) if any(line.controls for line in lines) else ()
    rows: list[TableRow] = []
    for line in lines:
        best = best_control(line.controls)
        named = (f"{line.texts[best]} {best}" if best else "",) if control else ()
        levels = (line.texts.get(policy, "") for policy in shown)
        rows.append((line.setting, percent(line.budget), *levels, *named, line.full))
    columns = ("scenario", "budget", *shown, *control, FULL)
    return Table(title, columns, tuple(rows), whole=columns[1:], names=2)
