"""What the cameras see, with what they detect: one large picture, or a row of several."""

from dataclasses import replace

import numpy as np
from PIL import Image, ImageDraw

from care_sim.core.arrays import Mask
from care_sim.core.residual import explained
from care_sim.core.types import CLASSES
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.viewer import palette
from care_sim.viewer.pictures import drawing
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
    known = explained(loop.belief.detections, loop.belief.tracks, loop.rig)
    row = len(cameras) > 1
    canvas = Image.new(
        "RGB", (PICTURE_WIDTH, _ROW_HEIGHT) if row else BELOW_SIZE, palette.BACKGROUND
    )
    draw = ImageDraw.Draw(canvas)
    for x, text, colour in (
        (20, "Cameras:" if row else "Front camera:", palette.INK),
        (124, "explained by a track", palette.EXPLAINED_COLOUR),
        (264, "new", palette.UNEXPLAINED_COLOUR),
        (304, "false", palette.FALSE_COLOUR),
    ):
        draw.text((x, 8), text, colour, drawing.font(14))
    if not row:
        (camera,) = cameras
        scale = min(1.0, _ALONE_SIZE[0] / camera.width, _ALONE_SIZE[1] / camera.height)
        alone = _picture(scene, loop, known, 0, round(scale * camera.width))
        canvas.paste(alone, (20, PICTURES_TOP))
        return canvas
    share = PICTURE_WIDTH // len(cameras)
    # By where they look.
    from_left = sorted(range(len(cameras)), key=lambda number: -cameras[number].yaw)
    for place, number in enumerate(from_left):
        picture = _picture(scene, loop, known, number, share)
        canvas.paste(picture, (place * share, PICTURES_TOP))
        at = (place * share + share / 2, PICTURES_TOP + picture.height + 2)
        draw.text(
            at, _towards(cameras[number].yaw), palette.FAINT_INK, drawing.font(13), anchor="ma"
        )
    return canvas


def _picture(
    scene: BulletWorld, loop: ClosedLoop, known: Mask, number: int, width: int
) -> Image.Image:
    """That of camera `number`, `width` pixels wide; `known` (k,) are the explained detections."""
    camera = loop.rig.cameras[number]
    scale = width / camera.width
    small = replace(camera, width=width, height=round(camera.height * scale))
    picture = photograph(scene, small, loop.sensor)
    seen = loop.belief.detections
    (own,) = np.nonzero(seen.cameras == number)
    boxes = scale * seen.boxes
    draw, alone = ImageDraw.Draw(picture), len(loop.rig.cameras) == 1
    for row in own.tolist():
        left, top, right, bottom = boxes[row].tolist()
        colour = _colour(loop, known, row)
        draw.rectangle((left, top, right, bottom), outline=colour, width=2 if alone else 1)
        if colour == palette.FALSE_COLOUR:
            draw.line((left, top, right, bottom), colour)
            draw.line((left, bottom, right, top), colour)
    labels = Labels(draw)
    # The highest are the nearest, whose names keep their places.
    heights = boxes[own, 3] - boxes[own, 1]
    for row in own[np.argsort(-heights, kind="stable")].tolist() if alone else ():
        left, top, right, _ = boxes[row].tolist()
        name = CLASSES[seen.classes[row]]
        labels.over(((left + right) / 2, top), name, _colour(loop, known, row), 11)
    return picture


def _colour(loop: ClosedLoop, known: Mask, row: int) -> palette.Colour:
    """That of a detection: a false box is told, whether a track explains it or not."""
    if loop.detected_bodies[row] == NO_OBJECT:
        return palette.FALSE_COLOUR
    return palette.EXPLAINED_COLOUR if known[row] else palette.UNEXPLAINED_COLOUR


def _towards(yaw: float) -> str:
    if abs(yaw) < _AHEAD_RAD:
        return "ahead"
    if abs(yaw) > _BEHIND_RAD:
        return "behind"
    return f"{abs(np.rad2deg(yaw)):.0f}° to the {'left' if yaw > 0 else 'right'}"
