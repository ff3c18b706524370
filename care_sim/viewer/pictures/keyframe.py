"""The picture of a keyframe of either loop: the street, the angular grid, a line of text. Also the
narrow panel beside those of other policies.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from care_sim.core.cells.stack import Grid
from care_sim.core.firing.actions import SHARES
from care_sim.core.grid import AngularGrid, Cells
from care_sim.core.rig import Rig
from care_sim.viewer import palette
from care_sim.viewer.pictures.drawing import (
    cells_picture,
    key,
    plate,
    range_colours,
    scan_colours,
    write,
)

PICTURE_WIDTH = 960
PANEL_WIDTH = 512
"""Width of a panel."""
BELOW_SIZE = (392, 220)
"""Size of the picture below the street, to the left of the grid."""
STREET_TOP = 40
CELLS_TOP = 30
"""Pixels from the top of a grid's picture to its cells; words are above them."""
CELLS_SIZE = (512, 128)
"""Height of the cells of any grid: four pixels a row for the paper's."""
_NAMES_HEIGHT = 22
"""Height of the names of directions between the pictures of two LiDARs."""
_GRID_HEIGHT = CELLS_TOP + CELLS_SIZE[1] + _NAMES_HEIGHT + 20
_LINE_HEIGHT = 30
_DIRECTIONS = {
    "behind": np.pi,
    "left": np.pi / 2,
    "ahead": 0.0,
    "right": -np.pi / 2,
}
"""Azimuths named below the grid."""


class Scenery(NamedTuple):
    """The street, as wide as the picture, and what is below it: a picture of `BELOW_SIZE`, or one
    as wide as the street; None in a panel.
    """

    street: Image.Image
    below: Image.Image | None


@dataclass(frozen=True)
class View:
    """A keyframe of either loop, before the first scan with nothing fired."""

    rig: Rig
    time_s: float
    """Seconds from the start."""
    progress: str
    """State of the episode: the speed of the car, or the number of detected objects."""
    braking: bool
    contact: str | None
    """Text of a collision."""
    aside: str
    """Further text of a picture without a collision."""
    verdict: palette.State
    """Text of a panel without a collision."""
    fired: Cells | None
    """(n,) the cells that fired, each as often as it was fired."""
    ranges: NDArray[np.floating]
    """(E, A) the scan in metres: 0 not fired, maximum range without a return."""
    shares: NDArray[np.uint8] | None
    """(E, A) each cell's share of the budget, a place in `care_sim.core.firing.actions.SHARES`.
    Shares colour the cells; without them ranges do.
    """
    is_moment: bool
    """Whether a picture of the episode is of this keyframe: the car brakes, or somebody appears."""
    scenery: Callable[[bool], Scenery]
    """Draws the scenery of a whole picture, or of a panel."""


def draw_keyframe(view: View) -> Image.Image:
    """Draw a picture, `PICTURE_WIDTH` x 720 pixels, or 860 where several cameras take a row.

    The street is above. Below are its pictures and the fired cells, coloured by share of the budget
    if known, else by range.
    """
    street, below = view.scenery(True)
    assert below is not None
    # A scenery as wide as the picture takes its own row; the grid is below it, in the middle.
    row = below.width == PICTURE_WIDTH
    top = STREET_TOP + street.height
    left = (PICTURE_WIDTH - CELLS_SIZE[0]) // 2 if row else BELOW_SIZE[0]
    grid_top = top + (below.height if row else 0)
    canvas, draw = _canvas(PICTURE_WIDTH, grid_top + BELOW_SIZE[1], view, 250)
    write(draw, (12, 8), f"{view.time_s:.1f} s", 20)
    write(draw, (90, 8), view.progress, 20)
    if view.contact:
        plate(draw, (PICTURE_WIDTH - 18, 20), view.contact, palette.HIT.colour, 20, "rm")
    else:
        write(draw, (PICTURE_WIDTH - 12, 8), view.aside, 20, anchor="ra")
    canvas.paste(street, (0, STREET_TOP))
    canvas.paste(below, (0, top))
    _draw_grid(canvas, (left, grid_top), view)
    return canvas


def draw_panel(name: str, view: View) -> Image.Image:
    """Draw a panel, `PANEL_WIDTH` pixels wide, headed `name`, to stand beside those of other
    policies. It shows the street, then the fired cells, and the detections so far.
    """
    street, _ = view.scenery(False)
    below = STREET_TOP + street.height
    height = below + _GRID_HEIGHT + _LINE_HEIGHT
    canvas, draw = _canvas(PANEL_WIDTH, height, view, 453)
    write(draw, (8, 6), name, 22)
    write(draw, (250, 8), f"{view.time_s:.1f} s", 18, palette.FAINT_INK)
    write(draw, (305, 8), view.progress, 18, palette.FAINT_INK)
    canvas.paste(street, (0, STREET_TOP))
    _draw_grid(canvas, (0, below), view)
    text, colour = (view.contact, palette.HIT.colour) if view.contact else view.verdict
    write(draw, (8, height - 26), text, 16, colour)
    return canvas


