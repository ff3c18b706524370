"""Pictures of the closed loop: the street from behind the car, with boxes, and the cameras'
views.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from PIL import Image, ImageDraw

from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.frames import Frame
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.residual import explained
from care_sim.core.types import CLASSES
from care_sim.evaluation.outcomes import outcome
from care_sim.loops.one_world import OneWorld
from care_sim.loops.records import Keyframe
from care_sim.loops.watcher import sought, way_ahead
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.viewer import palette
from care_sim.viewer.palette import State
from care_sim.viewer.pictures import drawing
from care_sim.viewer.pictures.drawing import write
from care_sim.viewer.pictures.furnished_world import METRE_MARKS, add_car, furnished, photograph
from care_sim.viewer.pictures.keyframe import BELOW_SIZE, PANEL_WIDTH, PICTURE_WIDTH, Scenery, View
from care_sim.viewer.pictures.labels import Labels
from care_sim.world.bullet import BulletWorld
from care_sim.world.world import Actor

_ROW_HEIGHT = 140
"""Height of a row of cameras with its words, pixels."""
_ALONE_SIZE = (352, 180)
"""Largest size of a single camera's picture, which leaves room for the grid beside it."""
PICTURES_TOP = 30
_BEHIND_RAD = np.deg2rad(170.0)
_AHEAD_RAD = np.deg2rad(10.0)


