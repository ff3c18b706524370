"""Markers of Matplotlib as Vega draws them: outlines as SVG paths in a square from -1 to 1."""

from collections.abc import Iterator, Sequence
from itertools import pairwise, starmap

import numpy as np
from matplotlib.markers import MarkerStyle
from matplotlib.path import Path
from matplotlib.transforms import Affine2D

from care_sim.core.arrays import Floats

_LETTERS = {
    Path.MOVETO: "M",
    Path.LINETO: "L",
    Path.CURVE3: "Q",
    Path.CURVE4: "C",
    Path.CLOSEPOLY: "Z",
}
STROKE = 0.28
"""Width of the bar that stands for a line of a marker without an area."""


def outline(marker: str) -> str:
    """The outline, which can be filled, of a marker that Matplotlib knows by this name; bars where
    it draws lines.
    """
    style = MarkerStyle(marker)
    # Matplotlib's markers reach from -0.5 to 0.5 with y upwards, Vega's from -1 to 1 with y
    # downwards.
    path = style.get_path().transformed(style.get_transform() + Affine2D().scale(2, -2))
    return "".join(_outlined(path) if style.is_filled() else starmap(_bar, _ends(path)))


def _outlined(path: Path) -> Iterator[str]:
    for numbers, code in path.iter_segments(simplify=False):
        yield _LETTERS[code] + ("" if code == Path.CLOSEPOLY else _numbers(numbers))


def _ends(path: Path) -> Iterator[tuple[Floats, Floats]]:
    """Where the straight lines of a path begin and end."""
    points = list(path.iter_segments(simplify=False))
    for (start, _), (end, code) in pairwise(points):
        if code == Path.LINETO:
            yield start, end


def _bar(start: Floats, end: Floats) -> str:
    # Half the width of the bar along the line; turned by a right angle it leads to the corners.
    along = (end - start) * STROKE / 2 / np.hypot(*(end - start))
    across = np.array([-along[1], along[0]])
    corners = (start + across, start - across, end - across, end + across)
    return f"M{'L'.join(map(_numbers, corners))}Z"


def _numbers(values: Sequence[float] | Floats) -> str:
    return ",".join(f"{value:.3f}" for value in values)
