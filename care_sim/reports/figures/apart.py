"""Markers that would hide each other, moved apart."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import offset_copy

from care_sim.core.arrays import Floats
from care_sim.reports.figures.files import texts_as_they_are

BESIDE_PLACES = (
    "markers that would hide each other stand beside their places, which are the small black dots "
    "at the ends of thin lines"
)
_LEAST_POINTS = 6.0
"""Between the middles of two markers: two thirds of the width of one, so that each is seen. Twelve
at one place are moved by up to 12 points."""
_MOST_ROUNDS = 1000
"""Forty markers at one place take fewer than 200."""
_GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))
_INCH_POINTS = 72


def move_apart(figure: Figure, panels: Sequence[tuple[Axes, Sequence[Line2D]]]) -> None:
    """Move the markers, lines of one point each, apart in every panel. Their data stay as they are,
    and a line leads from each that was moved to a dot at its place. Nothing may come after it that
    changes the size of the panels.
    """
    # How far apart two places are on paper is known once the panels have their sizes.
    with texts_as_they_are(figure):
        figure.draw_without_rendering()
    for axes, markers in panels:
        if markers:
            _move_apart(figure, axes, markers)


def _move_apart(figure: Figure, axes: Axes, markers: Sequence[Line2D]) -> None:
    places = np.vstack([np.asarray(marker.get_xydata(), float) for marker in markers])
    moves = apart(axes.transData.transform(places) * _INCH_POINTS / figure.dpi)
    for marker, place, (x, y) in zip(markers, places, moves.tolist(), strict=True):
        if x or y:
            marker.set_transform(offset_copy(axes.transData, figure, x, y, units="points"))
            marker.set_clip_on(False)
            leader = {"arrowstyle": "-", "color": marker.get_color(), "linewidth": 0.8}
            leader |= {"shrinkA": 0, "shrinkB": 0}
            line = axes.annotate(
                "", place, (x, y), textcoords="offset points", arrowprops=leader, zorder=6
            )
            # The panels keep the sizes for which the moves were worked out.
            for artist in (marker, line):
                artist.set_in_layout(False)
    left = places[moves.any(axis=1)]
    axes.scatter(left[:, 0], left[:, 1], s=4, color="black", linewidths=0, zorder=7)


def apart(places: Floats, least: float = _LEAST_POINTS) -> Floats:
    """The moves (n, 2) after which no two of the places (n, 2) are nearer than `least`, all in one
    unit. Places that are so already stay.
    """
    moved = places.copy()
    # Equal places have no direction from one to the other: a step that cannot be seen gives one.
    turns = _GOLDEN_ANGLE * np.arange(len(places))
    steps = 1e-3 * least * np.column_stack([np.cos(turns), np.sin(turns)])
    others = ~np.eye(len(places), dtype=bool)
    for number in range(_MOST_ROUNDS):
        between = moved[:, None] - moved[None]
        distances = np.hypot(between[..., 0], between[..., 1])
        near = others & (distances < 0.999 * least)
        if not near.any():
            break
        if number == 0:
            moved += steps * near.any(axis=1, keepdims=True)
            continue
        # Each of two takes half of what they lack; of several the mean, which does not overshoot.
        pushes = near * (least - distances) / 2 / np.where(near, distances, 1.0)
        crowds = np.maximum(near.sum(axis=1, keepdims=True), 1)
        moved += (between * pushes[..., None]).sum(axis=1) / crowds
    return moved - places
