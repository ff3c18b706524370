"""Parts of pictures: boxes in space, the angular grid in colours, and what they are drawn with."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from care_sim.core.arrays import Floats
from care_sim.core.boxes import BOX_EDGES, box_corners
from care_sim.core.grid_stack import Grid
from care_sim.core.pinhole import NEAR_M, PinholeCamera

Colour = tuple[int, int, int]

INK = (235, 237, 240)
FAINT_INK = (150, 155, 162)
BACKGROUND = (24, 26, 30)
NOT_FIRED_COLOUR = (44, 47, 53)
NO_RETURN_COLOUR = (112, 116, 124)
_RANGE_COLOURS = "plasma_r"
"""Of Matplotlib."""


def font(size: int) -> ImageFont.ImageFont | ImageFont.FreeTypeFont:
    """The font of every text, `size` pixels high."""
    return ImageFont.load_default(size)


def wireframe(
    draw: ImageDraw.ImageDraw, camera: PinholeCamera, box: Floats, colour: Colour, width: int
) -> None:
    """The edges of a sensor-frame box (7,) that lie wholly before the camera."""
    pixels, depth = camera.project(box_corners(box[None])[0])
    for start, end in BOX_EDGES:
        if min(depth[start], depth[end]) > NEAR_M:
            draw.line([*pixels[start].tolist(), *pixels[end].tolist()], colour, width)


def point_above(camera: PinholeCamera, box: Floats) -> tuple[float, float] | None:
    """The pixel of the middle of a box's roof; None behind the camera or outside the picture."""
    (pixel,), (depth,) = camera.project([[box[0], box[1], box[2] + box[5] / 2]])
    inside = depth > NEAR_M and 0 <= pixel[0] < camera.width and 0 <= pixel[1] < camera.height
    return (float(pixel[0]), float(pixel[1])) if inside else None


def grid_picture(grid: Grid, ranges: NDArray[np.floating]) -> Image.Image:
    """The scan (E, n) of the grid, or of some of its columns, as the car sees it: its left is left.
    A pixel a cell.
    """
    return cells_picture(scan_colours(grid, ranges))


def cells_picture(colours: NDArray[np.uint8]) -> Image.Image:
    """Cells with colours (E, n, 3) as the car sees them: its left is left. A pixel a cell."""
    # Columns run counter-clockwise, so that the right comes first.
    return Image.fromarray(np.ascontiguousarray(colours[:, ::-1]))


def scan_colours(grid: Grid, ranges: NDArray[np.floating]) -> NDArray[np.uint8]:
    """(E, n, 3) colours of the cells of a scan (E, n), by range."""
    colours = np.full((*ranges.shape, 3), NOT_FIRED_COLOUR, np.uint8)
    fired = ranges > 0
    returned = fired & (ranges < grid.range_m)
    colours[fired] = NO_RETURN_COLOUR
    colours[returned] = range_colours(ranges[returned] / grid.range_m)
    return colours


def fitted(picture: Image.Image, size: tuple[int, int]) -> Image.Image:
    """A picture of cells in another size: cells stay sharp where they grow, and are averaged where
    several share a pixel.
    """
    width = min(picture.width, size[0])
    height = min(picture.height, size[1])
    averaged = picture.resize((width, height), Image.Resampling.BOX)
    return averaged.resize(size, Image.Resampling.NEAREST)


def range_colours(shares: NDArray[np.floating]) -> NDArray[np.uint8]:
    """(..., 3) colours of ranges that are given as shares of the reach: near is bright."""
    from matplotlib import colormaps

    # The ends of the scale are left out: they are too close to the background and to white.
    scale = 0.05 + 0.75 * np.asarray(shares)
    colours: NDArray[np.uint8] = colormaps[_RANGE_COLOURS](scale, bytes=True)[..., :3]
    return colours
