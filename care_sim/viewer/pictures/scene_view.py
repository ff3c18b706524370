"""Pictures of the open loop: the scene from above, the car driving to the right, with detections
and, if known, the policy's knowledge.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np
from PIL import Image, ImageDraw

from care_sim.core.arrays import Floats
from care_sim.core.cells.boxes import box_corners, planar_ranges
from care_sim.core.frames import Frame, turned
from care_sim.core.residual import wedge_rays
from care_sim.core.rig import Rig
from care_sim.evaluation.sightings import RANGE_M
from care_sim.loops.open_loop import OpenLoop, SceneKeyframe
from care_sim.loops.watcher import TrueSituation, Watched, returned
from care_sim.viewer import palette
from care_sim.viewer.palette import State
from care_sim.viewer.pictures.drawing import write
from care_sim.viewer.pictures.keyframe import BELOW_SIZE, PANEL_WIDTH, PICTURE_WIDTH, Scenery, View
from care_sim.viewer.pictures.labels import Labels
from care_sim.world.bodies import CATALOGUE

MAP_HEIGHT = 460
_PIXELS_PER_M = MAP_HEIGHT / (2 * RANGE_M + 4)
_RINGS = (10.0, 20.0, 30.0, 40.0, RANGE_M)
"""Radii of the range rings, metres."""
_CAR = np.array([0.0, 0.0, 0.0, *CATALOGUE["ego"].size, 0.0])
_AROUND = np.array([0.0, 0.0, 0.0, 1.8, 1.8, 0.0, 0.0])
"""Added length and width of a box's second line."""
_RING_COLOUR = (52, 56, 63)
KERB_COLOUR = (138, 130, 110)
RETURN_COLOUR = (172, 176, 184)
DETECTED_COLOUR, MISSED_COLOUR = palette.FAINT_INK, (118, 123, 132)
"""Colours of objects that are no newcomers."""
TRACK_COLOUR = (205, 160, 255)
_AHEAD_S = 1.0
"""Duration of the motion that a forecast's line shows."""
_DOT = 3
"""Radius of a forecast, pixels."""
_CLEAR = 10
"""Pixels from the middle of a box to its name."""
_DIMMED = 0.45
"""Opacity of a wedge, low since a scene has many."""
_SIDES = [7, 8]
"""Among the rays of an image box, those through the points of its left and right edge where its
azimuth is extreme.
"""
_LINE = 18
"""Height of a line of the legend, pixels."""
_OBJECTS = (
    State("newcomer, detected", palette.FOUND_COLOUR),
    State("newcomer, missed", palette.NOT_FOUND_COLOUR),
    State("other object, detected", DETECTED_COLOUR),
    State("other object, not detected", MISSED_COLOUR),
)
_SCAN = (State("small dots: returns", RETURN_COLOUR),)
_KNOWN = (
    State("small dots: returns, by their share of the budget", palette.FAINT_INK),
    State("dot: forecast of a track, hollow: missed", TRACK_COLOUR),
    State("with a line to where it is in a second", TRACK_COLOUR),
    State("camera box, explained by a track", palette.EXPLAINED_COLOUR),
    State("camera box, new", palette.UNEXPLAINED_COLOUR),
    State("camera box, false", palette.FALSE_COLOUR),
)


def scene_view(
    loop: OpenLoop, frames: Sequence[SceneKeyframe], watched: Watched | None = None
) -> View:
    """Return the view of the last of the keyframes `frames`, which `loop` has just played or plays
    next.

    The map shows the road's edges, if the film knows them, annotated objects, and the returns of
    fired cells. Newcomers have a colour and a double line, all other objects are grey. If the
    keyframe was `watched`, newcomers have a name. The map then also shows what was known when the
    cells were chosen: forecasts of tracks, and camera detections, which have no depth. The episode
    is left as it was.
    """
    last = frames[-1]
    entries = sum(frame.entries for frame in frames)
    found = sum(frame.entries_found for frame in frames)
    told = State(
        f"{found} of {entries} newcomers detected in their first frame",
        palette.FOUND_COLOUR if found == entries else palette.NOT_FOUND_COLOUR,
    )
    return View(
        rig=loop.rig,
        time_s=last.time_s,
        progress=f"{last.objects_found} of {last.objects} detected",
        braking=False,
        contact=None,
        aside=loop.film.name[:28],
        verdict=told if entries else State("no newcomer yet", palette.FAINT_INK),
        fired=last.fired,
        ranges=loop.last_ranges,
        shares=watched.shares if watched else None,
        is_moment=bool(last.entries),
        scenery=partial(_scenery, loop, last, watched),
    )


def _scenery(
    loop: OpenLoop, keyframe: SceneKeyframe, watched: Watched | None, whole: bool
) -> Scenery:
    size = PICTURE_WIDTH if whole else PANEL_WIDTH, MAP_HEIGHT
    street = _Map(Image.new("RGB", size, palette.BACKGROUND))
    street.draw_rings()
    shot = loop.film.shots[keyframe.index]
    street.draw_kerbs(loop.film.kerbs, shot.sensor)
    if watched:
        street.draw_wedges(loop.rig, watched.situation)
    street.draw_returns(loop, watched)
    street.draw_objects(shot.annotations.boxes, keyframe)
    if watched:
        street.draw_tracks(watched.situation)
        street.name_sightings(watched.situation, keyframe)
    legend = _OBJECTS + (_KNOWN if watched else _SCAN)
    if not whole:
        _write_legend(street.draw, (8, MAP_HEIGHT - _LINE * len(legend)), legend)
        return Scenery(street.picture, None)
    below = Image.new("RGB", BELOW_SIZE, palette.BACKGROUND)
    draw = ImageDraw.Draw(below)
    write(draw, (20, 8), "From above, driving to the right:", 14)
    _write_legend(draw, (20, 34), legend)
    return Scenery(street.picture, below)