def _canvas(
    width: int, height: int, view: View, brake_x: int
) -> tuple[Image.Image, ImageDraw.ImageDraw]:
    """Return an empty picture that shows whether the car brakes."""
    canvas = Image.new("RGB", (width, height), palette.BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    if view.braking:
        plate(draw, (brake_x, 20), "BRAKING", palette.BRAKING_COLOUR, 20)
    return canvas, draw


def _draw_grid(canvas: Image.Image, at: tuple[int, int], view: View) -> None:
    """Draw the angular grid with a scan, its left top corner `at` a pixel, its directions and a
    legend of its colours.
    """
    grid, draw = view.rig.grid, ImageDraw.Draw(canvas)
    write(draw, (at[0] + 2, at[1] + 8), _grid_words(view), 14)
    if view.shares is None:
        top = draw_cells(canvas, at, grid, scan_colours(grid, view.ranges))
        _write_ranges(canvas, (at[0], top), grid.range_m)
        return
    x, top = at[0], draw_cells(canvas, at, grid, palette.SHARE_COLOURS[view.shares])
    # The shares present, and the number of shots of each.
    paid = np.bincount(view.shares.ravel()[view.fired], minlength=len(SHARES))
    for share in np.flatnonzero(paid).tolist():
        colour = tuple(palette.SHARE_COLOURS[share].tolist())
        x = key(draw, (x, top), colour, f"{SHARES[share]} {paid[share]}")


def _grid_words(view: View) -> str:
    budget, counted = view.rig.budget, view.rig.hardware.counted
    if view.fired is None:
        fired = f"nothing fired yet, budget {budget} of {view.rig.grid.size} {counted}s"
    else:
        fired = f"{len(view.fired)} of {budget} {counted}s fired"
    first, *others = view.rig.grid.heads
    if others:
        return f"{1 + len(others)} LiDARs, one below the other: {fired}"
    degrees = np.rad2deg(first.grid.field_of_view)
    width = "all around the car" if first.grid.goes_round else f"{degrees:.0f} degrees wide"
    return f"LiDAR, {width}: {fired}"


def draw_cells(
    canvas: Image.Image, at: tuple[int, int], grid: Grid, colours: NDArray[np.uint8]
) -> int:
    """Draw the cells in their colours (E, A, 3) with their directions, `CELLS_TOP` pixels below
    `at`. Several LiDARs are stacked. Returns the next free pixel row.
    """
    left, top = at
    draw = ImageDraw.Draw(canvas)
    # All share the room of one, and every one has its own directions.
    count = len(grid.heads)
    width, height = CELLS_SIZE
    strip = max(1, (height - (count - 1) * _NAMES_HEIGHT) // count)
    for number, head in enumerate(grid.heads):
        first, last = head.rows
        upper = top + CELLS_TOP + number * (strip + _NAMES_HEIGHT)
        canvas.paste(cells_picture(colours[first : last + 1], (width, strip)), (left, upper))
        for share, name in directions(head.grid):
            anchor = {0.0: "la", 1.0: "ra"}.get(share, "ma")
            place = (left + share * width, upper + strip + 4)
            write(draw, place, name, 13, palette.FAINT_INK, anchor)
    return upper + strip + 26


def directions(grid: AngularGrid) -> list[tuple[float, str]]:
    """Return the directions that are named below the picture of a grid, and at which share of its
    width.
    """
    # Left is left in the picture. Straight behind lies at both ends of a grid that goes all round.
    leftmost = grid.right + grid.field_of_view
    shares = [
        ((leftmost - azimuth + turn) / grid.field_of_view, name)
        for name, azimuth in _DIRECTIONS.items()
        for turn in (-2 * np.pi, 0.0, 2 * np.pi)
    ]
    return [(share, name) for share, name in shares if 0.0 <= share <= 1.0]


def _write_ranges(canvas: Image.Image, at: tuple[int, int], reach: float) -> None:
    draw, (left, top) = ImageDraw.Draw(canvas), at
    key(draw, at, palette.NOT_FIRED_COLOUR, "not fired")
    key(draw, (left + 95, top), palette.NO_RETURN_COLOUR, "no return")
    # The scale of ranges, from 0 to the reach.
    scale = np.tile(range_colours(np.linspace(0.0, 1.0, 160)), (13, 1, 1))
    canvas.paste(Image.fromarray(scale), (left + 245, top))
    write(draw, (left + 240, top - 2), "0 m", 13, palette.FAINT_INK, "ra")
    write(draw, (left + 411, top - 2), f"{reach:.0f} m", 13, palette.FAINT_INK)
