"""Logs in space: bodies, the car and its path, returns, tracks, wedges."""

import math

import numpy as np
import rerun as rr
from rerun.components import FillMode

from care_sim.core.arrays import Floats
from care_sim.core.residual import wedge_rays
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES
from care_sim.loops.records import Keyframe
from care_sim.loops.watcher import WAY_M, TrueSituation, Watched
from care_sim.viewer import palette
from care_sim.viewer.recording.entities import MOST_POINTS, WEDGE_M
from care_sim.viewer.recording.lane import THIN, Lane, box_batch
from care_sim.viewer.recording.measure_log import actor_state

_OVERLAP = 1.3
"""Factor of the length of a bending strip's pieces, against cracks."""
_CORNERS = (1, 2, 4, 3)
"""Places of the corners of an image box among its rays, one after the other around it."""
_PATH_COLOUR = (46, 54, 68)
_BODY_COLOURS: dict[int | None, palette.Colour] = dict(
    enumerate([(88, 142, 212), (196, 154, 92), (206, 112, 178), (146, 190, 92), (240, 200, 70)])
)
"""By place in `CLASSES`."""
_NO_CLASS = (120, 124, 132)
_GLASSY = FillMode.TransparentFillMajorWireframe
"""Bodies are transparent, to show what they hide."""
_MARGIN_M = 0.15
"""Enlargement of the first-sighting actor's box over its body."""


class SpaceLog:
    """Logs the 3D part of an episode whose driver guards a strip `guarded_m` wide, 0 without a
    driver.
    """

    def __init__(self, lane: Lane, rig: Rig, guarded_m: float):
        self._lane = lane
        self._rig = rig
        self._guarded_m = guarded_m
        self._driven: list[Floats] = []
        solid, lines = FillMode.Solid, rr.LineStrips3D.from_fields
        # Log what stays for the whole episode; places follow with every keyframe.
        for entity, look in {
            "": rr.ViewCoordinates.FLU,
            "/ego": rr.Boxes3D.from_fields(colors=[palette.EGO_COLOUR], fill_mode=solid),
            "/bodies": rr.Boxes3D.from_fields(show_labels=False, fill_mode=_GLASSY),
            "/driven": lines(colors=[palette.EGO_COLOUR], radii=[THIN]),
            "/lidar/returns": rr.Points3D.from_fields(radii=[2 * THIN]),
            "/lidar/tracks": rr.Boxes3D.from_fields(show_labels=False),
            "/lidar/velocities": rr.Arrows3D.from_fields(
                colors=[palette.EXPLAINED_COLOUR], radii=[0.08]
            ),
            "/lidar/wedges/residual": lines(
                colors=[(*palette.UNEXPLAINED_COLOUR, 200)], radii=[THIN]
            ),
            "/lidar/wedges/explained": lines(
                colors=[(*palette.EXPLAINED_COLOUR, 50)], radii=[THIN]
            ),
        }.items():
            lane.fix(f"world{entity}", look)
        if guarded_m:
            path = rr.Boxes3D.from_fields(colors=[_PATH_COLOUR], fill_mode=solid)
            lane.fix("world/lidar/path", path)

    def log(self, watched: Watched) -> None:
        """Log a keyframe."""
        situation = watched.situation
        self._log_bodies(watched)
        self._log_ego(situation)
        self._log_returns(watched)
        self._log_tracks(situation)
        for kind, chosen in (("residual", ~situation.known), ("explained", situation.known)):
            self._log_wedges(
                kind, wedge_rays(situation.belief.detections, self._rig)[chosen][:, _CORNERS]
            )

    def _log_bodies(self, watched: Watched) -> None:
        situation, record = watched.situation, watched.record
        if isinstance(record, Keyframe):
            colours = [_BODY_COLOURS.get(label, _NO_CLASS) for label in situation.labels]
        else:
            colours = [palette.found_colour(record, row) for row in range(len(situation.bodies))]
        self._lane.log(
            "world/bodies", box_batch(situation.bodies, colors=colours, labels=situation.names)
        )
        # A box around the first-sighting actor, in the colour of its state.
        if situation.target is not None and isinstance(record, Keyframe):
            around = situation.bodies[[situation.target]] + [0, 0, 0, *[2 * _MARGIN_M] * 3, 0]
            state = actor_state(record)
            text = [f"{situation.names[situation.target]}: {state.words}"]
            box = box_batch(around, colors=state.colour, labels=text)
            self._lane.log("world/first_sighting", box)

    def _log_ego(self, situation: TrueSituation) -> None:
        self._lane.log("world/ego", box_batch(situation.ego[None]))
        self._driven.append(np.array([*situation.ego[:2], 0.03]))
        self._lane.log("world/driven", rr.LineStrips3D([self._driven]))
        sensor = situation.sensor
        self._log_path(situation)
        turn = rr.Quaternion(xyzw=sensor.rotation.as_quat())
        self._lane.log("world/lidar", rr.Transform3D(translation=sensor.origin, quaternion=turn))

    def _log_path(self, situation: TrueSituation) -> None:
        """Log the strip on the ground that the driver guards."""
        way = situation.way
        if not self._guarded_m:
            return
        length = WAY_M / len(way) * (_OVERLAP if len(way) > 1 else 1.0)
        strip = np.column_stack(
            [
                way[:, :2],
                np.full(len(way), 0.02),
                np.tile([length, self._guarded_m, 0.02], (len(way), 1)),
                way[:, 2],
            ]
        )
        self._lane.log("world/lidar/path", box_batch(situation.sensor.boxes_to_local(strip)))

    def _log_returns(self, watched: Watched) -> None:
        cells, points = watched.returned(self._rig.grid)
        # Every nth return, so that there are at most MOST_POINTS.
        step = math.ceil(len(cells) / MOST_POINTS) or 1
        colours = palette.SHARE_COLOURS[watched.shares.ravel()[cells[::step]]]
        self._lane.log("world/lidar/returns", rr.Points3D(points[::step], colors=colours))

    def _log_tracks(self, situation: TrueSituation) -> None:
        tracks = situation.belief.tracks
        colours = [
            palette.COASTING_COLOUR if misses else palette.EXPLAINED_COLOUR
            for misses in tracks.misses
        ]
        names = [CLASSES[label] for label in tracks.classes]
        boxes = box_batch(tracks.boxes, colors=colours, labels=names)
        moves = np.column_stack([tracks.velocities, np.zeros(len(tracks))])
        arrows = rr.Arrows3D(vectors=moves, origins=tracks.boxes[:, :3])
        self._lane.log_list("world/lidar/tracks", len(tracks), boxes)
        self._lane.log_list("world/lidar/velocities", len(tracks), arrows)

    def _log_wedges(self, kind: str, rays: Floats) -> None:
        ends = WEDGE_M * rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        strips = [strip for corners in ends for strip in _pyramid(corners)]
        self._lane.log_list(f"world/lidar/wedges/{kind}", len(strips), rr.LineStrips3D(strips))


def _pyramid(corners: Floats) -> list[Floats]:
    """Three lines: the edges of a wedge, seen from the sensor, with far corners (4, 3)."""
    origin = np.zeros(3)
    a, b, c, d = corners
    return [np.array([origin, a, b, c, d, a]), np.array([b, origin, c]), np.array([origin, d])]
