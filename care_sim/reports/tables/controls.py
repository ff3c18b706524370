"""What every policy of a sweep has over the best control at the same budget, in metres of first
detection.
"""

from collections.abc import Sequence

import numpy as np

from care_sim.base.errors import percent
from care_sim.reports.cells import Cell
from care_sim.reports.contrasts import DETECTION, contrast
from care_sim.reports.controls import (
    BEST_CONTROL,
    IN_HINDSIGHT,
    best_control,
    candidates,
    is_control,
)
from care_sim.reports.formatting import interval, marked, tag_notes
from care_sim.reports.table import Table
from care_sim.study.rows.reading import Groups, detection, full_of
from care_sim.study.rows.settings import Setting
from care_sim.study.run_config import FULL

_RULE = (
    f"The {BEST_CONTROL} is that with the farthest first detection at the budget, as a mean over "
    "the seeds that all controls have there, in which a missed actor counts as in differences. "
    f"{IN_HINDSIGHT}"
)


def control_tables(setting: Setting, cells: Sequence[Cell], groups: Groups) -> list[Table]:
    """First detection of every other policy and of the full scan less that of the best control;
    none without a control or another policy.
    """
    tags = {cell.policy: cell.tags for cell in cells if cell.policy != FULL}
    rivals = [policy for policy in tags if not is_control(tags[policy])]
    controls = [policy for policy in tags if is_control(tags[policy])]
    # The full scan of the same worlds may stand in another setting, of which it feels the same.
    full = full_of(groups, setting)
    if not (controls and (rivals or full)):
        return []
    budgets = sorted({cell.budget for cell in cells if cell.policy in controls})
    best = {budget: _best(setting, controls, budget, groups) for budget in budgets}
    lines: list[tuple[str, ...]] = [(BEST_CONTROL, *(each or "" for each in best.values()))]
    for policy in (*rivals, *((FULL,) if full else ())):
        found = (
            contrast(
                DETECTION,
                full if policy == FULL else groups.get((setting, policy, budget)),
                groups[setting, control, budget] if control else None,
            )
            for budget, control in best.items()
        )
        lines.append((marked(policy, tags.get(policy, ())), *map(interval, found)))
    return [
        Table(
            f"{setting.label}: each policy minus the {BEST_CONTROL}, first detection in m",
            (f"minus the {BEST_CONTROL}", *map(percent, budgets)),
            tuple(lines),
            (_RULE, candidates(controls), *tag_notes(tags.values())),
        )
    ]


def _best(setting: Setting, controls: Sequence[str], budget: float, groups: Groups) -> str | None:
    """The best control at a budget at which one was played; None where they share no seed."""
    distances = {
        control: {
            row["seed"]: found.value
            for row in groups[setting, control, budget]
            if (found := detection(row)) is not None
        }
        for control in controls
        if (setting, control, budget) in groups
    }
    # A control that lacks a seed with a late actor would win by that.
    seeds = sorted(set.intersection(*map(set, distances.values())))
    if not seeds:
        return None
    return best_control(
        {control: float(np.mean([by[s] for s in seeds])) for control, by in distances.items()}
    )
