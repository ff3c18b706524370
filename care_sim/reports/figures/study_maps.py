"""Maps of the studies: differences by crowding and by ablation, verdicts on headline orders, and
avoided collisions in the Euro NCAP tests and in the cut-ins of UN Regulation 157.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, product
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from care_sim.base.errors import counted, percent
from care_sim.core.arrays import Floats
from care_sim.evaluation.outcomes import BEST_SCORE
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL
from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.engine.measures import DETECTION, GATE_M, Measure, Recall
from care_sim.reports.figures.styles import INK
from care_sim.reports.formatting import marked, mean, signed
from care_sim.reports.protocol.paper import NEAR_FIELD
from care_sim.reports.table import Bold
from care_sim.reports.tables.ablations import AblationStudy
from care_sim.reports.tables.crowding import COLLAPSE_M, Crowd
from care_sim.reports.tables.ncap import NcapRows
from care_sim.reports.tables.r157 import cut_in_rows
from care_sim.reports.tables.realism import Order, RealismStudy, Verdict
from care_sim.study.designs.ablations import ABLATION_PLACES
from care_sim.study.designs.standards import case_of
from care_sim.study.designs.variants import USUAL_VARIANT, FilmPlace, Place
from care_sim.study.rows.reading import is_avoided
from care_sim.study.run_config import FULL, Row

_TEXT_INCHES, _CELL_INCHES = (0.56, 0.24), (0.17, 0.16)
"""Width and height of a cell with a text, and of one without."""
_PANEL_INCHES = 0.5, 0.5
"""Room for the title of a map and between two."""
_LETTER_INCHES, _SLANT = 0.065, 0.9
_INCH_LETTERS = 12
_LUMINANCE, _PALE = (0.299, 0.587, 0.114), 0.5


class Map(NamedTuple):
    """Values (lines, columns), nan where there is nothing, and a text for each or none at all."""

    title: str
    values: Floats
    texts: Sequence[Sequence[str]] = ()


def maps_figure(
    title: str,
    maps: Sequence[Sequence[Map]],
    lines: Sequence[str],
    columns: Sequence[str],
    note: str = "",
    unit: str = "",
    **colours: Any,
) -> Figure:
    """Maps in rows, all of the same lines and columns; `colours` are arguments of Matplotlib's
    `imshow`, and `unit` names their bar, which is left out without it.
    """
    width, height = _TEXT_INCHES if maps[0][0].texts else _CELL_INCHES
    beside, below = (_LETTER_INCHES * max(map(len, names)) for names in (lines, columns))
    size = (
        max(beside + (_PANEL_INCHES[0] + width * len(columns)) * len(maps[0]) + bool(unit), 7.0),
        0.8 + _SLANT * below + (_PANEL_INCHES[1] + height * len(lines)) * len(maps),
    )
    figure = Figure(figsize=size, layout="constrained")
    shape = len(maps), len(maps[0])
    panels = figure.subplots(*shape, sharex=True, sharey=True, squeeze=False)
    for axes, each in zip(panels.ravel(), chain(*maps), strict=True):
        image = axes.imshow(each.values, aspect="auto", **colours)
        _write(axes, each, image)
        axes.set_xticks(range(len(columns)), columns)
        axes.set_yticks(range(len(lines)), lines)
        axes.tick_params(length=0, labelsize=7)
        if _LETTER_INCHES * max(map(len, columns)) > width:
            for tick in axes.get_xticklabels():
                tick.set(rotation=60, ha="right", rotation_mode="anchor")
        axes.spines[:].set(visible=True, linewidth=0.4)
        axes.grid(False)
        axes.set_title(each.title, loc="left", fontsize=8)
    wide = int(_INCH_LETTERS * size[0])
    figure.suptitle(fill(title, wide), x=0.01, ha="left", fontsize=9)
    figure.supxlabel(fill(note, wide), fontsize=8)
    if unit:
        figure.colorbar(image, ax=panels, label=unit, fraction=0.02, pad=0.01)
    return figure


def differences_figure(
    title: str,
    lines: Mapping[str, Sequence[Contrast | None]],
    columns: Sequence[str],
    note: str,
    widest: float = 0.0,
) -> Figure:
    """A map of mean differences, whose sign is their colour; the scale is at least `widest`."""
    values = np.array([[each.mean if each else np.nan for each in own] for own in lines.values()])
    # Symmetric about zero.
    widest = max(widest, float(np.nanmax(np.abs(values), initial=0.0)))
    drawn = Map("", values, [[*map(mean, own)] for own in lines.values()])
    scale: dict[str, Any] = {"cmap": "PuOr", "vmin": -widest, "vmax": widest}
    return maps_figure(title, [[drawn]], [*lines], columns, note, **scale)


def map_of_means(
    title: str,
    lines: Sequence[Any],
    columns: Sequence[Any],
    values: Iterable[tuple[Any, Any, float]],
) -> Map:
    """The mean of all values of the same line and column."""
    cells: dict[tuple[Any, Any], list[float]] = {}
    for line, column, value in values:
        cells.setdefault((line, column), []).append(value)
    means = [[np.mean(cells.get((line, each), np.nan)) for each in columns] for line in lines]
    return Map(title, np.array(means))


def _write(axes: Axes, drawn: Map, image: Any) -> None:
    """The texts, in black or white, whichever is read on the colour of the cell."""
    for line, column in product(*map(range, drawn.values.shape)) if drawn.texts else ():
        text, value = drawn.texts[line][column], drawn.values[line, column]
        pale = float(np.dot(to_rgb(image.to_rgba(value)), _LUMINANCE)) > _PALE
        look: dict[str, Any] = {
            "color": INK if np.isnan(value) else "black" if pale else "white",
            "weight": "bold" if isinstance(text, Bold) else "normal",
        }
        axes.text(column, line, text, ha="center", va="center", size=7, **look)


_CROWDING_NOTE = (
    f"bold: the interval excludes 0; asterisk: and at least {GATE_M} m; frame: all-camera "
    "collapsed; ≤: at most, where all-camera missed somebody; ~: where both did"
)
_ABLATION_NOTE = "bold: the interval excludes 0; ≤, ≥: a bound, for some are never detected"
_VERDICT_COLOURS = {
    Verdict.HOLDS: "#56B4E9",
    Verdict.LOST: "#F0E442",
    Verdict.FLIPS: "#D55E00",
    Verdict.TIED: "0.9",
    Verdict.ARISES: "#CC79A7",
}
"""From the palette of Okabe and Ito (2008), safe for the colour-blind."""


def crowding_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """First detection of all-camera minus CARE in metres, by standing vehicles and budget."""
    crowd = Crowd(rows)
    counts = crowd.counts[::-1]
    seeds = counted(len({row["seed"] for row in rows}), "seed")
    figure = differences_figure(
        f"dense, {seeds}: first detection of all-camera minus care (m)",
        {str(n): [crowd.gap(n, budget) for budget in crowd.budgets] for n in counts},
        [*map(percent, crowd.budgets)],
        _CROWDING_NOTE,
        # Small differences look small.
        widest=COLLAPSE_M,
    )
    (axes,) = figure.axes
    axes.set(xlabel="budget (share of cells fired)", ylabel="standing vehicles")
    for column, budget in enumerate(crowd.budgets):
        for vehicles in crowd.collapsed(budget):
            # Cells of a map are centred on whole numbers.
            corner = column - 0.5, counts.index(vehicles) - 0.5
            axes.add_patch(Rectangle(corner, 1.0, 1.0, fill=False, edgecolor=INK, linewidth=1.4))
    return {"crowding": figure}


def ablation_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """First detection less that of the usual level in metres, by scenario and budget."""
    seeds = counted(len({row["seed"] for row in rows}), "seed")
    title = f"first detection minus that of the usual level (m), {seeds}"
    columns = {str(place): (place, DETECTION) for place in ABLATION_PLACES}
    return _ablations("ablations", title, AblationStudy(rows), columns)


def open_ablation_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Recall less that of the usual level in points, by budget and measure."""
    study = AblationStudy(rows)
    measures = {
        "first sightings": Recall(FIRST_SIGHTING),
        "all below 20 m": Recall(OVERALL, NEAR_FIELD),
    }
    columns = {
        f"{name}, {percent(budget)}": (FilmPlace(study.source, budget), measure)
        for budget in study.budgets
        for name, measure in measures.items()
    }
    scenes = counted(len({row["scene"] for row in rows if row["policy"] != FULL}), "scene")
    title = f"recall minus that of the usual level (points), {scenes}"
    return _ablations("ablations-open-loop", title, study, columns)


