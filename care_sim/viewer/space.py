"""What is logged in space: bodies, the car and its way, returns, tracks, wedges."""

import numpy as np
import rerun as rr
from rerun.components import FillMode

from care_sim.control import BrakingRules
from care_sim.frames import Floats
from care_sim.moments import Moment, Stance
from care_sim.residual import bundles
from care_sim.types import CLASSES, Rig
from care_sim.viewer import entities as looks
from care_sim.viewer.lane import Lane, boxes

PATH_M = 40.0
CORNERS = (1, 2, 4, 3)
"""The corners of an image box among its rays, in turn."""
GLASSY = FillMode.TransparentFillMajorWireframe
"""People look through bodies at what they hide."""
MARGIN_M = 0.15
"""How much larger than its body the box of the first-sighting actor is drawn."""


class Space:
    """Logs the 3D part of an episode. `ego_width_m` is that of the car."""

    def __init__(self, lane: Lane, rig: Rig, ego_width_m: float):
        self._lane, self._rig = lane, rig
        self._driven: list[Floats] = []
        lane.fix("world", rr.ViewCoordinates.FLU)
        width = ego_width_m + 2 * BrakingRules().side_margin_m
        strip = np.array([[PATH_M / 2, 0.0, 0.02 - rig.sensor_height_m, PATH_M, width, 0.02, 0.0]])
        lane.fix("world/lidar/path", boxes(strip, colors=looks.PATH, fill_mode=FillMode.Solid))

    def log(self, moment: Moment, state: str) -> None:
        """A keyframe, with the state of the first-sighting actor."""
        stance = moment.stance
        self._log_world(stance, state)
        self._log_returns(moment)
        self._log_tracks(stance)
        for name, chosen in (("residual", ~stance.known), ("explained", stance.known)):
            self._log_wedges(stance, name, chosen)

    def _log_world(self, stance: Stance, state: str) -> None:
        colours = [looks.NO_CLASS if label is None else looks.BODY_COLOURS[CLASSES[label]] for label in stance.labels]
        bodies = boxes(stance.bodies, colors=colours, labels=stance.names, show_labels=False, fill_mode=GLASSY)
        self._lane.log("world/bodies", bodies)
        if stance.target is not None:
            around = stance.bodies[[stance.target]] + np.array([0, 0, 0, *[2 * MARGIN_M] * 3, 0])
            text = [f"{stance.names[stance.target]}: {state}"]
            self._lane.log("world/first_sighting", boxes(around, colors=looks.ACTOR_COLOURS[state], labels=text))
        self._lane.log("world/ego", boxes(stance.ego[None], colors=looks.EGO, fill_mode=FillMode.Solid))
        self._driven.append(np.array([*stance.ego[:2], 0.03]))
        self._lane.log("world/driven", rr.LineStrips3D([self._driven], colors=looks.EGO, radii=rr.Radius.ui_points(1)))

    def _log_returns(self, moment: Moment) -> None:
        sensor = moment.stance.sensor
        self._lane.log(
            "world/lidar",
            rr.Transform3D(translation=sensor.origin, quaternion=rr.Quaternion(xyzw=sensor.rotation.as_quat())),
        )
        cells, points = moment.returned(self._rig.grid)
        colours = np.array(looks.SHARE_COLOURS, np.uint8)[moment.shares.ravel()[cells]]
        self._lane.log("world/lidar/returns", rr.Points3D(points, colors=colours, radii=rr.Radius.ui_points(2)))

    def _log_tracks(self, stance: Stance) -> None:
        tracks = stance.belief.tracks
        colours = [looks.COASTING if misses else looks.EXPLAINED for misses in tracks.misses]
        names = [CLASSES[label] for label in tracks.classes]
        self._lane.log("world/lidar/tracks", boxes(tracks.boxes, colors=colours, labels=names, show_labels=False))
        moves = np.column_stack([tracks.velocities, np.zeros(len(tracks))])
        arrows = rr.Arrows3D(vectors=moves, origins=tracks.boxes[:, :3], colors=looks.EXPLAINED, radii=0.08)
        self._lane.log("world/lidar/velocities", arrows)

    def _log_wedges(self, stance: Stance, name: str, chosen: np.ndarray) -> None:
        rays = bundles(stance.belief.detections, self._rig)[chosen][:, CORNERS]
        ends = looks.WEDGE_M * rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        strips = [strip for corners in ends for strip in _pyramid(corners)]
        colour = (*looks.RESIDUAL, 200) if name == "residual" else (*looks.EXPLAINED, 50)
        lines = rr.LineStrips3D(strips, colors=colour, radii=rr.Radius.ui_points(1))
        self._lane.log(f"world/lidar/wedges/{name}", lines)


def _pyramid(corners: Floats) -> list[Floats]:
    """The edges of a wedge whose far corners (4, 3) are given, seen from the sensor: three lines."""
    origin = np.zeros(3)
    a, b, c, d = corners
    return [np.array([origin, a, b, c, d, a]), np.array([b, origin, c]), np.array([origin, d])]