def cameras_picture(scene: BulletWorld, loop: OneWorld) -> Image.Image:
    """Draw every camera's view with its detections: explained and unexplained ones in two colours,
    false ones crossed out in a third.

    The picture of a single camera is as large as the camera's, within a picture of `BELOW_SIZE`,
    and the classes stand beside the boxes. Several cameras share the width of a whole picture and
    have no room for words. They come in the order of the grid's columns in a picture: behind, left,
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
    # Ordered by viewing direction.
    from_left = sorted(range(len(cameras)), key=lambda number: -cameras[number].yaw)
    for place, number in enumerate(from_left):
        picture = _picture(scene, loop, number, share)
        canvas.paste(picture, (place * share, PICTURES_TOP))
        at = (place * share + share / 2, PICTURES_TOP + picture.height + 2)
        write(draw, at, _towards(cameras[number].yaw), 13, palette.FAINT_INK, "ma")
    return canvas


def _picture(scene: BulletWorld, loop: OneWorld, number: int, width: int) -> Image.Image:
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


CHASE_CAMERA = PinholeCamera(
    PICTURE_WIDTH, 460, np.deg2rad(80.0), (-10.0, 0.0, 3.6), 0.0, np.deg2rad(-16.0)
)
"""View point behind and above the car, in the frame of the LiDAR, low enough for a strip of sky."""
_PANEL_CAMERA = PinholeCamera(
    PANEL_WIDTH, 320, np.deg2rad(52.0), (-11.0, 0.0, 3.8), 0.0, np.deg2rad(-11.0)
)
BOXES_MEAN = "boxes: tracks, faint when the last scan missed them"


def episode_view(loop: OneWorld, frames: Sequence[Keyframe]) -> View:
    """Return the view of `loop` after the keyframes `frames`, with the last scan.

    The street shows tracks as wireframes, arrows at the first-sighting actor and at actors that the
    car hit, and on the ground the strip that the controller guards. Below are the cameras with
    their detections. The episode is left as it was.
    """
    frame = frames[-1] if frames else None
    return View(
        rig=loop.rig,
        time_s=loop.world.time,
        progress=f"{loop.world.ego_motion.speed:.1f} m/s",
        braking=frame is not None and frame.braking,
        contact=contact_text(loop, frame) if frame else None,
        aside=_clearance(loop, frame) if frame else "",
        verdict=verdict(frames, loop.rig.keyframe_s),
        fired=frame.fired if frame else None,
        ranges=loop.belief.ranges,
        shares=None,
        is_moment=frame is not None and frame.braking,
        scenery=partial(_scenery, loop, frame),
    )


def _clearance(loop: OneWorld, frame: Keyframe) -> str:
    target = loop.world.first_sighting
    if target is None or not np.isfinite(frame.clearance_m):
        return ""
    return f"clearance to {target.name} {frame.clearance_m:.1f} m"


def verdict(frames: Sequence[Keyframe], keyframe_s: float) -> State:
    """Return whether the first-sighting actor is detected so far, since when and how far away."""
    seen = next((frame.time_s for frame in frames if frame.in_view), None)
    found = next((frame.time_s for frame in frames if frame.detected), None)
    if found is None:
        if seen is None:
            return State("not in view yet", palette.FAINT_INK)
        so_long_s = frames[-1].time_s - seen + keyframe_s
        return State(f"in view for {so_long_s:.1f} s, not detected", palette.IN_VIEW.colour)
    so_far = outcome(frames)
    delay_s = 0.0 if seen is None else found - seen
    after = f", {delay_s:.1f} s after coming into view" if delay_s > 0 else ""
    clearance = "" if so_far.clearance_m is None else f"; clearance {so_far.clearance_m:.1f} m"
    words = f"detected at {so_far.detection_distance_m:.1f} m{after}{clearance}"
    return State(words, palette.DETECTED.colour)


def _scenery(loop: OneWorld, frame: Keyframe | None, whole: bool) -> Scenery:
    camera = CHASE_CAMERA if whole else _PANEL_CAMERA
    with furnished(loop.world) as scene:
        # The cameras do not see the car that carries them, nor the marks on the ground.
        below = cameras_picture(scene, loop) if whole else None
        add_car(scene, loop.world, loop.rig.sensor_x_m, loop.guarded_m)
        street = photograph(scene, camera, loop.sensor)
    labels = _mark_street(street, camera, loop, frame)
    # Numbers stand beside the bars, 1.6 m to the left, on the ground.
    for metres in METRE_MARKS:
        bar = Frame.mounted(way_ahead(loop.world, loop.rig.sensor_x_m, metres), (0.0, 1.6, 0.0))
        (ground,) = loop.sensor.boxes_to_local(np.array([[bar.x, bar.y, *[0.0] * 5]]))
        if at := drawing.point_above(camera, ground):
            labels.beside(at, f"{metres:.0f} m", palette.INK, 12)
    return Scenery(street, below)


def _mark_street(
    street: Image.Image, camera: PinholeCamera, loop: OneWorld, frame: Keyframe | None
) -> Labels:
    """Draw tracks as wireframes with their classes (faint if the last scan missed them), arrows at
    the actors of the episode, and a legend of the boxes. Returns the labels.
    """
    draw, tracks = ImageDraw.Draw(street), loop.belief.tracks
    marks = [
        (
            box,
            CLASSES[number],
            misses,
            palette.COASTING_COLOUR if misses else palette.EXPLAINED_COLOUR,
        )
        for box, number, misses in zip(tracks.boxes, tracks.classes, tracks.misses, strict=True)
    ]
    # Tracks come nearest first: the nearest is drawn last, over the others, and named first.
    for box, _, misses, colour in reversed(marks):
        drawing.wireframe(draw, camera, box, colour, 1 if misses else 2)
    labels = Labels(draw)
    mark_actors(labels, camera, loop, frame)
    # Draw the legend before the tracks, so that their names leave room for it.
    labels.over((0, street.height), BOXES_MEAN, palette.EXPLAINED_COLOUR)
    for box, name, _, colour in marks:
        if at := drawing.point_above(camera, box):
            labels.over(at, name, colour)
    return labels


def mark_actors(
    labels: Labels, camera: PinholeCamera, loop: OneWorld, frame: Keyframe | None
) -> None:
    """Draw an arrow at every actor of the episode, and at actors that the car hit. Actors that a
    drive lets the ego meet get an arrow only within the range of the LiDAR, since far arrows would
    overlap. `frame` is the keyframe before, None before the first.
    """
    actors = sought(loop.world)
    hit = _hit_actor(loop, frame)
    if hit and hit not in actors:
        actors.append(hit)
    boxes = loop.sensor.boxes_to_local(loop.world.boxes(actors))
    for actor, box, away in zip(actors, boxes, planar_ranges(boxes).tolist(), strict=True):
        if loop.world.meetings and away > loop.rig.grid.range_m:
            continue
        state = palette.HIT if actor is hit else _state(loop, frame, actor)
        if at := drawing.point_above(camera, box):
            labels.arrow(at, f"{actor.name}: {state.words}", state.colour)


def contact_text(loop: OneWorld, frame: Keyframe) -> str | None:
    """Return the text of a contact in a keyframe: the actor that the car hit and its speed, or the
    actor that hit the car. None without a contact.
    """
    hit = _hit_actor(loop, frame)
    if hit is None or frame.impact is None:
        return None
    if not frame.impact.at_front:
        return f"HIT BY {hit.name}"
    return f"HIT {hit.name} at {frame.impact.speed_mps:.1f} m/s"


def _hit_actor(loop: OneWorld, frame: Keyframe | None) -> Actor | None:
    if frame is None or frame.impact is None:
        return None
    return next(actor for actor in loop.world.actors if actor.body == frame.impact.body)


def _state(loop: OneWorld, frame: Keyframe | None, actor: Actor) -> State:
    if frame is not None and _is_detected(loop, frame, actor):
        return palette.DETECTED
    return palette.IN_VIEW if loop.shows(actor.body) else palette.OUT_OF_VIEW


def _is_detected(loop: OneWorld, frame: Keyframe, actor: Actor) -> bool:
    if not loop.world.meetings:
        return frame.detected
    return any(
        sight.detected and one.body == actor.body
        for one, sight in zip(loop.world.meetings, frame.sights, strict=True)
    )
