"""Maps: coloured cells in lines and columns, with a text in each where it has room."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.image import AxesImage

from care_sim.core.arrays import Floats
from care_sim.reports.figures.styles import INK

_LUMINANCE = (0.299, 0.587, 0.114)
_PALE = 0.5


def draw_map(
    axes: Axes,
    values: Floats,
    lines: Sequence[str],
    columns: Sequence[str],
    texts: Sequence[Sequence[str]] = (),
    bold: Sequence[Sequence[bool]] = (),
    **colours: Any,
) -> AxesImage:
    """Draw values (lines, columns) from the top as coloured cells, nan as none; `colours` are
    arguments of Matplotlib's `imshow`.
    """
    image = axes.imshow(values, aspect="auto", **colours)
    for line, own in enumerate(texts):
        for column, text in enumerate(own):
            value = values[line, column]
            ground = to_rgb(image.to_rgba(value))  # type: ignore[arg-type]
            pale = float(np.dot(ground, _LUMINANCE)) > _PALE
            axes.text(
                column,
                line,
                text,
                ha="center",
                va="center",
                size=7,
                weight="bold" if bold and bold[line][column] else "normal",
                color=INK if np.isnan(value) else "black" if pale else "white",
            )
    axes.set_xticks(range(len(columns)), columns)
    axes.set_yticks(range(len(lines)), lines)
    axes.tick_params(length=0, labelsize=7)
    axes.spines[:].set_visible(False)
    axes.grid(False)
    return image
