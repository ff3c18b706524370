"""What became of the preventable cut-ins of UN Regulation 157, by policy and budget."""

from collections.abc import Sequence

import numpy as np

from care_sim.base.errors import percent
from care_sim.core.driver_settings import FIXED
from care_sim.evaluation.collision_outcomes import CollisionOutcome
from care_sim.reports.collisions import CollisionRows
from care_sim.reports.controls import BEST_CONTROL, IN_HINDSIGHT
from care_sim.reports.formatting import interval, marked, tag_notes
from care_sim.reports.table import Table, TableRow
from care_sim.scenarios.r157.grid import KPH
from care_sim.study.designs.r157 import case_of
from care_sim.study.rows.reading import is_avoided
from care_sim.study.run_config import REFERENCE, Row

_BEST = (
    f"The {BEST_CONTROL} avoids most at the budget, over the cases that all controls have there. "
    f"{IN_HINDSIGHT}"
)


def cut_in_rows(rows: Sequence[Row]) -> CollisionRows:
    """The rows of the study; the car of each came at the ego's speed of its case."""
    return CollisionRows(rows, lambda row: case_of(row).ego_kph * KPH)


def r157_tables(rows: Sequence[Row]) -> list[Table]:
    """Outcomes with their paired differences, then the share avoided by the ego's speed."""
    study = cut_in_rows(rows)
    drivers = ", ".join(dict.fromkeys(row.get("driver") or FIXED for row in rows))
    return [_outcome_table(study, drivers), _speed_table(study, drivers)]


def _outcome_table(study: CollisionRows, drivers: str) -> Table:
    best = {budget: study.best_control(budget) for budget in study.budgets}
    lines: list[TableRow] = []
    for budget in study.budgets:
        lines.append((_heading(budget, best[budget]),))
        lines += [
            (marked(policy, study.tags[policy]), *_outcomes(study, policy, budget, best[budget]))
            for policy in study.policies
            if study.of(policy, budget)
        ]
    return Table(
        f"Preventable cut-ins, driver {drivers}: what became of them",
        (
            "policy",
            "cases",
            CollisionOutcome.AVOIDED,
            CollisionOutcome.MITIGATED,
            CollisionOutcome.HIT,
            "median impact, km/h",
            f"avoided minus {REFERENCE}, points",
            f"minus the {BEST_CONTROL}",
        ),
        tuple(lines),
        (*((_BEST,) if any(best.values()) else ()), *tag_notes(study.tags.values())),
    )


def _heading(budget: float, best: str | None) -> str:
    return f"budget {percent(budget)}" + (f", {BEST_CONTROL} {best}" if best else "")


def _outcomes(study: CollisionRows, policy: str, budget: float, best: str | None) -> TableRow:
    rows = study.of(policy, budget)
    counts = study.outcomes(rows)
    impacts = [row["impact_speed_mps"] for row in rows if row["collision"]]
    others = [None if other in (None, policy) else other for other in (REFERENCE, best)]
    return (
        str(len(rows)),
        f"{100 * counts[CollisionOutcome.AVOIDED] / len(rows):.1f}%",
        str(counts[CollisionOutcome.MITIGATED]),
        str(counts[CollisionOutcome.HIT]),
        f"{float(np.median(impacts)) / KPH:.0f}" if impacts else "",
        *(interval(study.difference(policy, each, budget)) if each else "" for each in others),
    )


def _speed_table(study: CollisionRows, drivers: str) -> Table:
    every = [row for policy in study.policies for row in study.of(policy, study.budgets[0])]
    speeds = sorted({case_of(row).ego_kph for row in every})
    lines: list[TableRow] = []
    for budget in study.budgets:
        lines.append((f"budget {percent(budget)}",))
        for policy in study.policies:
            rows = study.of(policy, budget)
            if rows:
                shares = [_avoided([r for r in rows if case_of(r).ego_kph == v]) for v in speeds]
                lines.append((marked(policy, study.tags[policy]), *shares))
    return Table(
        f"Preventable cut-ins, driver {drivers}: avoided, by the ego's speed",
        ("policy", *(f"{speed:g} km/h" for speed in speeds)),
        tuple(lines),
        tag_notes(study.tags.values()),
    )


def _avoided(rows: Sequence[Row]) -> str:
    return f"{sum(map(is_avoided, rows))}/{len(rows)}" if rows else ""
