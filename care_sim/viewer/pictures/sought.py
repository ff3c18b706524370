"""Whom the episode is about, in pictures: an arrow at each that says how it stands with them, and
whom the car hit.
"""

from care_sim.core.boxes import planar_ranges
from care_sim.core.pinhole import PinholeCamera
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.records import Keyframe
from care_sim.loops.watcher import sought
from care_sim.viewer.palette import DETECTED, HIT, IN_VIEW, OUT_OF_VIEW, State
from care_sim.viewer.pictures import drawing
from care_sim.viewer.pictures.labels import Labels
from care_sim.world.world import Actor


def mark_sought(
    labels: Labels, camera: PinholeCamera, loop: ClosedLoop, frame: Keyframe | None
) -> None:
    """An arrow at everybody whom the episode is about, and at whom the car hit.

    Whom a drive lets the ego meet has one within the range of the LiDAR: further down the street
    arrows would lie on one another. `frame` is the keyframe before, None before the first.
    """
    actors = sought(loop.world)
    hit = _hit_actor(loop, frame)
    if hit and hit not in actors:
        actors.append(hit)
    boxes = loop.sensor.boxes_to_local(loop.world.boxes(actors))
    for actor, box, away in zip(actors, boxes, planar_ranges(boxes).tolist(), strict=True):
        if loop.world.meetings and away > loop.rig.grid.range_m:
            continue
        state = HIT if actor is hit else _state(loop, frame, actor)
        if at := drawing.point_above(camera, box):
            labels.arrow(at, f"{actor.name}: {state.words}", state.colour)


def contact_text(loop: ClosedLoop, frame: Keyframe) -> str | None:
    """Whom the car hit in a keyframe, and how fast it was, or who hit the car; None without a
    contact.
    """
    hit = _hit_actor(loop, frame)
    if hit is None or frame.impact is None:
        return None
    if not frame.impact.at_front:
        return f"HIT BY {hit.name}"
    return f"HIT {hit.name} at {frame.impact.speed_mps:.1f} m/s"


def _hit_actor(loop: ClosedLoop, frame: Keyframe | None) -> Actor | None:
    if frame is None or frame.impact is None:
        return None
    return next(actor for actor in loop.world.actors if actor.body == frame.impact.body)


def _state(loop: ClosedLoop, frame: Keyframe | None, actor: Actor) -> State:
    if frame is not None and _is_detected(loop, frame, actor):
        return DETECTED
    return IN_VIEW if loop.shows(actor.body) else OUT_OF_VIEW


def _is_detected(loop: ClosedLoop, frame: Keyframe, actor: Actor) -> bool:
    if not loop.world.meetings:
        return frame.detected
    return any(
        sight.detected and one.body == actor.body
        for one, sight in zip(loop.world.meetings, frame.sights, strict=True)
    )
