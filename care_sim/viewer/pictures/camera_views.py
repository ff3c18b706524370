"""What the cameras see, with what they detect: one large picture, or a row of several."""

from dataclasses import replace

import numpy as np
from PIL import Image, ImageDraw

from care_sim.core.residual import explained
from care_sim.core.types import CLASSES
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.viewer import palette
from care_sim.viewer.pictures.drawing import write
from care_sim.viewer.pictures.furnished_world import photograph
from care_sim.viewer.pictures.keyframe import BELOW_SIZE, PICTURE_WIDTH
from care_sim.viewer.pictures.labels import Labels
from care_sim.world.bullet import BulletWorld

_ROW_HEIGHT = 140
"""Of a row of cameras with its words, pixels."""
_ALONE_SIZE = (352, 180)
"""Of the picture of a single camera, at the most: the grid is drawn beside it."""
PICTURES_TOP = 30
_BEHIND_RAD = np.deg2rad(170.0)
_AHEAD_RAD = np.deg2rad(10.0)


def cameras_picture(scene: BulletWorld, loop: ClosedLoop) -> Image.Image:
    """What every camera sees, with its detections: those that a forecast explains in one colour,
    the others in another, and in a third, crossed out, those that show nothing.

    The picture of a single camera is as large as the camera's, within a picture of `BELOW_SIZE`,
    and the classes stand beside the boxes. Several share the width of a whole picture and have no
    room for words. They come in the sequence of the grid's columns in a picture: behind, left,
    ahead, right.
    """
    cameras = loop.rig.cameras
    row = len(cameras) > 1
    size = (PICTURE_WIDTH, _ROW_HEIGHT) if row else BELOW_SIZE
    canvas = Image.new("RGB", size, palette.BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    for x, text, colour in (
        (20, "Cameras:" if row else "Front camera:", palette.INK),
        (124, "explained by a track", palette.EXPLAINED_COLOUR),
        (264, "new", palette.UNEXPLAINED_COLOUR),
        (304, "false", palette.FALSE_COLOUR),
    ):
        write(draw, (x, 8), text, 14, colour)
    if not row:
        (camera,) = cameras
        scale = min(1.0, _ALONE_SIZE[0] / camera.width, _ALONE_SIZE[1] / camera.height)
        canvas.paste(_picture(scene, loop, 0, round(scale * camera.width)), (20, PICTURES_TOP))
        return canvas
    share = PICTURE_WIDTH // len(cameras)
    # By where they look.
    from_left = sorted(range(len(cameras)), key=lambda number: -cameras[number].yaw)
    for place, number in enumerate(from_left):
        picture = _picture(scene, loop, number, share)
        canvas.paste(picture, (place * share, PICTURES_TOP))
        at = (place * share + share / 2, PICTURES_TOP + picture.height + 2)
        write(draw, at, _towards(cameras[number].yaw), 13, palette.FAINT_INK, "ma")
    return canvas


def _picture(scene: BulletWorld, loop: ClosedLoop, number: int, width: int) -> Image.Image:
    """Draw the picture of camera `number`, `width` pixels wide."""
    camera, seen = loop.rig.cameras[number], loop.belief.detections
    scale = width / camera.width
    small = replace(camera, width=width, height=round(camera.height * scale))
    picture = photograph(scene, small, loop.sensor)
    known = explained(seen, loop.belief.tracks, loop.rig)
    boxes = scale * seen.boxes
    draw, alone = ImageDraw.Draw(picture), len(loop.rig.cameras) == 1
    labels: list[tuple[float, tuple[float, float], str, palette.Colour]] = []
    for row in np.flatnonzero(seen.cameras == number).tolist():
        left, top, right, bottom = boxes[row].tolist()
        false = loop.detected_bodies[row] == NO_OBJECT
        colour = palette.box_colour(known[row], false)
        draw.rectangle((left, top, right, bottom), outline=colour, width=2 if alone else 1)
        if false:
            draw.line((left, top, right, bottom), colour)
            draw.line((left, bottom, right, top), colour)
        at = (left + right) / 2, top
        labels.append((top - bottom, at, CLASSES[seen.classes[row]], colour))
    words = Labels(draw)
    # The highest are the nearest, whose names keep their places.
    for _, at, name, colour in sorted(labels, key=lambda label: label[0]) if alone else ():
        words.over(at, name, colour, 11)
    return picture


def _towards(yaw: float) -> str:
    if abs(yaw) < _AHEAD_RAD:
        return "ahead"
    if abs(yaw) > _BEHIND_RAD:
        return "behind"
    return f"{abs(np.rad2deg(yaw)):.0f}° to the {'left' if yaw > 0 else 'right'}"
