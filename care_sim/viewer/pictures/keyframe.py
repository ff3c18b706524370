"""The picture of a keyframe of the closed loop: chase view with boxes, the camera's picture, the
angular grid, a line of text.
"""

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.residual import explained
from care_sim.core.types import CLASSES, Tracks
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.records import Keyframe
from care_sim.sensors.lidar import LIDAR_POSITION
from care_sim.viewer.pictures import drawing
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
    way_ahead,
)

PICTURE_WIDTH = 960
PICTURE_HEIGHT = 720
_HEADER = 40
_PANELS = _HEADER + CHASE_SIZE[1]
_CAMERA_AT = (20, _PANELS + 30)
_GRID_AT = (392, _PANELS + 44)
_ROW_PIXELS = 4
_DIRECTIONS = (
    (0.0, "behind", "la"),
    (0.25, "left", "ma"),
    (0.5, "ahead", "ma"),
    (0.75, "right", "ma"),
    (1.0, "behind", "ra"),
)
"""Directions below the grid: share of its width, name, anchor of the text."""
_BOXES_MEAN = "boxes: tracks, faint when the last scan missed them"

TRACKED_COLOUR = (90, 220, 255)
_COASTING_COLOUR = (120, 140, 190)
_UNEXPLAINED_COLOUR = (255, 170, 40)
HIDDEN_COLOUR = (225, 225, 225)
IN_VIEW_COLOUR = (255, 170, 40)
DETECTED_COLOUR = (80, 230, 110)
BRAKING_COLOUR = (255, 80, 70)


def draw_keyframe(loop: ClosedLoop, frame: Keyframe | None) -> NDArray[np.uint8]:
    """A picture (PICTURE_HEIGHT, PICTURE_WIDTH, 3) of the present state of `loop`, and of the scan
    of the keyframe before, `frame`.

    Above, the street from behind the car: tracks as wireframes, an arrow at the first-sighting
    actor, and on the ground the strip the controller guards. Below, the front camera with its
    detections, those that no forecast explains in another colour, and the cells that fired,
    coloured by range. `frame` is None before the first scan. The episode is left as it was.
    """
    canvas = Image.new("RGB", (PICTURE_WIDTH, PICTURE_HEIGHT), BACKGROUND)
    with furnished(loop.world) as scene:
        # The front camera does not see the car that carries it, nor the marks on the ground.
        camera = Image.fromarray(scene.colours(loop.rig.cameras[0], loop.sensor))
        add_car(scene, loop.world, LIDAR_POSITION[0], loop.guarded_m)
        chase = Image.fromarray(scene.colours(CHASE_CAMERA, loop.sensor))
    _annotate_chase(chase, loop, frame)
    _annotate_camera(camera, loop)
    draw = ImageDraw.Draw(canvas)
    _write_header(draw, loop, frame)
    canvas.paste(chase, (0, _HEADER))
    canvas.paste(camera, _CAMERA_AT)
    draw.text((_CAMERA_AT[0], _PANELS + 8), "Front camera:", INK, drawing.font(14))
    draw.text(
        (_CAMERA_AT[0] + 104, _PANELS + 8), "explained by a track", TRACKED_COLOUR, drawing.font(14)
    )
    draw.text((_CAMERA_AT[0] + 260, _PANELS + 8), "new", _UNEXPLAINED_COLOUR, drawing.font(14))
    draw_grid(canvas, draw, loop.rig.grid, loop.belief.ranges)
    return np.asarray(canvas)


def _write_header(draw: ImageDraw.ImageDraw, loop: ClosedLoop, frame: Keyframe | None) -> None:
    motion = loop.world.ego_motion
    budget = loop.rig.budget
    words = [(12, f"{loop.world.time:.1f} s", INK), (90, f"{motion.speed:.1f} m/s", INK)]
    if frame is None:
        words.append(
            (330, f"nothing fired yet, budget {budget} of {loop.rig.grid.size} cells", FAINT_INK)
        )
    else:
        words.append((330, f"{len(frame.fired)} of {budget} cells fired", INK))
        if np.isfinite(frame.clearance_m):
            words.append((640, f"clearance to {_target_name(loop)} {frame.clearance_m:.1f} m", INK))
        if frame.braking:
            draw.rounded_rectangle((192, 6, 308, 34), 6, BRAKING_COLOUR)
            words.append((203, "BRAKING", BACKGROUND))
    for x, text, colour in words:
        draw.text((x, 8), text, colour, drawing.font(20))


