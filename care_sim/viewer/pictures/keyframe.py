"""The picture of a keyframe of the closed loop: chase view with boxes, the camera's picture, the
angular grid, a line of text.
"""

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.grid_stack import Grid
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import CLASSES
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.records import Keyframe
from care_sim.loops.watcher import way_ahead
from care_sim.viewer.pictures import drawing
from care_sim.viewer.pictures.camera_views import (
    EXPLAINED_COLOUR,
    ROW_HEIGHT,
    paste_pictures,
    take_pictures,
)
from care_sim.viewer.pictures.drawing import (
    BACKGROUND,
    FAINT_INK,
    INK,
    NO_RETURN_COLOUR,
    NOT_FIRED_COLOUR,
)
from care_sim.viewer.pictures.furnished_world import (
    CHASE_CAMERA,
    CHASE_SIZE,
    METRE_MARKS,
    add_car,
    furnished,
    photograph,
)
from care_sim.viewer.pictures.labels import Labels
from care_sim.viewer.pictures.sought import HIT, contact_text, mark_sought

PICTURE_WIDTH = 960
PICTURE_HEIGHT = 720
SURROUND_HEIGHT = PICTURE_HEIGHT + ROW_HEIGHT
"""Of a rig with several cameras, whose row takes more room."""
_HEADER = 40
PANELS_TOP = _HEADER + CHASE_SIZE[1]
GRID_LEFT = 392
_GRID_MIDDLE = 224
_GRID_SIZE = (512, 128)
"""Of the picture of any grid: four pixels a row for the paper's."""
_NAMES_HEIGHT = 22
"""Of the names of directions between the pictures of two LiDARs."""
_DIRECTIONS = {
    "behind": np.pi,
    "left": np.pi / 2,
    "ahead": 0.0,
    "right": -np.pi / 2,
}
"""Azimuths that are named below the grid."""
BOXES_MEAN = "boxes: tracks, faint when the last scan missed them"

_COASTING_COLOUR = (120, 140, 190)
BRAKING_COLOUR = HIT.colour


def draw_keyframe(loop: ClosedLoop, frame: Keyframe | None) -> NDArray[np.uint8]:
    """A picture (H, PICTURE_WIDTH, 3) of the present state of `loop`, and of the scan of the
    keyframe before, `frame`. H is PICTURE_HEIGHT, with several cameras SURROUND_HEIGHT.

    Above, the street from behind the car: tracks as wireframes, arrows at whom the episode is
    about and at whom the car hit, and on the ground the strip the controller guards. Below, the
    cameras with their detections, those that no forecast explains in another colour, and the cells
    that fired, coloured by range. `frame` is None before the first scan. The episode is left as it
    was.
    """
    cameras = loop.rig.cameras
    surround = len(cameras) > 1
    height = SURROUND_HEIGHT if surround else PICTURE_HEIGHT
    canvas = Image.new("RGB", (PICTURE_WIDTH, height), BACKGROUND)
    with furnished(loop.world) as scene:
        # The cameras do not see the car that carries them, nor the marks on the ground.
        pictures = take_pictures(scene, loop, PICTURE_WIDTH)
        add_car(scene, loop.world, loop.rig.sensor_x_m, loop.guarded_m)
        chase = photograph(scene, CHASE_CAMERA, loop.sensor)
    _annotate_chase(chase, loop, frame)
    _write_header(ImageDraw.Draw(canvas), loop, frame)
    canvas.paste(chase, (0, _HEADER))
    paste_pictures(canvas, pictures, cameras, PANELS_TOP)
    # A row of cameras takes the whole width; the grid lies below it, else beside the one camera.
    at = (_GRID_MIDDLE, PANELS_TOP + ROW_HEIGHT) if surround else (GRID_LEFT, PANELS_TOP)
    draw_grid(canvas, at, loop.rig.grid, loop.belief.ranges)
    return np.asarray(canvas)


def _write_header(draw: ImageDraw.ImageDraw, loop: ClosedLoop, frame: Keyframe | None) -> None:
    motion = loop.world.ego_motion
    budget, counted = loop.rig.budget, loop.rig.hardware.counted
    words = [(12, f"{loop.world.time:.1f} s", INK), (90, f"{motion.speed:.1f} m/s", INK)]
    if frame is None:
        words.append(
            (
                330,
                f"nothing fired yet, budget {budget} of {loop.rig.grid.size} {counted}s",
                FAINT_INK,
            )
        )
    else:
        words.append((330, f"{len(frame.fired)} of {budget} {counted}s fired", INK))
        if contact := contact_text(loop, frame):
            draw.rounded_rectangle((630, 6, 952, 34), 6, HIT.colour)
            words.append((640, contact, BACKGROUND))
        elif np.isfinite(frame.clearance_m):
            words.append((640, f"clearance to {_target_name(loop)} {frame.clearance_m:.1f} m", INK))
        if frame.braking:
            draw.rounded_rectangle((192, 6, 308, 34), 6, BRAKING_COLOUR)
            words.append((203, "BRAKING", BACKGROUND))
    for x, text, colour in words:
        draw.text((x, 8), text, colour, drawing.font(20))


