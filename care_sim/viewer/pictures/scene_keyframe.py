"""The picture of a keyframe of the open loop for close looking: the scene from above with what the
policy knew, and which share of the budget each cell came from.
"""

import numpy as np
from PIL import Image, ImageDraw

from care_sim.core.actions import SHARES
from care_sim.core.arrays import Floats
from care_sim.core.boxes import planar_ranges
from care_sim.core.residual import wedge_rays
from care_sim.core.rig import Rig
from care_sim.evaluation.sightings import RANGE_M
from care_sim.loops.film_watcher import WatchedScene
from care_sim.loops.watcher import TrueSituation
from care_sim.viewer.pictures import drawing
from care_sim.viewer.pictures.camera_views import (
    EXPLAINED_COLOUR,
    FALSE_COLOUR,
    UNEXPLAINED_COLOUR,
)
from care_sim.viewer.pictures.drawing import BACKGROUND, FAINT_INK, INK, NOT_FIRED_COLOUR
from care_sim.viewer.pictures.keyframe import (
    GRID_LEFT,
    PANELS_TOP,
    PICTURE_HEIGHT,
    PICTURE_WIDTH,
    paste_cells,
)
from care_sim.viewer.pictures.labels import Labels
from care_sim.viewer.pictures.scene_from_above import (
    MAP_BOTTOM,
    MAP_TOP,
    PLAN_LEGEND,
    draw_objects,
    empty_map,
    found_colour,
    pixels,
    write_header,
)
from care_sim.viewer.recording.entities import SHARE_COLOURS

TRACK_COLOUR = (205, 160, 255)
_AHEAD_S = 1.0
"""For how long the line of a forecast shows where it goes."""
_DOT = 3
"""Radius of a forecast, pixels."""
_CLEAR = 10
"""Pixels from the middle of a box to its name."""
_DIMMED = 0.45
"""What is left of the colour of a wedge: a scene has many of them."""
_COLOURS = np.array([NOT_FIRED_COLOUR, *SHARE_COLOURS[1:]], np.uint8)
"""Of cells and of their returns, by share."""


