"""Figures of the ablations: by how much every level of what is varied differs from the usual."""

from collections.abc import Callable, Sequence
from itertools import chain
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.base.errors import counted, percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL
from care_sim.reports.cells import StudyCells
from care_sim.reports.figures.styles import BLUE, CALM
from care_sim.reports.formatting import ShownDifference
from care_sim.reports.protocol.ablations import AblationPlays
from care_sim.reports.protocol.paper_ablations import NEAR_FIELD
from care_sim.study.designs.ablations import (
    ABLATION_PLACES,
    ABLATIONS,
    OPEN_ABLATIONS,
    Ablation,
)
from care_sim.study.designs.variants import USUAL_VARIANT, FilmPlace, Place, Variant
from care_sim.study.rows.reading import Key
from care_sim.study.run_config import FULL, Row

ABLATION_FIGURE = "ablations"
OPEN_ABLATION_FIGURE = "ablations-open-loop"
_LINE_INCHES = 0.19
_PANEL_INCHES = 1.9
_NAMES_INCHES = 3.2
"""Room for what is varied, on the left."""
_MARKS = "blue: told from zero, as in the tables; open: a bound, for some are never detected"
_DIFFERENT, _ALIKE = BLUE, CALM
"""Colours of a difference that is told from zero, and of any other."""


class _Line(NamedTuple):
    """A level and its difference in every panel, None where it was not played; or the name of what
    is varied, above its levels.
    """

    label: str
    differences: Sequence[ShownDifference | None] = ()


def ablation_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Paired differences of the first detection in metres, one panel per scenario and budget."""
    study = StudyCells(rows)

    def differences(ablation: Ablation, level: Variant) -> list[ShownDifference | None]:
        return [study.difference(*_keys(ablation, level, place)) for place in ABLATION_PLACES]

    lines = _lines(ABLATIONS, ABLATION_PLACES[0], differences)
    if not lines:
        return {}
    seeds = counted(len({row["seed"] for row in rows}), "seed")
    unit = f"first detection minus that of the usual level (m), {seeds}"
    return {ABLATION_FIGURE: _figure(lines, [str(place) for place in ABLATION_PLACES], unit)}


def open_ablation_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Paired differences of recalls in points, one panel per budget and measure."""
    study = AblationPlays(rows)
    measures = {
        "first sightings": (FIRST_SIGHTING, ""),
        "all below 20 m": (OVERALL, NEAR_FIELD),
    }
    panels = [
        (FilmPlace(study.source, budget), name, *measure)
        for budget in study.budgets
        for name, measure in measures.items()
    ]

    def differences(ablation: Ablation, level: Variant) -> list[ShownDifference | None]:
        return [
            study.cells.difference(ratio, *_keys(ablation, level, place), within)
            for place, _, ratio, within in panels
        ]

    if not panels:
        return {}
    lines = _lines(OPEN_ABLATIONS, panels[0][0], differences)
    scenes = counted(len({row["scene"] for row in rows if row["policy"] != FULL}), "scene")
    unit = f"recall minus that of the usual level (points; scales differ), {scenes}"
    titles = [f"{name}, {percent(place.budget)}" for place, name, *_ in panels]
    if not lines:
        return {}
    # At the scarce budget a level costs ten times as much as at the paper's.
    return {OPEN_ABLATION_FIGURE: _figure(lines, titles, unit, one_scale=False)}


def _keys(ablation: Ablation, level: Variant, place: Place | FilmPlace) -> tuple[Key, Key]:
    """The cells of a level and of the usual one."""
    return level.key(place, ablation.policy), USUAL_VARIANT.key(place, ablation.policy)


def _lines(
    ablations: Sequence[Ablation],
    place: Place | FilmPlace,
    differences: Callable[[Ablation, Variant], Sequence[ShownDifference | None]],
) -> list[_Line]:
    """Every ablation that was played, and below it its levels but the usual one, which `place`
    tells.
    """
    lines = []
    for ablation in ablations:
        departing = [
            level for level in ablation.levels if len({*_keys(ablation, level, place)}) == 2
        ]
        levels = [_Line(level.label, differences(ablation, level)) for level in departing]
        if any(filter(None, chain.from_iterable(line.differences for line in levels))):
            lines += [_Line(f"{ablation.policy}: {ablation.title}"), *levels]
    return lines


def _figure(
    lines: Sequence[_Line], titles: Sequence[str], unit: str, one_scale: bool = True
) -> Figure:
    size = _NAMES_INCHES + _PANEL_INCHES * len(titles), 1.0 + _LINE_INCHES * len(lines)
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(1, len(titles), squeeze=False, sharex=one_scale, sharey=True)[0]
    for number, (axes, title) in enumerate(zip(panels, titles, strict=True)):
        _draw(axes, lines, number)
        axes.set_title(title, loc="left", fontsize=9)
    panels[0].set_ylim(len(lines) - 0.4, -0.6)
    panels[0].set_yticks(range(len(lines)), [line.label for line in lines], fontsize=7)
    for label, line in zip(panels[0].get_yticklabels(), lines, strict=True):
        if not line.differences:
            label.set_fontweight("bold")
    figure.supxlabel(f"{unit}\n{_MARKS}", fontsize=9)
    return figure


def _draw(axes: Axes, lines: Sequence[_Line], panel: int) -> None:
    """The differences of a panel with their intervals, and zero as a line."""
    axes.axvline(0.0, color=CALM, linewidth=0.8)
    for height, line in enumerate(lines):
        difference = line.differences[panel] if line.differences else None
        if difference is None:
            continue
        colour = _DIFFERENT if difference.excludes_zero else _ALIKE
        if (ends := difference.interval) is not None:
            axes.plot([ends.low, ends.high], [height, height], color=colour, linewidth=1.5)
        # A difference to an actor that was never detected is a bound.
        inside = "none" if difference.bound else colour
        axes.plot(
            [difference.mean], [height], "o", color=colour, markerfacecolor=inside, markersize=4
        )
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="x")
