"""Maps of paired differences: how much later all-camera detects than CARE as streets fill, and how
much every level of an ablation differs from the usual.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from care_sim.base.errors import counted, percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL
from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.measures import DETECTION, GATE_M, Recall
from care_sim.reports.figures.maps import Map, maps_figure
from care_sim.reports.figures.styles import INK
from care_sim.reports.formatting import mean
from care_sim.reports.protocol.paper_ablations import NEAR_FIELD
from care_sim.reports.tables.ablations import AblationStudy
from care_sim.reports.tables.crowding import COLLAPSE_M, Crowd
from care_sim.study.designs.ablations import (
    ABLATION_PLACES,
    ABLATIONS,
    OPEN_ABLATIONS,
    Ablation,
)
from care_sim.study.designs.variants import USUAL_VARIANT, FilmPlace, Place, Variant
from care_sim.study.rows.reading import Key
from care_sim.study.run_config import FULL, Row

CROWDING_FIGURE = "crowding"
_CROWDING_NOTE = (
    f"bold: the interval excludes 0; asterisk: and at least {GATE_M} m; frame: all-camera "
    "collapsed; ≤: at most, where all-camera missed somebody; ~: where both did"
)


def crowding_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Mean paired difference in first detection, all-camera minus CARE, in metres: one number per
    cell.
    """
    crowd = Crowd(rows)
    counts = crowd.counts[::-1]
    gaps = [[crowd.gap(n, budget) for budget in crowd.budgets] for n in counts]
    values = np.array([[np.nan if gap is None else gap.mean for gap in line] for line in gaps])
    # Symmetric about zero, so that the sign of a difference is its colour. At least as wide as a
    # collapse, so that small differences look small.
    widest = max(float(np.nanmax(np.abs(values), initial=0.0)), COLLAPSE_M)
    seeds = counted(len({row["seed"] for row in rows}), "seed")
    figure = maps_figure(
        f"dense, {seeds}: first detection of all-camera minus care (m)",
        [[Map("", values, [[*map(mean, line)] for line in gaps])]],
        [*map(str, counts)],
        [*map(percent, crowd.budgets)],
        _CROWDING_NOTE,
        cmap="PuOr",
        vmin=-widest,
        vmax=widest,
    )
    (axes,) = figure.axes
    axes.set(xlabel="budget (share of cells fired)", ylabel="standing vehicles")
    for column, budget in enumerate(crowd.budgets):
        for vehicles in crowd.collapsed(budget):
            # Cells of a map are centred on whole numbers.
            corner = column - 0.5, counts.index(vehicles) - 0.5
            axes.add_patch(Rectangle(corner, 1.0, 1.0, fill=False, edgecolor=INK, linewidth=1.4))
    return {CROWDING_FIGURE: figure}


ABLATION_FIGURE = "ablations"
OPEN_ABLATION_FIGURE = "ablations-open-loop"
_ABLATION_NOTE = "bold: the interval excludes 0; ≤, ≥: a bound, for some are never detected"


def ablation_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Paired differences of the first detection in metres, one column per scenario and budget."""
    study = Frame(rows)

    def differences(ours: Variant, ablation: Ablation) -> list[Contrast | None]:
        return [
            study.contrast(DETECTION, *_keys(ablation, ours, place)) for place in ABLATION_PLACES
        ]

    seeds = counted(len({row["seed"] for row in rows}), "seed")
    title = f"first detection minus that of the usual level (m), {seeds}"
    columns = [str(place) for place in ABLATION_PLACES]
    return _ablation_map(
        ABLATION_FIGURE, title, ABLATIONS, ABLATION_PLACES[0], columns, differences
    )


def open_ablation_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Paired differences of recalls in points, one column per budget and measure."""
    study = AblationStudy(rows)
    columns = [
        (f"{name}, {percent(budget)}", FilmPlace(study.source, budget), ratio, within)
        for budget in study.budgets
        for name, ratio, within in (
            ("first sightings", FIRST_SIGHTING, ""),
            ("all below 20 m", OVERALL, NEAR_FIELD),
        )
    ]

    def differences(ours: Variant, ablation: Ablation) -> list[Contrast | None]:
        return [
            study.frame.contrast(Recall(ratio, within), *_keys(ablation, ours, place))
            for _, place, ratio, within in columns
        ]

    if not columns:
        return {}
    scenes = counted(len({row["scene"] for row in rows if row["policy"] != FULL}), "scene")
    title = f"recall minus that of the usual level (points), {scenes}"
    names = [name for name, *_ in columns]
    place = columns[0][1]
    return _ablation_map(OPEN_ABLATION_FIGURE, title, OPEN_ABLATIONS, place, names, differences)


def _ablation_map(
    name: str,
    title: str,
    ablations: Sequence[Ablation],
    place: Place | FilmPlace,
    columns: Sequence[str],
    differences: Callable[[Variant, Ablation], Sequence[Contrast | None]],
) -> dict[str, Figure]:
    """A line per level but the usual one, which `place` tells; none where nothing was played."""
    lines = {
        f"{ablation.policy}, {ablation.title}: {level.label}": found
        for ablation in ablations
        for level in ablation.levels
        if len({*_keys(ablation, level, place)}) == 2 and any(found := differences(level, ablation))
    }
    if not lines:
        return {}
    values = np.array([[each.mean if each else np.nan for each in own] for own in lines.values()])
    widest = float(np.nanmax(np.abs(values)))
    texts = [[*map(mean, own)] for own in lines.values()]
    colours: dict[str, Any] = {"cmap": "PuOr", "vmin": -widest, "vmax": widest}
    return {
        name: maps_figure(
            title, [[Map("", values, texts)]], [*lines], columns, _ABLATION_NOTE, **colours
        )
    }


def _keys(ablation: Ablation, level: Variant, place: Place | FilmPlace) -> tuple[Key, Key]:
    """The cells of a level and of the usual one."""
    return level.key(place, ablation.policy), USUAL_VARIANT.key(place, ablation.policy)