def draw_scene_keyframe(scene: str, rig: Rig, watched: WatchedScene) -> Image.Image:
    """A picture, PICTURE_WIDTH x PICTURE_HEIGHT pixels, of a keyframe of the film `scene`.

    From above, the car driving to the right: the annotated objects as in
    `care_sim.viewer.pictures.scene_from_above.draw_plan`, the returns by the share of the budget
    that their cells came from, and what was known when these were chosen: the forecasts of tracks,
    and where the camera's detections lie, which have no depth. Below, the angular grid by share.
    """
    canvas = Image.new("RGB", (PICTURE_WIDTH, PICTURE_HEIGHT), BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    canvas.paste(_map(rig, watched), (0, MAP_TOP))
    write_header(draw, scene, rig, watched.record)
    _write_legend(draw)
    top = paste_cells(canvas, (GRID_LEFT, PANELS_TOP), rig.grid, _COLOURS[watched.shares])
    _write_shares(draw, top, watched)
    return canvas


def _map(rig: Rig, watched: WatchedScene) -> Image.Image:
    situation = watched.situation
    picture = empty_map()
    draw = ImageDraw.Draw(picture)
    _draw_wedges(draw, rig, situation)
    cells, points = watched.returned(rig.grid)
    for (x, y), share in zip(pixels(points[:, :2]), watched.shares.ravel()[cells], strict=True):
        draw.rectangle((x, y, x + 1, y + 1), tuple(_COLOURS[share].tolist()))
    boxes = situation.sensor.boxes_to_local(situation.bodies)
    draw_objects(draw, boxes, watched.record)
    _draw_tracks(draw, situation)
    _name_sightings(draw, boxes, watched)
    return picture


def _draw_wedges(draw: ImageDraw.ImageDraw, rig: Rig, situation: TrueSituation) -> None:
    """The outermost rays through every image box, as far as objects are scored."""
    rays = wedge_rays(situation.belief.detections, rig)
    told = zip(rays, situation.known, situation.false, strict=True)
    for nine, known, false in told:
        colour = FALSE_COLOUR if false else EXPLAINED_COLOUR if known else UNEXPLAINED_COLOUR
        dimmed = tuple(round(_DIMMED * part) for part in colour)
        for end in _outermost(nine):
            draw.line(pixels(np.array([[0.0, 0.0], RANGE_M * end])).ravel().tolist(), dimmed)


def _outermost(rays: Floats) -> Floats:
    """(2, 2) the directions on the ground of the leftmost and rightmost of rays (n, 3) that lie
    within half a turn.
    """
    flat = rays[:, :2] / np.linalg.norm(rays[:, :2], axis=1, keepdims=True)
    # Angles from the first of them, so that it does not matter where a turn begins.
    across = flat[0, 0] * flat[:, 1] - flat[0, 1] * flat[:, 0]
    off = np.arctan2(across, flat @ flat[0])
    ends: Floats = flat[[np.argmax(off), np.argmin(off)]]
    return ends


def _draw_tracks(draw: ImageDraw.ImageDraw, situation: TrueSituation) -> None:
    """A dot at the centre of every forecast, hollow where the last scan missed the track, and a
    line to where it would be in a second, over ground.
    """
    tracks = situation.belief.tracks
    centres = tracks.boxes[:, :2]
    ends = pixels(centres + _AHEAD_S * tracks.velocities)
    for (x, y), end, misses in zip(pixels(centres), ends, tracks.misses, strict=True):
        draw.line((x, y, *end.tolist()), TRACK_COLOUR)
        dot = (x - _DOT, y - _DOT, x + _DOT, y + _DOT)
        draw.ellipse(dot, None if misses else TRACK_COLOUR, TRACK_COLOUR)


def _name_sightings(draw: ImageDraw.ImageDraw, boxes: Floats, watched: WatchedScene) -> None:
    """Who of the boxes (n, 7) appears, the nearest first, and whether it was found: a person is a
    few pixels large.
    """
    labels, record = Labels(draw), watched.record
    for row in np.argsort(planar_ranges(boxes), kind="stable").tolist():
        if record.appearing[row]:
            x, y = pixels(boxes[row, :2]).tolist()
            words = f"{watched.situation.names[row]} appears"
            labels.over((x, y - _CLEAR), words, found_colour(record, row))


def _write_legend(draw: ImageDraw.ImageDraw) -> None:
    """What boxes, dots and lines of the map mean."""
    draw.text((20, MAP_BOTTOM + 8), "From above, driving to the right:", INK, drawing.font(14))
    lines = (
        PLAN_LEGEND[:3],
        PLAN_LEGEND[3:],
        (("dot: forecast of a track, hollow: missed", TRACK_COLOUR),),
        (("with a line to where it is in a second", TRACK_COLOUR),),
        (("camera:", INK), ("explained", EXPLAINED_COLOUR), ("new", UNEXPLAINED_COLOUR),
         ("false", FALSE_COLOUR)),
        (("small dots: returns, by their share of the budget", FAINT_INK),),
    )  # fmt: skip
    for row, line in enumerate(lines):
        x = 20.0
        for words, colour in line:
            at = (x, MAP_BOTTOM + 36 + 24 * row)
            draw.text(at, words, colour, drawing.font(15))
            x += draw.textlength(words, drawing.font(15)) + 14


def _write_shares(draw: ImageDraw.ImageDraw, top: int, watched: WatchedScene) -> None:
    """The shares that there are, and how many shots each paid for."""
    assert watched.record.fired is not None
    paid = np.bincount(watched.shares.ravel()[watched.record.fired], minlength=len(SHARES))
    x = float(GRID_LEFT)
    for share in np.flatnonzero(paid).tolist():
        words = f"{SHARES[share]} {paid[share]}"
        draw.rectangle((x, top, x + 14, top + 12), tuple(_COLOURS[share].tolist()))
        draw.text((x + 20, top - 2), words, FAINT_INK, drawing.font(13))
        x += 44 + draw.textlength(words, drawing.font(13))
