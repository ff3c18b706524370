"""A picture of a keyframe to be shown beside that of another policy: chase view, the cells ahead,
and whether the first-sighting actor is detected.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from care_sim.core.grid_stack import Grid
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.rig import Rig
from care_sim.evaluation.metrics import outcome
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.records import Keyframe
from care_sim.viewer.pictures import drawing
from care_sim.viewer.pictures.drawing import BACKGROUND, FAINT_INK, INK, NO_RETURN_COLOUR
from care_sim.viewer.pictures.furnished_world import add_car, furnished, photograph
from care_sim.viewer.pictures.keyframe import BRAKING_COLOUR, mark_chase
from care_sim.viewer.pictures.sought import DETECTED, HIT, IN_VIEW, contact_text

_VIEW_SIZE = (512, 320)
_CAMERA = PinholeCamera(*_VIEW_SIZE, np.deg2rad(52.0), (-11.0, 0.0, 3.8), 0.0, np.deg2rad(-11.0))
_TOP = 36
CELLS_SIZE = (512, 96)
"""Of the picture of any grid: three pixels a row for the paper's."""
_APART = 4
"""Pixels between the pictures of two LiDARs."""
_GRID_TOP = _TOP + _VIEW_SIZE[1] + 22
COMPARISON_WIDTH = _VIEW_SIZE[0]
_COMPARISON_HEIGHT = 508


def draw_panel(name: str, loop: ClosedLoop, frames: Sequence[Keyframe]) -> Image.Image:
    """A picture of the state of `loop` after the keyframes `frames`, under the heading `name`,
    512 x 508 pixels.

    Above, the street from behind the car, as in `care_sim.viewer.pictures.keyframe`. Below, the
    front half of the angular grid with the cells that fired, coloured by range, and whether the
    first-sighting actor is detected, since when and how far away. The episode is left as it was.
    """
    canvas = Image.new("RGB", (COMPARISON_WIDTH, _COMPARISON_HEIGHT), BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    _write_header(draw, name, loop, frames[-1])
    canvas.paste(_chase_view(loop, frames[-1]), (0, _TOP))
    write_cells_line(canvas, _GRID_TOP - 20, len(frames[-1].fired), loop.rig)
    canvas.paste(cells_ahead(loop.rig.grid, loop.belief.ranges), (0, _GRID_TOP))
    contact = contact_text(loop, frames[-1])
    text, colour = (contact, HIT.colour) if contact else verdict_text(frames, loop.rig.keyframe_s)
    draw.text((8, _COMPARISON_HEIGHT - 26), text, colour, drawing.font(16))
    return canvas


def _write_header(draw: ImageDraw.ImageDraw, name: str, loop: ClosedLoop, frame: Keyframe) -> None:
    draw.text((8, 6), name, INK, drawing.font(22))
    draw.text((250, 8), f"{loop.world.time:.1f} s", FAINT_INK, drawing.font(18))
    draw.text((305, 8), f"{loop.world.ego_motion.speed:.1f} m/s", FAINT_INK, drawing.font(18))
    if frame.braking:
        draw.rounded_rectangle((398, 4, 508, 32), 6, BRAKING_COLOUR)
        draw.text((453, 18), "BRAKING", BACKGROUND, drawing.font(20), anchor="mm")


def _chase_view(loop: ClosedLoop, frame: Keyframe) -> Image.Image:
    with furnished(loop.world) as scene:
        add_car(scene, loop.world, loop.rig.sensor_x_m, loop.guarded_m)
        view = photograph(scene, _CAMERA, loop.sensor)
    mark_chase(ImageDraw.Draw(view), _CAMERA, loop, frame, 11)
    return view


def write_cells_line(canvas: Image.Image, top: int, fired: int, rig: Rig) -> None:
    """The line over the cells ahead: how many fired, and what their colours mean."""
    draw = ImageDraw.Draw(canvas)
    words = f"{fired} LiDAR {rig.hardware.counted}s fired, those ahead:"
    draw.text((8, top), words, FAINT_INK, drawing.font(14))
    scale = np.tile(drawing.range_colours(np.linspace(0.0, 1.0, 40)), (10, 1, 1))
    canvas.paste(Image.fromarray(scale), (306, top + 4))
    draw.rectangle((408, top + 4, 420, top + 13), NO_RETURN_COLOUR)
    for x, text, anchor in (
        (302, "0 m", "ra"),
        (350, f"{rig.grid.range_m:.0f} m", "la"),
        (425, "no return", "la"),
    ):
        draw.text((x, top + 1), text, FAINT_INK, drawing.font(12), anchor=anchor)


def cells_ahead(grid: Grid, ranges: NDArray[np.floating]) -> Image.Image:
    """The columns of the front half of a scan (E, A), from its left to its right; several LiDARs
    one below the other.
    """
    width, height = CELLS_SIZE
    cells = Image.new("RGB", CELLS_SIZE, BACKGROUND)
    tops = np.linspace(0, height + _APART, len(grid.heads) + 1).astype(int).tolist()
    for head, (upper, below) in zip(grid.heads, pairwise(tops), strict=True):
        azimuths = head.grid.azimuths
        ahead = np.argsort(azimuths, kind="stable")
        ahead = ahead[np.abs(azimuths[ahead]) < np.pi / 2]
        if len(ahead):
            first, last = head.rows
            picture = drawing.grid_picture(grid, ranges[first : last + 1, ahead])
            cells.paste(drawing.fitted(picture, (width, below - _APART - upper)), (0, upper))
    return cells


def verdict_text(frames: Sequence[Keyframe], keyframe_s: float) -> tuple[str, drawing.Colour]:
    """Whether the first-sighting actor is detected so far: words, and the colour of that state."""
    seen = next((frame.time_s for frame in frames if frame.in_view), None)
    found = next((frame.time_s for frame in frames if frame.detected), None)
    if found is None:
        if seen is None:
            return "not in view yet", FAINT_INK
        return (
            f"in view for {frames[-1].time_s - seen + keyframe_s:.1f} s, not detected",
            IN_VIEW.colour,
        )
    so_far = outcome(frames)
    after = (
        f", {found - seen:.1f} s after coming into view"
        if seen is not None and found > seen
        else ""
    )
    clearance = "" if so_far.clearance_m is None else f"; clearance {so_far.clearance_m:.1f} m"
    return f"detected at {so_far.detection_distance_m:.1f} m{after}{clearance}", DETECTED.colour
