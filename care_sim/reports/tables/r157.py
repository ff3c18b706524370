"""Outcomes of the preventable cut-ins of UN Regulation 157, by policy and budget."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from care_sim.base.errors import percent
from care_sim.core.conditions import FIXED
from care_sim.evaluation.outcomes import CollisionOutcome, collision_outcome
from care_sim.reports.engine.contrasts import contrast_of_rows
from care_sim.reports.engine.controls import BEST_CONTROL, best_of
from care_sim.reports.engine.measures import AVOIDANCE
from care_sim.reports.engine.parts import PolicyRows
from care_sim.reports.engine.tables import under_headings
from care_sim.reports.formatting import interval, tag_notes
from care_sim.reports.table import Table, TableRow
from care_sim.scenarios.r157 import KPH
from care_sim.study.designs.standards import case_of
from care_sim.study.rows.reading import is_avoided, stops_for_nothing
from care_sim.study.run_config import REFERENCE, Row


def cut_in_rows(rows: Sequence[Row]) -> PolicyRows:
    """The rows of the study. Their `seed` names seed and case: policies are paired by world."""

    def world(row: Row) -> str:
        case = sorted((name, row[name]) for name in row if name.startswith("scenario."))
        return repr((("seed", row["seed"]), *case))

    return PolicyRows([row | {"seed": world(row)} for row in rows])


def r157_tables(rows: Sequence[Row]) -> list[Table]:
    """Outcomes with their paired differences, then the share avoided by the ego's speed."""
    study = cut_in_rows(rows)
    drivers = ", ".join(dict.fromkeys(row.get("driver") or FIXED for row in rows))
    # On the worlds that all controls have at the budget.
    best = {
        budget: best_of(
            AVOIDANCE, {name: AVOIDANCE.units(study.of(name, budget)) for name in study.controls}
        )
        for budget in study.budgets
    }
    named = {budget: f", {BEST_CONTROL} {name}" if name else "" for budget, name in best.items()}
    speeds = sorted({case_of(row).ego_kph for row in rows})

    def outcomes(policy: str, budget: float) -> TableRow:
        own = study.of(policy, budget)
        others = (each if each != policy else None for each in (REFERENCE, best[budget]))
        found = (
            contrast_of_rows(AVOIDANCE, own, study.of(each, budget)) if each else None
            for each in others
        )
        return (*_outcomes(own), *map(interval, found))

    def by_speed(policy: str, budget: float) -> TableRow:
        own = [(case_of(row).ego_kph, is_avoided(row)) for row in study.of(policy, budget)]
        avoided = ([each for kph, each in own if kph == speed] for speed in speeds)
        return tuple(f"{sum(each)}/{len(each)}" if each else "" for each in avoided)

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
    study: PolicyRows, entries: Callable[[str, float], TableRow], named: Mapping[float, str]
) -> tuple[TableRow, ...]:
    """A line per policy that was played, below the budget and what is named beside it."""
    return under_headings(
        {
            f"budget {percent(budget)}{named.get(budget, '')}": [
                (study.marked(policy), *entries(policy, budget))
                for policy in study.policies
                if study.of(policy, budget)
            ]
            for budget in study.budgets
        }
    )


def _outcomes(rows: Sequence[Row]) -> TableRow:
    """How many cases ended how, and the median speed of the impacts."""
    # The car of a case comes at the ego's speed. A stop for nothing counts as a hit.
    counts = Counter(
        CollisionOutcome.HIT
        if stops_for_nothing(row)
        else collision_outcome(row["impact_speed_mps"], case_of(row).ego_kph * KPH)
        for row in rows
    )
    impacts = [row["impact_speed_mps"] for row in rows if row["collision"]]
    return (
        str(len(rows)),
        f"{100 * counts[CollisionOutcome.AVOIDED] / len(rows):.1f}%",
        str(counts[CollisionOutcome.MITIGATED]),
        str(counts[CollisionOutcome.HIT]),
        f"{float(np.median(impacts)) / KPH:.0f}" if impacts else "",
    )
