"""The figure of a validation: what every policy reaches in the world as it is and with each factor
changed.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.base.errors import percent
from care_sim.evaluation.censoring import quartiles
from care_sim.reports.controls import BEST_CONTROL, named_by_budget
from care_sim.reports.figures.styles import FULL_STYLE, Style, bare_axes, name_outside, styles
from care_sim.reports.formatting import marked, tag_notes
from care_sim.reports.validation import WorldPlays, played_worlds
from care_sim.study.designs.validate import CAMERA_POLICIES, MEMORISER
from care_sim.study.rows.reading import detections
from care_sim.study.run_config import FULL, Row

VALIDATION_FIGURE = "validation"
_SHOWN = ("random", "history", *CAMERA_POLICIES, MEMORISER)
_CONTROL_STYLE = Style("#994F00", "8")
"""Of no control: the best one differs from budget to budget."""
_BELOW = 0.05
"""Share of the height of a panel that is left below zero, so that what stands there is seen."""
_BAND = 0.7
"""Share of the way from one world to the next that the markers of a world take."""


class _Measure(NamedTuple):
    """What a line of panels shows of the test rows of a policy, nan where there is nothing, and the
    height of its axis, None for that of what is drawn.
    """

    label: str
    read: Callable[[Sequence[Row]], float]
    height: float | None = None


def _median(rows: Sequence[Row]) -> float:
    """A median that is not detected stands at 0."""
    found = quartiles(detections(rows))
    return math.nan if found is None else found.median or 0.0


def _hit(rows: Sequence[Row]) -> float:
    return 100.0 * sum(row["collision"] for row in rows) / len(rows) if rows else math.nan


_MEASURES = (
    _Measure("first detection, median, m", _median),
    _Measure("episodes with a collision, %", _hit, 100.0),
)


def validation_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """First detections and collisions world by world, one column of panels a budget."""
    worlds = played_worlds(rows)
    budgets = sorted({budget for world in worlds for budget in world.budgets})
    if not budgets:
        return {}
    tags = {policy: own for world in worlds for policy, own in world.tags.items()}
    size = (2.6 + len(budgets) * max(2.2, 0.8 * len(worlds)), 5.6)
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(len(_MEASURES), len(budgets), squeeze=False, sharex=True, sharey="row")
    for line, measure in zip(panels, _MEASURES, strict=True):
        for axes, budget in zip(line, budgets, strict=True):
            _draw(axes, worlds, budget, measure, tags)
        line[0].set_ylabel(measure.label)
        # All panels of a line share their heights, and zero is in sight.
        highest = measure.height or line[0].get_ylim()[1]
        line[0].set_ylim(-_BELOW * highest, highest)
    for axes, budget in zip(panels[0], budgets, strict=True):
        axes.set_title(f"budget {percent(budget)}", loc="left", fontsize=10)
    # The title names a world that stands alone.
    names = _names(worlds) if len(worlds) > 1 else []
    for axes in panels[-1]:
        axes.set_xticks(range(len(names)), names, rotation=30, ha="right", fontsize=8)
    marks = tag_notes(tags[policy] for policy in _SHOWN if policy in tags)
    seeds = len({row["seed"] for world in worlds for row in world.test_rows})
    changed = ", then with one factor changed" if len(worlds) > 1 else ""
    title = f"{worlds[0].setting.label}{changed}: {seeds} test seeds"
    figure.suptitle(title, x=0.01, ha="left", fontsize=10)
    notes = ["at 0 m: not detected", *_control_note(worlds[0]), *marks]
    figure.supxlabel("\n".join(notes), fontsize=9)
    name_outside(figure, panels[0])
    return {VALIDATION_FIGURE: figure}


def _control_note(world: WorldPlays) -> list[str]:
    """Which control is the best one of a world, if it has any."""
    chosen = {budget: world.best_control(budget) for budget in world.budgets}
    known = {budget: control for budget, control in chosen.items() if control}
    return [f"{BEST_CONTROL} of {world.setting.world}: {named_by_budget(known)}"] if known else []


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


def _draw(
    axes: Axes,
    worlds: Sequence[WorldPlays],
    budget: float,
    measure: _Measure,
    tags: Mapping[str, tuple[str, ...]],
) -> None:
    """Markers side by side in every world: worlds have no sequence, so that no line joins them."""
    looks = styles((policy, tags[policy]) for policy in _SHOWN if policy in tags)
    controls = [world.best_control(budget) for world in worlds]
    curves: list[tuple[str, Style, Sequence[str | None]]] = [
        (BEST_CONTROL, _CONTROL_STYLE, controls)
    ]
    for policy, look in looks.items():
        curves.append((marked(policy, tags[policy]), look, [policy] * len(worlds)))
    step = _BAND / len(curves)
    for number, (label, look, names) in enumerate(curves):
        shift = step * (number - (len(curves) - 1) / 2)
        heights = [
            measure.read(world.played(name, budget) if name else [])
            for world, name in zip(worlds, names, strict=True)
        ]
        places = [place + shift for place in range(len(worlds))]
        (markers,) = axes.plot(places, heights, look.marker, color=look.colour, markersize=6)
        markers.set(clip_on=False, label=label)
    for place, world in enumerate(worlds):
        height = measure.read(world.played(FULL, budget))
        ends = [place - _BAND / 2, place + _BAND / 2]
        label = "full scan" if place == 0 else "_"
        axes.plot(ends, [height] * 2, FULL_STYLE.line, color=FULL_STYLE.colour, label=label)
    bare_axes(axes, "0.93")