_Column = tuple[Place | FilmPlace, Measure | Recall]


def _ablations(
    name: str, title: str, study: AblationStudy, columns: Mapping[str, _Column]
) -> dict[str, Figure]:
    """A line per level but the usual one; no figure where nothing was played."""
    lines: dict[str, list[Contrast | None]] = {}
    for ablation in study.ablations:
        for level in ablation.levels:
            found = [
                study.frame.contrast(measure, level.key(place, ablation.policy), usual)
                for place, measure in columns.values()
                if (usual := USUAL_VARIANT.key(place, ablation.policy))
                != level.key(place, ablation.policy)
            ]
            if any(found):
                lines[f"{ablation.policy}, {ablation.title}: {level.label}"] = found
    return {name: differences_figure(title, lines, [*columns], _ABLATION_NOTE)} if lines else {}


def realism_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Draw how every headline order of the closed loop fares under every condition."""
    return _realism("realism", RealismStudy(rows))


def open_realism_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Draw how every headline order of the open loop fares under every condition."""
    return _realism("realism-open-loop", RealismStudy(rows))


def _realism(name: str, study: RealismStudy) -> dict[str, Figure]:
    by_measure = {measure: orders for measure, orders in study.orders().items() if orders}
    if not by_measure:
        return {}
    conditions = [condition.label for condition in study.conditions]
    figure = maps_figure(
        f"{study.title}: first policy minus second, {study.unit}",
        [[_verdicts(measure, conditions, orders)] for measure, orders in by_measure.items()],
        conditions,
        [order.label for order in next(iter(by_measure.values()))],
        cmap=ListedColormap([*_VERDICT_COLOURS.values()]),
        vmin=-0.5,
        vmax=len(_VERDICT_COLOURS) - 0.5,
    )
    keys = [Patch(color=colour, label=verdict) for verdict, colour in _VERDICT_COLOURS.items()]
    figure.legend(handles=keys, loc="outside lower left", ncols=len(keys), fontsize=8)
    return {name: figure}