def _annotate_chase(chase: Image.Image, loop: ClosedLoop, frame: Keyframe | None) -> None:
    draw = ImageDraw.Draw(chase)
    # Numbers stand beside the bars, 1.6 m to the left, on the ground.
    for metres in METRE_MARKS:
        bar = Frame.mounted(way_ahead(loop.world, LIDAR_POSITION[0], metres), (0.0, 1.6, 0.0))
        (ground,) = loop.sensor.boxes_to_local(np.array([[bar.x, bar.y, *[0.0] * 5]]))
        if at := drawing.point_above(CHASE_CAMERA, ground):
            draw.text(at, f"{metres:.0f} m", INK, drawing.font(12), anchor="rm")
    mark_tracks(draw, CHASE_CAMERA, loop.belief.tracks)
    mark_first_sighting(draw, CHASE_CAMERA, loop, frame)
    drawing.label(draw, (0, CHASE_SIZE[1]), _BOXES_MEAN, TRACKED_COLOUR)


def mark_tracks(draw: ImageDraw.ImageDraw, camera: PinholeCamera, tracks: Tracks) -> None:
    """Tracks as wireframes with their classes; those that the last scan missed are faint."""
    # Tracks come nearest first: the nearest is drawn last, over the others.
    for box, number, misses in reversed(
        list(zip(tracks.boxes, tracks.classes, tracks.misses, strict=True))
    ):
        colour = _COASTING_COLOUR if misses else TRACKED_COLOUR
        drawing.wireframe(draw, camera, box, colour, 1 if misses else 2)
        if at := drawing.point_above(camera, box):
            drawing.label(draw, at, CLASSES[number], colour)


def mark_first_sighting(
    draw: ImageDraw.ImageDraw, camera: PinholeCamera, loop: ClosedLoop, frame: Keyframe | None
) -> None:
    """An arrow at the first-sighting actor that says whether it is hidden, in view or detected."""
    target = loop.world.first_sighting
    if target is None:
        return
    state = "hidden"
    colour = HIDDEN_COLOUR
    if frame is not None and frame.detected:
        state = "detected"
        colour = DETECTED_COLOUR
    elif loop.shows(target.body):
        state = "in view"
        colour = IN_VIEW_COLOUR
    (box,) = loop.sensor.boxes_to_local(loop.world.boxes([target]))
    if at := drawing.point_above(camera, box):
        drawing.arrow(draw, at, f"{target.name}: {state}", colour)


def _annotate_camera(camera: Image.Image, loop: ClosedLoop) -> None:
    seen = loop.belief.detections
    known = explained(seen, loop.belief.tracks, loop.rig)
    # The picture is that of the first camera.
    (own,) = np.nonzero(seen.cameras == 0)
    drawing.image_boxes(
        ImageDraw.Draw(camera),
        seen.boxes[own],
        [CLASSES[number] for number in seen.classes[own]],
        [TRACKED_COLOUR if is_known else _UNEXPLAINED_COLOUR for is_known in known[own]],
    )


def draw_grid(
    canvas: Image.Image, draw: ImageDraw.ImageDraw, grid: AngularGrid, ranges: NDArray[np.floating]
) -> None:
    """The angular grid with a scan (E, A), in the lower right of a picture, with its directions and
    a legend of its colours.
    """
    left, top = _GRID_AT
    picture = drawing.grid_picture(grid, ranges, _ROW_PIXELS)
    canvas.paste(picture, _GRID_AT)
    bottom = top + picture.height
    draw.text(
        (left, _PANELS + 8),
        "LiDAR: cells fired in the last scan, all around the car",
        INK,
        drawing.font(14),
    )
    for share, name, anchor in _DIRECTIONS:
        at = (left + share * grid.columns, bottom + 4)
        draw.text(at, name, FAINT_INK, drawing.font(13), anchor=anchor)
    _draw_legend(canvas, draw, left, bottom + 26, grid.range_m)


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
