"""What the cameras see, with what they detect: one large picture, or a row of several."""

from dataclasses import replace

import numpy as np
from PIL import Image, ImageDraw

from care_sim.core.arrays import Mask
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.residual import explained
from care_sim.core.types import CLASSES
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.viewer.pictures import drawing
from care_sim.viewer.pictures.drawing import FAINT_INK, INK
from care_sim.viewer.pictures.furnished_world import photograph
from care_sim.viewer.pictures.labels import Labels
from care_sim.world.bullet import BulletWorld

EXPLAINED_COLOUR = (90, 220, 255)
UNEXPLAINED_COLOUR = (255, 170, 40)
FALSE_COLOUR = (255, 105, 180)
ROW_HEIGHT = 140
"""Of a row of cameras with its words, pixels."""
ALONE_SIZE = (352, 180)
"""Of the picture of a single camera, at the most: the grid is drawn beside it."""
_BEHIND_RAD = np.deg2rad(170.0)
_AHEAD_RAD = np.deg2rad(10.0)


def take_pictures(scene: BulletWorld, loop: ClosedLoop, width: int) -> list[Image.Image]:
    """What every camera sees, with its detections: those that a forecast explains in one colour,
    the others in another, and in a third, crossed out, those that show nothing.

    That of a single camera is as large as the camera's, within `ALONE_SIZE`, and the classes stand
    beside the boxes. Several share `width` pixels and have no room for words. They come in the
    sequence of the grid's columns in a picture: behind, left, ahead, right.
    """
    cameras = loop.rig.cameras
    known = explained(loop.belief.detections, loop.belief.tracks, loop.rig)
    if len(cameras) == 1:
        camera = cameras[0]
        scale = min(1.0, ALONE_SIZE[0] / camera.width, ALONE_SIZE[1] / camera.height)
        return [_picture(scene, loop, known, 0, round(scale * camera.width))]
    share = width // len(cameras)
    return [_picture(scene, loop, known, number, share) for number in _from_left(cameras)]


def paste_pictures(
    canvas: Image.Image, pictures: list[Image.Image], cameras: tuple[PinholeCamera, ...], top: int
) -> None:
    """Lay the pictures of `take_pictures` and what their colours mean below `top`."""
    draw = ImageDraw.Draw(canvas)
    row = len(pictures) > 1
    words = (
        (20, "Cameras:" if row else "Front camera:", INK),
        (124, "explained by a track", EXPLAINED_COLOUR),
        (264, "new", UNEXPLAINED_COLOUR),
        (304, "false", FALSE_COLOUR),
    )
    for x, text, colour in words:
        draw.text((x, top + 8), text, colour, drawing.font(14))
    if not row:
        canvas.paste(pictures[0], (20, top + 30))
        return
    for place, (picture, number) in enumerate(zip(pictures, _from_left(cameras), strict=True)):
        left = place * (canvas.width // len(pictures))
        canvas.paste(picture, (left, top + 30))
        at = (left + picture.width / 2, top + 32 + picture.height)
        draw.text(at, _towards(cameras[number].yaw), FAINT_INK, drawing.font(13), anchor="ma")


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
    marks = [
        ((scale * seen.boxes[row]).tolist(), CLASSES[seen.classes[row]], _colour(loop, known, row))
        for row in own.tolist()
    ]
    draw, alone = ImageDraw.Draw(picture), len(loop.rig.cameras) == 1
    for (left, top, right, bottom), _, colour in marks:
        draw.rectangle((left, top, right, bottom), outline=colour, width=2 if alone else 1)
        if colour == FALSE_COLOUR:
            draw.line((left, top, right, bottom), colour)
            draw.line((left, bottom, right, top), colour)
    labels = Labels(draw)
    # The highest are the nearest, whose names keep their places.
    for (left, top, right, _), name, colour in sorted(marks, key=_height, reverse=True):
        if alone:
            labels.over(((left + right) / 2, top), name, colour, 11)
    return picture


def _colour(loop: ClosedLoop, known: Mask, row: int) -> drawing.Colour:
    """That of a detection: a false box is told, whether a track explains it or not."""
    if loop.detected_bodies[row] == NO_OBJECT:
        return FALSE_COLOUR
    return EXPLAINED_COLOUR if known[row] else UNEXPLAINED_COLOUR


def _height(mark: tuple[list[float], str, drawing.Colour]) -> float:
    (_, top, _, bottom), _, _ = mark
    return bottom - top


def _from_left(cameras: tuple[PinholeCamera, ...]) -> list[int]:
    """The numbers of cameras by where they look: behind, left, ahead, right."""
    return sorted(range(len(cameras)), key=lambda number: -cameras[number].yaw)


def _towards(yaw: float) -> str:
    if abs(yaw) < _AHEAD_RAD:
        return "ahead"
    if abs(yaw) > _BEHIND_RAD:
        return "behind"
    return f"{abs(np.rad2deg(yaw)):.0f}° to the {'left' if yaw > 0 else 'right'}"
