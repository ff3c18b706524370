"""The picture of a keyframe of either loop: the street, the angular grid, a line of text; and the
narrow one that is shown beside those of other policies.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from care_sim.core.actions import SHARES
from care_sim.core.grid import AngularGrid, Cells
from care_sim.core.grid_stack import Grid
from care_sim.core.rig import Rig
from care_sim.viewer import palette
from care_sim.viewer.pictures import drawing

PICTURE_WIDTH = 960
PANEL_WIDTH = 512
"""Of a picture that is shown beside others."""
BELOW_SIZE = (392, 220)
"""Of what is below the street, to the left of the grid."""
STREET_TOP = 40
CELLS_TOP = 30
"""Pixels from the top of the picture of a grid to its cells; its words are above them."""
CELLS_SIZE = (512, 128)
"""Of the cells of any grid: four pixels a row for the paper's."""
_NAMES_HEIGHT = 22
"""Of the names of directions between the pictures of two LiDARs."""
_GRID_HEIGHT = CELLS_TOP + CELLS_SIZE[1] + _NAMES_HEIGHT + 20
_LINE_HEIGHT = 30
_DIRECTIONS = {
    "behind": np.pi,
    "left": np.pi / 2,
    "ahead": 0.0,
    "right": -np.pi / 2,
}
"""Azimuths that are named below the grid."""


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
    """How far the episode is: the speed of the car, or how many objects are found."""
    braking: bool
    contact: str | None
    """Whom the car has hit."""
    aside: str
    """What a picture tells besides, where nobody is hit."""
    verdict: palette.State
    """What a panel tells, where nobody is hit."""
    fired: Cells | None
    """(n,) the cells that fired, each as often as it was fired."""
    ranges: NDArray[np.floating]
    """(E, A) the scan in metres: 0 not fired, maximum range without a return."""
    shares: NDArray[np.uint8] | None
    """(E, A) the shares of the budget, a place in `care_sim.core.actions.SHARES` for each cell.
    They colour the cells; without them the ranges do.
    """
    is_moment: bool
    """Whether a picture of the episode is of this keyframe: the car brakes, or somebody appears."""
    scenery: Callable[[bool], Scenery]
    """Draws the scenery of a whole picture, or of a panel."""


