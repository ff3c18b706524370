"""Curves of the studies of the closed loop."""

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import product

from matplotlib.figure import Figure

from care_sim.base.errors import counted, percent
from care_sim.evaluation.censoring import Reading, quartiles
from care_sim.reports.engine.controls import BEST_CONTROL, named_by_budget
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.parts import Part
from care_sim.reports.figures.curves import BUDGET, Panel, Point, curves_figure
from care_sim.reports.tables.faults import policies_of
from care_sim.reports.tables.validate import WorldPlays, played_worlds
from care_sim.reports.tables.vehicle import VehicleRows, mean_over_forecasts, total
from care_sim.sensors.setups import DEFAULT_SETUP
from care_sim.study.designs.faults import FAULT_PLACES, FAULTS, faults_alone
from care_sim.study.designs.firing import AWARE, rows_by_firing, rows_by_order
from care_sim.study.designs.validate import CAMERA_POLICIES, MEMORISER
from care_sim.study.designs.variants import USUAL_VARIANT, Place, Variant
from care_sim.study.designs.vehicle import (
    EVIDENCE_GROUPS,
    EVIDENCE_LEVELS,
    POSE_GROUPS,
    POSE_LEVELS,
    is_late,
)
from care_sim.study.rows.reading import Setting, detections, setting_of
from care_sim.study.run_config import FULL, REFERENCE, Row

_Read = Callable[[Sequence[Row]], Point | None]


def first_detection(rows: Sequence[Row]) -> Point | None:
    """The median in metres with its quartiles; None of rows without an actor."""
    return _median(detections(rows))


def _median(readings: Sequence[Reading]) -> Point | None:
    found = quartiles(readings)
    if found is None:
        return None
    if found.median is None or found.high is None:
        return Point(math.nan)
    # Where the lower quartile is not detected, the bar reaches the bottom.
    return Point(found.median, (found.low or 0.0, found.high))


def _clearance(rows: Sequence[Row]) -> Point | None:
    """The median in metres; nan where the actor never came into view."""
    found = [Reading(row["clearance_m"]) for row in rows if row["clearance_m"] is not None]
    return _median(found) or (Point(math.nan) if rows else None)


def _percent(column: str) -> _Read:
    """Return the share of episodes with a flag, in per cent."""
    return lambda rows: Point(100.0 * total(rows, column) / len(rows)) if rows else None


def _seeds(rows: Sequence[Row]) -> str:
    return counted(len({row["seed"] for row in rows}), "seed")


def sweep_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """A figure for every scenario that was run without further conditions at several budgets."""
    frame = Frame(rows)
    figures: dict[str, Figure] = {}
    for setting in dict.fromkeys(setting for setting, _, _ in frame.groups):
        part = Part(frame, setting)
        # One budget makes no curve.
        if not setting.conditions and len(part.budgets) > 1:
            figures |= _sweep_figure(part)
    return figures


def _sweep_figure(part: Part) -> dict[str, Figure]:
    panel = Panel.by_budget(
        "",
        [*part.policies, FULL],
        part.budgets,
        lambda policy, budget: first_detection(part.rows(policy, budget)),
        label="first detection (m, median)",
    )
    counts = [len(own) for key, own in part.frame.groups.items() if key[0] == part.setting]
    least = f"{min(counts)} to " if min(counts) < max(counts) else ""
    title = f"{part.setting.world}: {least}{counted(max(counts), 'seed')} a point"
    name = f"{part.setting.slug}-budget"
    return curves_figure(name, title, [panel], part.tags, [BUDGET], bars="quartiles")


