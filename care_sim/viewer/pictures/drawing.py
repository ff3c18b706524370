"""Parts of pictures: words, boxes in space, and the angular grid in colours."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from care_sim.core.arrays import Floats
from care_sim.core.cells.boxes import BOX_EDGES, box_corners
from care_sim.core.cells.stack import Grid
from care_sim.core.pinhole import NEAR_M, PinholeCamera
from care_sim.viewer import palette


def font(size: int) -> ImageFont.ImageFont | ImageFont.FreeTypeFont:
    """The font of every text, `size` pixels high."""
    return ImageFont.load_default(size)


def write(
    draw: ImageDraw.ImageDraw,
    at: tuple[float, float],
    text: str,
    size: int,
    colour: palette.Colour = palette.INK,
    anchor: str = "la",
) -> None:
    """Write text with its `anchor` at a pixel."""
    draw.text(at, text, colour, font(size), anchor=anchor)


def plate(
    draw: ImageDraw.ImageDraw,
    at: tuple[float, float],
    text: str,
    colour: palette.Colour,
    size: int,
    anchor: str = "mm",
) -> None:
    """Write text in the background's colour on a plate of `colour`, its `anchor` at a pixel."""
    left, top, right, bottom = draw.textbbox(at, text, font(size), anchor=anchor)
    draw.rounded_rectangle((left - 10, top - 8, right + 10, bottom + 8), 7, colour)
    write(draw, at, text, size, palette.BACKGROUND, anchor)


def key(draw: ImageDraw.ImageDraw, at: tuple[int, int], colour: palette.Colour, words: str) -> int:
    """Draw the key of a colour: a patch of it and words. Returns the column where the next may
    begin.
    """
    x, y = at
    draw.rectangle((x, y, x + 14, y + 12), colour)
    write(draw, (x + 20, y - 2), words, 13, palette.FAINT_INK)
    return round(x + 44 + draw.textlength(words, font(13)))


def wireframe(
    draw: ImageDraw.ImageDraw,
    camera: PinholeCamera,
    box: Floats,
    colour: palette.Colour,
    width: int,
) -> None:
    """Draw the edges of a sensor-frame box (7,) that lie wholly before the camera."""
    pixels, depth = camera.project(box_corners(box[None])[0])
    for start, end in BOX_EDGES:
        if min(depth[start], depth[end]) > NEAR_M:
            draw.line([*pixels[start].tolist(), *pixels[end].tolist()], colour, width)


def point_above(camera: PinholeCamera, box: Floats) -> tuple[float, float] | None:
    """Return the pixel of the middle of a box's roof; None behind the camera or outside the
    picture.
    """
    (pixel,), (depth,) = camera.project([[box[0], box[1], box[2] + box[5] / 2]])
    inside = depth > NEAR_M and 0 <= pixel[0] < camera.width and 0 <= pixel[1] < camera.height
    return (float(pixel[0]), float(pixel[1])) if inside else None


def cells_picture(colours: NDArray[np.uint8], size: tuple[int, int]) -> Image.Image:
    """Return the picture of cells with colours (E, n, 3), the car's left on the left. Enlarged
    cells stay sharp; cells that share a pixel are averaged.
    """
    # Columns run counter-clockwise, so that the right comes first.
    picture = Image.fromarray(np.ascontiguousarray(colours[:, ::-1]))
    least = min(picture.width, size[0]), min(picture.height, size[1])
    averaged = picture.resize(least, Image.Resampling.BOX)
    return averaged.resize(size, Image.Resampling.NEAREST)


def scan_colours(grid: Grid, ranges: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Return (E, n, 3) colours of the cells of a scan (E, n), by range."""
    colours = np.full((*ranges.shape, 3), palette.NOT_FIRED_COLOUR, np.uint8)
    fired = ranges > 0
    returned = fired & (ranges < grid.range_m)
    colours[fired] = palette.NO_RETURN_COLOUR
    colours[returned] = range_colours(ranges[returned] / grid.range_m)
    return colours


def range_colours(shares: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Return (..., 3) colours of ranges, given as shares of the reach: near is bright."""
    from matplotlib import colormaps

    # The ends of the scale are left out: they are too close to the background and to white.
    scale = 0.05 + 0.75 * np.asarray(shares)
    colours: NDArray[np.uint8] = colormaps["plasma_r"](scale, bytes=True)[..., :3]
    return colours