def _write_legend(draw: ImageDraw.ImageDraw, at: tuple[int, int], legend: Sequence[State]) -> None:
    for row, (words, colour) in enumerate(legend):
        write(draw, (at[0], at[1] + _LINE * row), words, 13, colour)


class _Map:
    """A picture of the ground from above, the car in its middle."""

    def __init__(self, picture: Image.Image):
        self.picture = picture
        self.draw = ImageDraw.Draw(picture)
        self._middle = np.array(picture.size) / 2

    def _pixels(self, places: Floats) -> Floats:
        """(n, 2) pixels of places (n, 2) in the sensor frame: ahead is right, left is up."""
        on_map: Floats = self._middle + places * [_PIXELS_PER_M, -_PIXELS_PER_M]
        return on_map

    def _draw_box(self, box: Floats, colour: palette.Colour, width: int) -> None:
        """The outline of a box (7,)."""
        corners = self._pixels(box_corners(box[None])[0, :4, :2])
        self.draw.polygon(corners.ravel().tolist(), outline=colour, width=width)

    def draw_rings(self) -> None:
        """The rings of range around the car."""
        for metres in _RINGS:
            ends = self._pixels(np.array([[-metres, metres], [metres, -metres]]))
            (left, top), (right, bottom) = ends.tolist()
            self.draw.ellipse((left, top, right, bottom), outline=_RING_COLOUR)
            at = right - 4, (top + bottom) / 2
            write(self.draw, at, f"{metres:.0f} m", 11, palette.FAINT_INK, "rm")

    def draw_kerbs(self, kerbs: Sequence[Floats], sensor: Frame) -> None:
        """Draw lines (n, 2) in the world."""
        for line in kerbs:
            seen = turned(line - sensor.origin[:2], -sensor.yaw)
            self.draw.line(self._pixels(seen).ravel().tolist(), KERB_COLOUR)

    def draw_returns(self, loop: OpenLoop, watched: Watched | None) -> None:
        """Draw the returns, in the colours of their shares if known."""
        cells, points = returned(loop.last_ranges, loop.rig.grid)
        colours = np.full((len(cells), 3), RETURN_COLOUR)
        if watched:
            colours = palette.SHARE_COLOURS[watched.shares.ravel()[cells]]
        for (x, y), colour in zip(self._pixels(points[:, :2]), colours.tolist(), strict=True):
            self.draw.rectangle((x, y, x + 1, y + 1), tuple(colour))

    def draw_objects(self, boxes: Floats, keyframe: SceneKeyframe) -> None:
        """Draw the car and the annotated boxes (n, 7), newcomers last, so that none is hidden."""
        self._draw_box(_CAR, palette.INK, 2)
        for row in np.argsort(keyframe.appearing, kind="stable").tolist():
            if keyframe.appearing[row]:
                colour = palette.found_colour(keyframe, row)
                self._draw_box(boxes[row] + _AROUND, colour, 1)
            else:
                colour = DETECTED_COLOUR if keyframe.found[row] else MISSED_COLOUR
            self._draw_box(boxes[row], colour, 2)

    def draw_wedges(self, rig: Rig, situation: TrueSituation) -> None:
        """Draw the rays through the left and right of every image box, up to the scored range."""
        rays = wedge_rays(situation.belief.detections, rig)
        for nine, known, false in zip(rays, situation.known, situation.false, strict=True):
            dimmed = tuple(round(_DIMMED * part) for part in palette.box_colour(known, false))
            for x, y, _ in nine[_SIDES]:
                line = self._pixels(np.array([[0.0, 0.0], [x, y]]) * RANGE_M / np.hypot(x, y))
                self.draw.line(line.ravel().tolist(), dimmed)

    def draw_tracks(self, situation: TrueSituation) -> None:
        """Draw a dot at the centre of every forecast, hollow if the last scan missed the track, and
        a line to its place a second later, over ground.
        """
        tracks = situation.belief.tracks
        centres = tracks.boxes[:, :2]
        ends = self._pixels(centres + _AHEAD_S * tracks.velocities)
        for (x, y), end, misses in zip(self._pixels(centres), ends, tracks.misses, strict=True):
            self.draw.line((x, y, *end.tolist()), TRACK_COLOUR)
            dot = (x - _DOT, y - _DOT, x + _DOT, y + _DOT)
            self.draw.ellipse(dot, None if misses else TRACK_COLOUR, TRACK_COLOUR)

    def name_sightings(self, situation: TrueSituation, keyframe: SceneKeyframe) -> None:
        """Name appearing objects, the nearest first, at a fixed place, since a person is a few
        pixels large. Films have no names, which would hide other objects.
        """
        labels = Labels(self.draw)
        boxes = situation.sensor.boxes_to_local(situation.bodies)
        for row in np.argsort(planar_ranges(boxes), kind="stable").tolist():
            if keyframe.appearing[row]:
                x, y = self._pixels(boxes[row, :2]).tolist()
                words = f"{situation.names[row]} appears"
                labels.over((x, y - _CLEAR), words, palette.found_colour(keyframe, row))
