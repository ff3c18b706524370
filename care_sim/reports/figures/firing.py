"""The figure of the study of hardware: first detection against the budget, a panel per sensor
set-up and a curve per unit that fires as a whole.
"""

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.base.errors import counted, percent
from care_sim.core.firing.listing import HARDWARE
from care_sim.reports.cells import StudyCells
from care_sim.reports.figures.styles import (
    CLOSED_LOOP_DODGE,
    FULL_STYLE,
    Style,
    bare_axes,
    name_outside,
)
from care_sim.sensors.setups import DEFAULT_SETUP
from care_sim.study.designs.firing import AWARE, rows_by_firing
from care_sim.study.rows.reading import setting_of
from care_sim.study.rows.settings import Setting
from care_sim.study.run_config import FULL, Row

FIRING_FIGURE = "firing"
_COLOURS = ("#000000", "#0072B2", "#56B4E9", "#D55E00", "#009E73", "#E69F00", "#CC79A7", "#777777")
"""From the palette of Okabe and Ito (2008), safe for the colour-blind, and a grey for its yellow,
which is faint on white."""
_MARKERS = ("o", "s", "D", "^", "v", ">", "<", "P")
_STYLES = {
    kind: Style(colour, marker)
    for kind, colour, marker in zip(HARDWARE, _COLOURS, _MARKERS, strict=True)
}
_PANELS_A_ROW = 3
_NOT_DETECTED = 0.0
"""Where a median stands that is not detected, in metres."""


def firing_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Median first detection in metres of the policy that knows its hardware; none where it was not
    played at several budgets.
    """
    budgets = sorted({row["budget"] for row in rows if row["policy"] == AWARE})
    if len(budgets) < 2:
        return {}
    studies = {firing: StudyCells(own) for firing, own in rows_by_firing(rows).items()}
    played = [row for study in studies.values() for row in study.rows]
    settings = [*dict.fromkeys(map(setting_of, played))]
    across = min(len(settings), _PANELS_A_ROW)
    down = -(-len(settings) // across)
    figure = Figure(figsize=(2.3 + 2.5 * across, 0.8 + 2.4 * down), layout="constrained")
    panels = figure.subplots(down, across, squeeze=False, sharey=True).ravel().tolist()
    for axes, setting in zip(panels, settings, strict=False):
        _draw(axes, setting, studies, budgets)
    for empty in panels[len(settings) :]:
        empty.set_visible(False)

    # All panels share their heights, and the curves of all decide them.
    panels[0].set_ylim(bottom=0)
    seeds = counted(len({row["seed"] for row in rows}), "seed")
    head = f"{settings[0].world}: {AWARE}, median of {seeds} (at 0: not detected)"
    figure.suptitle(head, x=0.01, ha="left", fontsize=10)
    figure.supxlabel("budget (share of the units that fire)", fontsize=9)
    figure.supylabel("first detection (m)", fontsize=9)
    name_outside(figure, panels)
    return {FIRING_FIGURE: figure}


def _draw(
    axes: Axes, setting: Setting, studies: Mapping[str, StudyCells], budgets: Sequence[float]
) -> None:
    for number, (firing, study) in enumerate(studies.items()):
        style = _STYLES[firing.partition(":")[0]]
        shift = CLOSED_LOOP_DODGE.factor(number, len(studies))
        known = {
            budget * shift: cell.detection.median
            for budget in budgets
            if (cell := study.cell((setting, AWARE, budget)))
        }
        heights = [_NOT_DETECTED if one is None else one for one in known.values()]
        # A unit that does not divide this grid has no curve, and a curve without points no room.
        if known:
            (line,) = axes.plot([*known], heights, color=style.colour, linewidth=1.2, label=firing)
            line.set(marker=style.marker, markersize=4, clip_on=False)
    full = next(iter(studies.values())).cell((setting.for_full(), FULL, 1.0))
    if full and full.detection.median is not None:
        line = axes.axhline(full.detection.median, label="full scan", linewidth=1.2, zorder=1)
        line.set(color=FULL_STYLE.colour, linestyle=FULL_STYLE.line)
    axes.set_xscale("log")
    axes.set_xticks(budgets, [percent(budget) for budget in budgets])
    axes.minorticks_off()
    sensor = dict(setting.conditions).get("sensor", DEFAULT_SETUP)
    axes.set_title(sensor, loc="left", fontsize=10)
    axes.tick_params(labelsize=8)
    bare_axes(axes, "0.93")