def _annotate_chase(chase: Image.Image, loop: ClosedLoop, frame: Keyframe | None) -> None:
    labels = mark_chase(ImageDraw.Draw(chase), CHASE_CAMERA, loop, frame)
    # Numbers stand beside the bars, 1.6 m to the left, on the ground.
    for metres in METRE_MARKS:
        bar = Frame.mounted(way_ahead(loop.world, loop.rig.sensor_x_m, metres), (0.0, 1.6, 0.0))
        (ground,) = loop.sensor.boxes_to_local(np.array([[bar.x, bar.y, *[0.0] * 5]]))
        if at := drawing.point_above(CHASE_CAMERA, ground):
            labels.beside(at, f"{metres:.0f} m", INK, 12)


def mark_chase(
    draw: ImageDraw.ImageDraw,
    camera: PinholeCamera,
    loop: ClosedLoop,
    frame: Keyframe | None,
    words_size: int = 13,
) -> Labels:
    """Tracks as wireframes with their classes, those that the last scan missed faint, arrows at
    whom the episode is about, and in a corner what the boxes mean. Gives the labels, for more.
    """
    tracks = loop.belief.tracks
    marks = [
        (box, CLASSES[number], misses, _COASTING_COLOUR if misses else EXPLAINED_COLOUR)
        for box, number, misses in zip(tracks.boxes, tracks.classes, tracks.misses, strict=True)
    ]
    # Tracks come nearest first: the nearest is drawn last, over the others, and named first.
    for box, _, misses, colour in reversed(marks):
        drawing.wireframe(draw, camera, box, colour, 1 if misses else 2)
    labels = Labels(draw)
    mark_sought(labels, camera, loop, frame)
    # Before the tracks, whose names leave room for it.
    labels.over((0, draw.im.size[1]), BOXES_MEAN, EXPLAINED_COLOUR, words_size)
    for box, name, _, colour in marks:
        if at := drawing.point_above(camera, box):
            labels.over(at, name, colour)
    return labels


def draw_grid(
    canvas: Image.Image, at: tuple[int, int], grid: Grid, ranges: NDArray[np.floating]
) -> None:
    """The angular grid with a scan (E, A), with its left and top words `at` a pixel of a picture,
    its directions and a legend of its colours. Several LiDARs come one below the other.
    """
    top = paste_cells(canvas, at, grid, drawing.scan_colours(grid, ranges))
    _draw_legend(canvas, ImageDraw.Draw(canvas), at[0], top, grid.range_m)


def paste_cells(
    canvas: Image.Image, at: tuple[int, int], grid: Grid, colours: NDArray[np.uint8]
) -> int:
    """The same of cells in any colours (E, A, 3), without a legend. Gives the pixel row where that
    may begin.
    """
    left, top = at
    draw = ImageDraw.Draw(canvas)
    draw.text((left, top + 8), _grid_words(grid), INK, drawing.font(14))
    # All share the room of one, and every one has its own directions.
    count = len(grid.heads)
    width, height = _GRID_SIZE
    strip = max(1, (height - (count - 1) * _NAMES_HEIGHT) // count)
    for number, head in enumerate(grid.heads):
        first, last = head.rows
        picture = drawing.cells_picture(colours[first : last + 1])
        upper = top + 44 + number * (strip + _NAMES_HEIGHT)
        canvas.paste(drawing.fitted(picture, (width, strip)), (left, upper))
        for share, name in directions(head.grid):
            anchor = {0.0: "la", 1.0: "ra"}.get(share, "ma")
            place = (left + share * width, upper + strip + 4)
            draw.text(place, name, FAINT_INK, drawing.font(13), anchor=anchor)
    return upper + strip + 26


def _grid_words(grid: Grid) -> str:
    first, *others = grid.heads
    if others:
        return f"{len(grid.heads)} LiDARs: cells fired in the last scan, one below the other"
    view_deg = np.rad2deg(first.grid.field_of_view)
    view = "all around the car" if first.grid.goes_round else f"{view_deg:.0f} degrees wide"
    return f"LiDAR: cells fired in the last scan, {view}"


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


def _draw_legend(
    canvas: Image.Image, draw: ImageDraw.ImageDraw, left: int, top: int, reach: float
) -> None:
    for x, colour, name in (
        (0, NOT_FIRED_COLOUR, "not fired"),
        (95, NO_RETURN_COLOUR, "no return"),
    ):
        draw.rectangle((left + x, top, left + x + 14, top + 12), colour)
        draw.text((left + x + 20, top - 2), name, FAINT_INK, drawing.font(13))

    # The scale of ranges, from 0 to the reach.
    scale = np.tile(drawing.range_colours(np.linspace(0.0, 1.0, 160)), (13, 1, 1))
    canvas.paste(Image.fromarray(scale), (left + 245, top))
    draw.text((left + 240, top - 2), "0 m", FAINT_INK, drawing.font(13), anchor="ra")
    draw.text((left + 411, top - 2), f"{reach:.0f} m", FAINT_INK, drawing.font(13))


def _target_name(loop: ClosedLoop) -> str:
    target = loop.world.first_sighting
    return target.name if target is not None else ""
