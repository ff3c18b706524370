"""What became of the preventable cut-ins of UN Regulation 157, by policy and budget."""

from collections.abc import Callable, Sequence

import numpy as np

from care_sim.base.errors import percent
from care_sim.core.driver_settings import FIXED
from care_sim.evaluation.collision_outcomes import CollisionOutcome
from care_sim.reports.collisions import CollisionRows
from care_sim.reports.engine.controls import BEST_CONTROL
from care_sim.reports.formatting import interval, marked, tag_notes
from care_sim.reports.table import Table, TableRow
from care_sim.scenarios.r157.grid import KPH
from care_sim.study.designs.r157 import case_of
from care_sim.study.rows.reading import is_avoided
from care_sim.study.run_config import REFERENCE, Row


def cut_in_rows(rows: Sequence[Row]) -> CollisionRows:
    """The rows of the study; the car of each came at the ego's speed of its case."""
    return CollisionRows(rows, lambda row: case_of(row).ego_kph * KPH)


def r157_tables(rows: Sequence[Row]) -> list[Table]:
    """Outcomes with their paired differences, then the share avoided by the ego's speed."""
    study = cut_in_rows(rows)
    drivers = ", ".join(dict.fromkeys(row.get("driver") or FIXED for row in rows))
    best = {budget: study.best_control(budget) for budget in study.budgets}
    named = {budget: f", {BEST_CONTROL} {name}" if name else "" for budget, name in best.items()}
    speeds = sorted({case_of(row).ego_kph for row in rows})

    def outcomes(policy: str, budget: float) -> TableRow:
        others = (each if each != policy else None for each in (REFERENCE, best[budget]))
        found = (study.difference(policy, each, budget) if each else None for each in others)
        return (*_outcomes(study, study.of(policy, budget)), *map(interval, found))

    def by_speed(policy: str, budget: float) -> TableRow:
        own = study.of(policy, budget)
        return tuple(_avoided([r for r in own if case_of(r).ego_kph == v]) for v in speeds)

    marks = tag_notes(study.tags.values())
    return [
        Table(
            f"Preventable cut-ins, driver {drivers}: what became of them",
            ("policy", "cases", CollisionOutcome.AVOIDED, CollisionOutcome.MITIGATED,
             CollisionOutcome.HIT, "median impact, km/h", f"avoided minus {REFERENCE}, points",
             f"minus the {BEST_CONTROL}"),
            _by_budget(study, outcomes, named),
            marks,
        ),
        Table(
            f"Preventable cut-ins, driver {drivers}: avoided, by the ego's speed",
            ("policy", *(f"{speed:g} km/h" for speed in speeds)),
            _by_budget(study, by_speed, {}),
            marks,
        ),
    ]  # fmt: skip


def _by_budget(
    study: CollisionRows,
    entries: Callable[[str, float], TableRow],
    named: dict[float, str],
) -> tuple[TableRow, ...]:
    """A line per policy that was played, below the budget and what is named beside it."""
    lines: list[TableRow] = []
    for budget in study.budgets:
        lines.append((f"budget {percent(budget)}{named.get(budget, '')}",))
        lines += [
            (marked(policy, study.tags[policy]), *entries(policy, budget))
            for policy in study.policies
            if study.of(policy, budget)
        ]
    return tuple(lines)


def _outcomes(study: CollisionRows, rows: Sequence[Row]) -> TableRow:
    counts = study.outcomes(rows)
    impacts = [row["impact_speed_mps"] for row in rows if row["collision"]]
    return (
        str(len(rows)),
        f"{100 * counts[CollisionOutcome.AVOIDED] / len(rows):.1f}%",
        str(counts[CollisionOutcome.MITIGATED]),
        str(counts[CollisionOutcome.HIT]),
        f"{float(np.median(impacts)) / KPH:.0f}" if impacts else "",
    )


def _avoided(rows: Sequence[Row]) -> str:
    return f"{sum(map(is_avoided, rows))}/{len(rows)}" if rows else ""