def firing_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Draw first detections of the policy that knows its hardware, with a panel per sensor set-up
    and a curve per firing unit. No figure without several budgets.
    """
    budgets = sorted({row["budget"] for row in rows if row["policy"] == AWARE})
    if len(budgets) < 2:
        return {}
    frames = {firing: Frame(own) for firing, own in rows_by_firing(rows).items()}
    first = next(iter(frames.values()))

    def panel(setting: Setting) -> Panel:
        def read(firing: str, budget: float) -> Point | None:
            if firing == FULL:
                return first_detection(first.of((setting, FULL, 1.0)))
            return first_detection(frames[firing].of((setting, AWARE, budget)))

        sensor = dict(setting.conditions).get("sensor", DEFAULT_SETUP)
        return Panel.by_budget(sensor, [*frames, FULL], budgets, read)

    settings = [*dict.fromkeys(setting_of(row) for each in frames.values() for row in each.rows)]
    title = f"{settings[0].world}: {AWARE}, first detection (m, median of {_seeds(rows)})"
    notes = ["budget (share of the units that fire)"]
    return curves_figure("firing", title, map(panel, settings), {}, notes, share=True)


_FAULT_MEASURES: Mapping[str, tuple[str, _Read]] = {
    "detection": ("first detection, median, m", first_detection),
    "braked": ("episodes with braking, %", _percent("braked")),
    "clearance": ("clearance, median, m", _clearance),
}


def fault_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """A figure for every place and measure, with a panel for every fault."""
    frame = Frame(faults_alone(rows))
    figures: dict[str, Figure] = {}
    for place, name in product(FAULT_PLACES, _FAULT_MEASURES):
        figures |= _fault_figure(frame, place, name)
    return figures


def _fault_figure(frame: Frame, place: Place, name: str) -> dict[str, Figure]:
    label, read = _FAULT_MEASURES[name]

    def height(policy: str, level: Variant) -> Point | None:
        return read(frame.of(level.key(place, policy)))

    panels = [
        Panel.of(
            fault.title,
            policies_of(frame),
            {level.label: level for level in fault.levels},
            height,
            unit=fault.unit,
        )
        for fault in FAULTS
    ]
    title = f"{place}, {_seeds(frame.rows)}: {label}"
    return curves_figure(f"faults-{place.scenario}-{name}", title, panels, frame.tags, share=True)


_ORDER_PLACES = (
    Place("dartout", 0.03),
    Place("dartout", 0.10),
    Place("dense", 0.03),
    Place("dense", 0.05),
)
"""The dart-out at the study's tightest budget and at the paper's reported one. The dense street at
the tightest, and at the one from which the paper's reserves converge.
"""


def order_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """First detection by order of the cells inside a set, one panel per place that was played."""
    frames = {order: Frame(own) for order, own in rows_by_order(rows).items()}
    tags = {p: frame.tags[p] for frame in frames.values() for _, p, _ in frame.groups}

    def panel(place: Place) -> Panel:
        def read(policy: str, frame: Frame) -> Point | None:
            return first_detection(frame.of(USUAL_VARIANT.key(place, policy)))

        return Panel.of(f"{place}", tags, frames, read)

    title = f"order of the cells inside a set: first detection (m, median of {_seeds(rows)})"
    return curves_figure("order", title, map(panel, _ORDER_PLACES), tags, columns=2, share=True)


def validation_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Return figures of first detections and collisions in the world as it is and with each factor
    changed. They have one column of panels per budget. A single world at several budgets has curves
    over the budget.
    """
    worlds = played_worlds(rows)
    budgets = sorted({budget for world in worlds for budget in world.budgets})
    played = {policy: own for world in worlds for policy, own in world.tags.items()}
    shown = ("random", "history", *CAMERA_POLICIES, MEMORISER)
    tags = {policy: played[policy] for policy in shown if policy in played}
    tags |= {BEST_CONTROL: ("control",)}
    names = dict(zip(_names(worlds), worlds, strict=True))
    first = worlds[0]
    # A single world has one tick, so its curves are over the budget.
    is_single = len(worlds) == 1 and len(budgets) > 1
    columns: list[tuple[str, dict[str, tuple[WorldPlays, float]], Sequence[float]]]
    if is_single:
        columns = [("", {percent(budget): (first, budget) for budget in budgets}, budgets)]
    else:
        columns = [
            (f": budget {percent(budget)}", {name: (names[name], budget) for name in names}, ())
            for budget in budgets
        ]

    def panels_of(label: str, read: _Read, less: bool) -> list[Panel]:
        def height(role: str, tick: tuple[WorldPlays, float]) -> Point | None:
            world, budget = tick
            return read(world.played(role, budget))

        return [
            Panel.of(label + told, [*tags, FULL], ticks, height, places=places, less_is_better=less)
            for told, ticks, places in columns
        ]

    panels = [
        *panels_of("first detection, median, m", first_detection, False),
        *panels_of("episodes with a collision, %", _percent("collision"), True),
    ]
    known = {budget: name for budget in first.budgets if (name := first.best_control(budget))}
    notes = [f"{BEST_CONTROL} of {first.setting.world}: {named_by_budget(known)}"] if known else []
    seeds = len({row["seed"] for world in worlds for row in world.test_rows})
    changed = ", then with one factor changed" if len(worlds) > 1 else ""
    title = f"{first.setting.label}{changed}: {seeds} test seeds"
    if is_single:
        return curves_figure("validation", title, panels, tags, [BUDGET, *notes])
    width = len(budgets)
    return curves_figure("validation", title, panels, tags, notes, columns=width, share="row")


def _names(worlds: Sequence[WorldPlays]) -> list[str]:
    """The world as it is by its name, the others by what is changed."""
    base, *changed = (world.setting for world in worlds)
    told = (
        [
            f"{name.replace('_', ' ')} {value}"
            for name, value in each.conditions
            if (name, value) not in base.conditions
        ]
        for each in changed
    )
    return [base.world, *map("\n".join, told)]


def vehicle_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Late boxes in turns, and errors of the pose."""
    study = VehicleRows(rows)
    held = {
        f"{group.name}: {how}": (group, column)
        for group in EVIDENCE_GROUPS
        for column, how in (("turned_held", "compensated"), ("unturned_held", "without"))
    }
    off = {group.name: group for group in POSE_GROUPS}

    def share(name: str, level: Variant) -> Point | None:
        group, column = held[name]
        own = study.of(group, level, REFERENCE)
        boxes = total(own, "turned_boxes")
        return Point(100.0 * total(own, column) / boxes) if boxes else None

    def error(name: str, level: Variant) -> Point | None:
        own = study.of(off[name], level, REFERENCE)
        return Point(mean_over_forecasts(own, "forecast_error_m")) if own else None

    late = {level.label: level for level in EVIDENCE_LEVELS if is_late(level)}
    levels = {level.label: level for level in POSE_LEVELS}
    title = "late boxes in turns whose wedge holds their object (%)"
    panels = [
        Panel.of(title, held, late, share),
        Panel.of("mean error of the forecasts (m)", off, levels, error),
    ]
    return curves_figure("vehicle", "", panels, {})
