"""The figure of a validation: what every policy reaches in the world as it is and with each factor
changed.
"""

import math
from collections.abc import Sequence

from matplotlib.figure import Figure

from care_sim.base.errors import percent
from care_sim.evaluation.censoring import quartiles
from care_sim.reports.engine.controls import BEST_CONTROL, named_by_budget
from care_sim.reports.figures.curves import FULL_SCAN, Panel, curves_figure
from care_sim.reports.tables.validate import WorldPlays, played_worlds
from care_sim.study.designs.validate import CAMERA_POLICIES, MEMORISER
from care_sim.study.rows.reading import detections
from care_sim.study.run_config import FULL, Row

VALIDATION_FIGURE = "validation"
_SHOWN = ("random", "history", *CAMERA_POLICIES, MEMORISER)


def validation_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """First detections and collisions world by world, one column of panels a budget."""
    worlds = played_worlds(rows)
    budgets = sorted({budget for world in worlds for budget in world.budgets})
    if not budgets:
        return {}
    tags = {policy: own for world in worlds for policy, own in world.tags.items()}
    tags = {policy: tags[policy] for policy in _SHOWN if policy in tags}
    ticks = _names(worlds)
    panels = []
    for label, read, less in (
        ("first detection, median, m", _median, False),
        ("episodes with a collision, %", _hit, True),
    ):
        for budget in budgets:
            played = {policy: [world.played(policy, budget) for world in worlds] for policy in tags}
            played |= {
                BEST_CONTROL: [
                    world.played(world.best_control(budget) or "", budget) for world in worlds
                ],
                FULL_SCAN: [world.played(FULL, budget) for world in worlds],
            }
            heights = {name: [*map(read, own)] for name, own in played.items()}
            title = f"{label}: budget {percent(budget)}"
            panels.append(Panel(title, ticks, heights, less_is_better=less))
    first = worlds[0]
    chosen = {budget: first.best_control(budget) for budget in first.budgets}
    known = {budget: control for budget, control in chosen.items() if control}
    note = f"{BEST_CONTROL} of {first.setting.world}: {named_by_budget(known)}" if known else ""
    seeds = len({row["seed"] for world in worlds for row in world.test_rows})
    changed = ", then with one factor changed" if len(worlds) > 1 else ""
    title = f"{first.setting.label}{changed}: {seeds} test seeds"
    tags |= {BEST_CONTROL: ("control",)}
    figure = curves_figure(title, panels, tags, [note], columns=len(budgets), share="row")
    return {VALIDATION_FIGURE: figure}


def _median(rows: Sequence[Row]) -> float | None:
    found = quartiles(detections(rows))
    if found is None:
        return None
    return math.nan if found.median is None else found.median


def _hit(rows: Sequence[Row]) -> float | None:
    return 100.0 * sum(row["collision"] for row in rows) / len(rows) if rows else None


def _names(worlds: Sequence[WorldPlays]) -> list[str]:
    """The world as it is by its name, the others by what is changed."""
    base = worlds[0].setting
    changed = (
        [pair for pair in world.setting.conditions if pair not in base.conditions]
        for world in worlds[1:]
    )
    return [
        base.world,
        *(
            "\n".join(f"{name.replace('_', ' ')} {value}" for name, value in each)
            for each in changed
        ),
    ]
