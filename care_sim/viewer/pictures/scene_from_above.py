"""The picture of a keyframe of the open loop: the scene from above, and the angular grid."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from care_sim.core.arrays import Floats
from care_sim.core.boxes import box_corners
from care_sim.core.firing.shots import shots_by_cell
from care_sim.core.rig import Rig
from care_sim.evaluation.sightings import RANGE_M
from care_sim.loops.open_loop import OpenLoop
from care_sim.loops.scene_records import SceneKeyframe
from care_sim.sensors.annotated import Cloud
from care_sim.viewer.pictures import drawing
from care_sim.viewer.pictures.drawing import BACKGROUND, FAINT_INK, INK
from care_sim.viewer.pictures.keyframe import (
    GRID_LEFT,
    PANELS_TOP,
    PICTURE_HEIGHT,
    PICTURE_WIDTH,
    draw_grid,
)
from care_sim.world.bodies import CATALOGUE

MAP_TOP = 40
MAP_SIZE = (PICTURE_WIDTH, 460)
MAP_BOTTOM = MAP_TOP + MAP_SIZE[1]
_PIXELS_PER_M = MAP_SIZE[1] / (2 * RANGE_M + 4)
_RINGS = (10.0, 20.0, 30.0, 40.0, RANGE_M)
"""Radii of the range rings, metres."""
_CAR = np.array([0.0, 0.0, 0.0, *CATALOGUE["ego"].size, 0.0])
_AROUND = np.array([0.0, 0.0, 0.0, 1.8, 1.8, 0.0, 0.0])
"""What a box gains in length and width for its second line."""

FOUND_COLOUR = (80, 230, 110)
MISSED_COLOUR = (255, 120, 60)
_OUT_OF_RANGE_COLOUR = (95, 100, 108)
_RING_COLOUR = (52, 56, 63)
RETURN_COLOUR = (172, 176, 184)
PLAN_LEGEND = (
    ("found", FOUND_COLOUR),
    ("not found", MISSED_COLOUR),
    ("beyond 50 m", _OUT_OF_RANGE_COLOUR),
    ("double line: its first sighting", INK),
)


def draw_plan(loop: OpenLoop, keyframe: SceneKeyframe) -> NDArray[np.uint8]:
    """A picture (PICTURE_HEIGHT, PICTURE_WIDTH, 3) of a keyframe of a film from above, the car
    driving to the right.

    It shows the annotated objects, which are found, not found, or beyond the range that is scored;
    those that appear have a double line. It shows the returns of the fired cells and, below, the
    angular grid with their ranges. The episode is left as it was.
    """
    canvas = Image.new("RGB", (PICTURE_WIDTH, PICTURE_HEIGHT), BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    canvas.paste(map_from_above(loop, keyframe), (0, MAP_TOP))
    write_header(draw, loop.film.name, loop.rig, keyframe)
    _write_legend(draw)
    draw_grid(canvas, (GRID_LEFT, PANELS_TOP), loop.rig.grid, ranges_of(loop, keyframe))
    return np.asarray(canvas)


def map_from_above(loop: OpenLoop, keyframe: SceneKeyframe) -> Image.Image:
    """The part of the picture that shows the scene, `MAP_SIZE` pixels, the car in the middle."""
    picture = empty_map()
    draw = ImageDraw.Draw(picture)
    points = _returned(loop, keyframe).points
    draw.point(pixels(points[:, :2]).ravel().tolist(), RETURN_COLOUR)
    draw_objects(draw, loop.film.shots[keyframe.index].annotations.boxes, keyframe)
    return picture


def empty_map() -> Image.Image:
    """The rings of range around the car."""
    picture = Image.new("RGB", MAP_SIZE, BACKGROUND)
    draw = ImageDraw.Draw(picture)
    for metres in _RINGS:
        (left, top), (right, bottom) = pixels(
            np.array([[-metres, metres], [metres, -metres]])
        ).tolist()
        draw.ellipse((left, top, right, bottom), outline=_RING_COLOUR)
        draw.text(
            (right - 4, (top + bottom) / 2),
            f"{metres:.0f} m",
            FAINT_INK,
            drawing.font(11),
            anchor="rm",
        )
    return picture


def draw_objects(draw: ImageDraw.ImageDraw, boxes: Floats, keyframe: SceneKeyframe) -> None:
    """The car, and the annotated boxes (n, 7) in the colours of `PLAN_LEGEND`; those that appear
    have a double line.
    """
    draw_box(draw, _CAR, INK, 2)
    for row, box in enumerate(boxes):
        colour = found_colour(keyframe, row)
        draw_box(draw, box, colour, 2)
        if keyframe.appearing[row]:
            draw_box(draw, box + _AROUND, colour, 1)


def found_colour(keyframe: SceneKeyframe, row: int) -> drawing.Colour:
    """That of an annotated object, by how it stands with it."""
    if keyframe.found[row]:
        return FOUND_COLOUR
    return MISSED_COLOUR if keyframe.scored[row] else _OUT_OF_RANGE_COLOUR


def write_header(draw: ImageDraw.ImageDraw, scene: str, rig: Rig, keyframe: SceneKeyframe) -> None:
    """The line over the map: the time, how many were found, how many cells fired, the scene."""
    budget, counted = rig.budget, rig.hardware.counted
    fired = (
        f"nothing fired yet, budget {budget} {counted}s"
        if keyframe.fired is None
        else f"{len(keyframe.fired)} of {budget} {counted}s fired"
    )
    for x, text in (
        (12, f"{keyframe.time_s:.1f} s"),
        (110, f"{keyframe.objects_found} of {keyframe.objects} objects found"),
        (420, fired),
    ):
        draw.text((x, 8), text, INK, drawing.font(20))
    draw.text((PICTURE_WIDTH - 12, 12), scene[:28], FAINT_INK, drawing.font(14), anchor="ra")


def _write_legend(draw: ImageDraw.ImageDraw) -> None:
    draw.text((20, MAP_BOTTOM + 8), "From above, driving to the right:", INK, drawing.font(14))
    for row, (text, colour) in enumerate(PLAN_LEGEND):
        draw.text((20, MAP_BOTTOM + 40 + 24 * row), text, colour, drawing.font(16))
    draw.text(
        (20, MAP_BOTTOM + 40 + 24 * len(PLAN_LEGEND)),
        "dots: returns",
        RETURN_COLOUR,
        drawing.font(16),
    )


def draw_box(draw: ImageDraw.ImageDraw, box: Floats, colour: drawing.Colour, width: int) -> None:
    """The outline of a box (7,) on the map."""
    corners = box_corners(box[None])[0, :4, :2]
    draw.polygon(pixels(corners).ravel().tolist(), outline=colour, width=width)


def pixels(places: Floats) -> Floats:
    """(n, 2) map pixels of places (n, 2) in the sensor frame: ahead is right, left is up."""
    on_map: Floats = np.array(MAP_SIZE) / 2 + places * [_PIXELS_PER_M, -_PIXELS_PER_M]
    return on_map


def _returned(loop: OpenLoop, keyframe: SceneKeyframe) -> Cloud:
    """The returns of the cells that fired."""
    cloud = loop.film.shots[keyframe.index].cloud
    if keyframe.fired is None:
        return cloud.take(np.zeros(len(cloud), bool))
    fired, shots = shots_by_cell(keyframe.fired, loop.rig.grid.size)
    return cloud.take(np.isin(cloud.cells, fired)).to_shots(shots)


def ranges_of(loop: OpenLoop, keyframe: SceneKeyframe) -> NDArray[np.float64]:
    """(E, A) metres as an observation has them: 0 not fired, the reach without a return."""
    grid = loop.rig.grid
    ranges = np.zeros(grid.size)
    if keyframe.fired is not None:
        returned = _returned(loop, keyframe)
        # A recording may hold several points of one cell: the nearest counts.
        ranges[keyframe.fired] = grid.range_m
        np.minimum.at(ranges, returned.cells, grid.ranges_to(returned.cells, returned.points))
    return ranges.reshape(grid.shape)
