"""Figures of maps: coloured cells in lines and columns, with a text in each where it has room."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain, product
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from care_sim.core.arrays import Floats
from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.figures.styles import INK
from care_sim.reports.formatting import mean
from care_sim.reports.table import Bold

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