def draw_keyframe(view: View) -> Image.Image:
    """A picture, `PICTURE_WIDTH` x 720 pixels, or 860 where several cameras take a row.

    Above, the street; below, what belongs to it and the cells that fired, in the colours of their
    shares of the budget where these are known, else coloured by range.
    """
    street, below = view.scenery(True)
    assert below is not None
    # What is as wide as the picture takes a row of its own; the grid lies below it, in the middle.
    row = below.width == PICTURE_WIDTH
    top = STREET_TOP + street.height
    left = (PICTURE_WIDTH - CELLS_SIZE[0]) // 2 if row else BELOW_SIZE[0]
    height = top + BELOW_SIZE[1] + (below.height if row else 0)
    canvas = Image.new("RGB", (PICTURE_WIDTH, height), palette.BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    draw.text((12, 8), f"{view.time_s:.1f} s", palette.INK, drawing.font(20))
    draw.text((90, 8), view.progress, palette.INK, drawing.font(20))
    if view.braking:
        drawing.plate(draw, (250, 20), "BRAKING", palette.BRAKING_COLOUR, 20)
    if view.contact:
        drawing.plate(draw, (PICTURE_WIDTH - 18, 20), view.contact, palette.HIT.colour, 20, "rm")
    else:
        draw.text((PICTURE_WIDTH - 12, 8), view.aside, palette.INK, drawing.font(20), anchor="ra")
    canvas.paste(street, (0, STREET_TOP))
    canvas.paste(below, (0, top))
    _draw_grid(canvas, (left, top + (below.height if row else 0)), view)
    return canvas


def draw_panel(name: str, view: View) -> Image.Image:
    """A picture, `PANEL_WIDTH` pixels wide, to be shown beside those of other policies, under the
    heading `name`.

    Above, the street, then the cells that fired, and what has been detected so far.
    """
    street, _ = view.scenery(False)
    below = STREET_TOP + street.height
    size = PANEL_WIDTH, below + _GRID_HEIGHT + _LINE_HEIGHT
    canvas = Image.new("RGB", size, palette.BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    draw.text((8, 6), name, palette.INK, drawing.font(22))
    draw.text((250, 8), f"{view.time_s:.1f} s", palette.FAINT_INK, drawing.font(18))
    draw.text((305, 8), view.progress, palette.FAINT_INK, drawing.font(18))
    if view.braking:
        drawing.plate(draw, (453, 18), "BRAKING", palette.BRAKING_COLOUR, 20)
    canvas.paste(street, (0, STREET_TOP))
    _draw_grid(canvas, (0, below), view)
    text, colour = (view.contact, palette.HIT.colour) if view.contact else view.verdict
    draw.text((8, size[1] - 26), text, colour, drawing.font(16))
    return canvas


def _draw_grid(canvas: Image.Image, at: tuple[int, int], view: View) -> None:
    """The angular grid with a scan, its left and top words `at` a pixel of a picture, its
    directions and a legend of its colours.
    """
    draw = ImageDraw.Draw(canvas)
    draw.text((at[0] + 2, at[1] + 8), _grid_words(view), palette.INK, drawing.font(14))
    grid = view.rig.grid
    if view.shares is not None:
        top = draw_cells(canvas, at, grid, palette.SHARE_COLOURS[view.shares])
        _write_shares(draw, (at[0], top), view)
    else:
        top = draw_cells(canvas, at, grid, drawing.scan_colours(grid, view.ranges))
        _write_ranges(canvas, (at[0], top), grid.range_m)


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
    """The cells in their colours (E, A, 3) with their directions, `CELLS_TOP` pixels below `at`;
    those of several LiDARs one below the other. Gives the pixel row where more may begin.
    """
    left, top = at
    draw = ImageDraw.Draw(canvas)
    # All share the room of one, and every one has its own directions.
    count = len(grid.heads)
    width, height = CELLS_SIZE
    strip = max(1, (height - (count - 1) * _NAMES_HEIGHT) // count)
    for number, head in enumerate(grid.heads):
        first, last = head.rows
        picture = drawing.cells_picture(colours[first : last + 1])
        upper = top + CELLS_TOP + number * (strip + _NAMES_HEIGHT)
        canvas.paste(drawing.fitted(picture, (width, strip)), (left, upper))
        for share, name in directions(head.grid):
            anchor = {0.0: "la", 1.0: "ra"}.get(share, "ma")
            place = (left + share * width, upper + strip + 4)
            draw.text(place, name, palette.FAINT_INK, drawing.font(13), anchor=anchor)
    return upper + strip + 26


def directions(grid: AngularGrid) -> list[tuple[float, str]]:
    """What is named below the picture of a grid, at which share of its width."""
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
    for x, colour, name in (
        (0, palette.NOT_FIRED_COLOUR, "not fired"),
        (95, palette.NO_RETURN_COLOUR, "no return"),
    ):
        drawing.key(draw, (left + x, top), colour, name)
    # The scale of ranges, from 0 to the reach.
    scale = np.tile(drawing.range_colours(np.linspace(0.0, 1.0, 160)), (13, 1, 1))
    canvas.paste(Image.fromarray(scale), (left + 245, top))
    draw.text((left + 240, top - 2), "0 m", palette.FAINT_INK, drawing.font(13), anchor="ra")
    draw.text((left + 411, top - 2), f"{reach:.0f} m", palette.FAINT_INK, drawing.font(13))


def _write_shares(draw: ImageDraw.ImageDraw, at: tuple[int, int], view: View) -> None:
    """The shares that there are, and how many shots each paid for."""
    assert view.shares is not None
    assert view.fired is not None
    paid = np.bincount(view.shares.ravel()[view.fired], minlength=len(SHARES))
    x = at[0]
    for share in np.flatnonzero(paid).tolist():
        words = f"{SHARES[share]} {paid[share]}"
        x = drawing.key(draw, (x, at[1]), tuple(palette.SHARE_COLOURS[share].tolist()), words)
