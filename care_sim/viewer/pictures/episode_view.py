"""What pictures show of the closed loop: the street from behind the car, with boxes, and what the
cameras see.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np
from PIL import Image, ImageDraw

from care_sim.core.frames import Frame
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import CLASSES
from care_sim.evaluation.metrics import outcome
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.records import Keyframe
from care_sim.loops.watcher import way_ahead
from care_sim.viewer.palette import (
    COASTING_COLOUR,
    DETECTED,
    EXPLAINED_COLOUR,
    FAINT_INK,
    IN_VIEW,
    INK,
    State,
)
from care_sim.viewer.pictures import drawing
from care_sim.viewer.pictures.camera_views import cameras_picture
from care_sim.viewer.pictures.furnished_world import METRE_MARKS, add_car, furnished, photograph
from care_sim.viewer.pictures.labels import Labels
from care_sim.viewer.pictures.sought import contact_text, mark_sought
from care_sim.viewer.pictures.view import PANEL_WIDTH, PICTURE_WIDTH, Scenery, View

CHASE_CAMERA = PinholeCamera(
    PICTURE_WIDTH, 460, np.deg2rad(80.0), (-10.0, 0.0, 3.6), 0.0, np.deg2rad(-16.0)
)
"""Behind the car and above it, in the frame of the LiDAR; low enough for a strip of sky."""
_PANEL_CAMERA = PinholeCamera(
    PANEL_WIDTH, 320, np.deg2rad(52.0), (-11.0, 0.0, 3.8), 0.0, np.deg2rad(-11.0)
)
BOXES_MEAN = "boxes: tracks, faint when the last scan missed them"


def episode_view(loop: ClosedLoop, frames: Sequence[Keyframe]) -> View:
    """The present state of `loop` after the keyframes `frames`, and the scan of the last of them.

    The street has tracks as wireframes, arrows at whom the episode is about and at whom the car
    hit, and on the ground the strip the controller guards. Below are the cameras with their
    detections. The episode is left as it was.
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


def _clearance(loop: ClosedLoop, frame: Keyframe) -> str:
    target = loop.world.first_sighting
    if target is None or not np.isfinite(frame.clearance_m):
        return ""
    return f"clearance to {target.name} {frame.clearance_m:.1f} m"


def verdict(frames: Sequence[Keyframe], keyframe_s: float) -> State:
    """Whether the first-sighting actor is detected so far, since when and how far away."""
    seen = next((frame.time_s for frame in frames if frame.in_view), None)
    found = next((frame.time_s for frame in frames if frame.detected), None)
    if found is None:
        if seen is None:
            return State("not in view yet", FAINT_INK)
        so_long_s = frames[-1].time_s - seen + keyframe_s
        return State(f"in view for {so_long_s:.1f} s, not detected", IN_VIEW.colour)
    so_far = outcome(frames)
    delay_s = 0.0 if seen is None else found - seen
    after = f", {delay_s:.1f} s after coming into view" if delay_s > 0 else ""
    clearance = "" if so_far.clearance_m is None else f"; clearance {so_far.clearance_m:.1f} m"
    words = f"detected at {so_far.detection_distance_m:.1f} m{after}{clearance}"
    return State(words, DETECTED.colour)


def _scenery(loop: ClosedLoop, frame: Keyframe | None, whole: bool) -> Scenery:
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
            labels.beside(at, f"{metres:.0f} m", INK, 12)
    return Scenery(street, below)


def _mark_street(
    street: Image.Image, camera: PinholeCamera, loop: ClosedLoop, frame: Keyframe | None
) -> Labels:
    """Tracks as wireframes with their classes, those that the last scan missed faint, arrows at
    whom the episode is about, and in a corner what the boxes mean. Gives the labels, for more.
    """
    draw, tracks = ImageDraw.Draw(street), loop.belief.tracks
    marks = [
        (box, CLASSES[number], misses, COASTING_COLOUR if misses else EXPLAINED_COLOUR)
        for box, number, misses in zip(tracks.boxes, tracks.classes, tracks.misses, strict=True)
    ]
    # Tracks come nearest first: the nearest is drawn last, over the others, and named first.
    for box, _, misses, colour in reversed(marks):
        drawing.wireframe(draw, camera, box, colour, 1 if misses else 2)
    labels = Labels(draw)
    mark_sought(labels, camera, loop, frame)
    # Before the tracks, whose names leave room for it.
    labels.over((0, street.height), BOXES_MEAN, EXPLAINED_COLOUR)
    for box, name, _, colour in marks:
        if at := drawing.point_above(camera, box):
            labels.over(at, name, colour)
    return labels