def _verdicts(measure: str, conditions: Sequence[str], orders: Sequence[Order]) -> Map:
    """The verdicts by their numbers, and the differences as texts."""
    kinds = np.full((len(conditions), len(orders)), np.nan)
    texts = [[""] * len(orders) for _ in conditions]
    for line, condition in enumerate(conditions):
        for column, order in enumerate(orders):
            if standing := order.standings.get(condition):
                texts[line][column] = signed(standing)
                if verdict := order.verdict(condition):
                    kinds[line, column] = [*_VERDICT_COLOURS].index(verdict)
    return Map(measure, kinds, texts)


def ncap_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """The mean score by test and speed, a map for every policy and budget."""
    results = NcapRows(rows)

    def drawn(policy: str, budget: float) -> Map:
        contender = results.contender(policy, budget)
        scores = results.scores(contender, results.lines).items()
        found = ((line, speed, value) for (_, (line, speed, _)), value in scores)
        title = f"{results.marked(policy)}, {percent(contender[1])}"
        return map_of_means(title, results.lines, results.speeds, found)

    seeds = counted(len({row["seed"] for row in rows}), "seed")
    figure = maps_figure(
        f"mean score of {seeds} by test and speed (km/h); empty: no test at this speed",
        [[drawn(policy, b) for policy in results.policies] for b in results.budgets or [1.0]],
        [line.label for line in results.lines],
        [f"{speed:g}" for speed in results.speeds],
        "reported, unreported: whether perception knows the cars that hide the target",
        "score (5 avoided, 0 hit at full speed)",
        # A palette whose ends the colour-blind tell apart.
        cmap="RdYlBu",
        vmin=0.0,
        vmax=BEST_SCORE,
    )
    return {"ncap": figure}


def r157_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """The share of the preventable cases avoided by gap and relative speed, whatever the other
    speeds; a map for every policy and budget.
    """
    study = cut_in_rows(rows)
    cases = [case_of(row) for row in rows]
    gaps = sorted({case.gap_m for case in cases}, reverse=True)
    speeds = sorted({case.relative_kph for case in cases})

    def found(policy: str, budget: float) -> Iterator[tuple[float, float, float]]:
        for row in study.of(policy, budget):
            case = case_of(row)
            yield case.gap_m, case.relative_kph, 100.0 * is_avoided(row)

    def drawn(policy: str, budget: float) -> Map:
        own = "every cell" if policy == FULL else percent(budget)
        title = f"{marked(policy, study.tags[policy])}, {own}"
        return map_of_means(title, gaps, speeds, found(policy, budget))

    figure = maps_figure(
        "gap (m) by relative speed (km/h); empty: no case that a careful human prevents",
        [[drawn(policy, budget) for policy in study.policies] for budget in study.budgets or [1.0]],
        [f"{gap:g}" for gap in gaps],
        [f"{speed:g}" for speed in speeds],
        unit="preventable cases avoided (%)",
        cmap="cividis",
        vmin=0,
        vmax=100,
    )
    return {"r157-avoided": figure}
