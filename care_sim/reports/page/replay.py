"""An episode played again to be watched: what moved, what the camera and the LiDAR saw, and what
the policy knew.

Everything is in the world frame and in whole numbers, lengths in centimetres and angles in
milliradians, so that an episode takes a few kilobytes.
"""

import base64
import json
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.core.arrays import Floats, Mask
from care_sim.core.frames import Pose
from care_sim.core.grid import Cells
from care_sim.core.grid_stack import Grid
from care_sim.core.residual import explained
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES, ImageDetections
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.records import Keyframe
from care_sim.loops.watcher import sought
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import trace
from care_sim.study.run_config import Row
from care_sim.world.world import Actor

SECTORS = 128
"""Sectors in which fired cells are counted, from azimuth -pi on."""
_DIGITS = "0123456789abcdefghijklmnopqrstuvwxyz"
"""The digits that say how full a sector is, from none of its cells to all of them."""
_WAY_STEP_M = 2.0
"""Between two points of the way: on a turn of 7 m the line between them is 7 cm off."""
_CENTI = 100
_MILLI = 1000


@dataclass(frozen=True)
class Replay:
    """A replayed episode: its row, and its story as plain data that `play.js` draws.

    `bodies` are those that stand still, in a list of their own because many episodes share it.
    """

    row: Row
    bodies: list[dict[str, Any]]
    story: dict[str, Any]


def replayed(config: EpisodeConfig) -> Replay:
    """Play an episode and write down its story."""
    recorder = Recorder()
    row, keyframes = trace(config, recorder.after, begin=recorder.before)
    bodies = recorder.bodies()
    standing = [body for body in bodies if "poses" not in body]
    moving = [body for body in bodies if "poses" in body]
    return Replay(row, standing, {"moving": moving, **recorder.story(), **_flags(keyframes)})


def packed(story: dict[str, Any]) -> str:
    """Plain data as deflated JSON in base64."""
    return base64.b64encode(
        zlib.compress(json.dumps(story, separators=(",", ":")).encode(), 9)
    ).decode()


@dataclass
class Recorder:
    """Watches an episode.

    A moment is what there is before a keyframe; the last one is after the last keyframe.
    """

    actors: Sequence[Actor] = ()
    sought: Sequence[Actor] = ()
    first_sighting: Actor | None = None
    ego_size: tuple[float, ...] = ()
    sensor: tuple[float, ...] = ()
    reach: float = 0.0
    poses: list[list[Pose]] = field(default_factory=list)
    moments: list[dict[str, Any]] = field(default_factory=list)
    rays: list[str] = field(default_factory=list)
    sights: list[list[str]] = field(default_factory=list)
    hit: dict[str, Any] | None = None
    way: list[list[int]] | None = None
    tracked: dict[int, list[Any]] = field(default_factory=dict)

    def before(self, loop: ClosedLoop) -> None:
        """Take down the world and the belief at the start."""
        self.actors = loop.world.actors
        self.sought = sought(loop.world)
        self.first_sighting = loop.world.first_sighting
        self.ego_size = loop.world.ego_kind.size
        self.sensor = loop.rig.sensor_position[:2]
        self.reach = loop.rig.grid.range_m
        self._take(loop)

    def after(self, loop: ClosedLoop, frame: Keyframe) -> None:
        """Take down what a keyframe fired, and what there is after it."""
        self.rays.append(fullness(frame.fired, loop.rig.grid))
        self.sights.append(_sights(loop, frame))
        if frame.impact:
            kinds = {actor.body: actor.kind.name for actor in self.actors}
            self.hit = {
                "kind": kinds[frame.impact.body],
                "at_front": frame.impact.at_front,
                "speed": _whole(frame.impact.speed_mps, _CENTI),
            }
        self._take(loop)
        self.way = _way(loop)

    def bodies(self) -> list[dict[str, Any]]:
        """Name, class, size and place of every body; `poses` of those that move."""
        return [self._body(number, actor) for number, actor in enumerate(self.actors)]

    def story(self) -> dict[str, Any]:
        """What was recorded, one list per column."""
        columns = {name: [moment[name] for moment in self.moments] for name in self.moments[0]}
        ego = {
            "size": _whole(np.array(self.ego_size[:2]), _CENTI),
            "sensor": _whole(np.array(self.sensor), _CENTI),
            "reach": _whole(self.reach, _CENTI),
        }
        # How it stands with each at every keyframe, and whom the strips and distances are of.
        about = self.first_sighting.kind.name if self.first_sighting else None
        states = ["".join(each) for each in zip(*self.sights, strict=True)]
        bodies = [self.actors.index(actor) for actor in self.sought]
        whole = {"about": about, "sought": [*zip(bodies, states, strict=True)]}
        told = {"hit": self.hit, "way": self.way, **whole}
        return {"ego": ego, "tracked": self.tracked, "rays": self.rays, **told, **columns}

    def _take(self, loop: ClosedLoop) -> None:
        world = loop.world
        tracks = loop.belief.tracks
        self.poses.append([actor.pose_at(world.time) for actor in self.actors])
        places = loop.sensor.boxes_to_world(tracks.boxes)
        # Tracks move on the ground: their velocities have no vertical part.
        moves = loop.sensor.vectors_to_world(
            np.column_stack([tracks.velocities, np.zeros(len(tracks))])
        )
        # Class and size once per track, as they were last: the story repeats only what moves.
        for track, label, box in zip(
            tracks.ids.tolist(), tracks.classes.tolist(), places, strict=True
        ):
            self.tracked[track] = [CLASSES[label], *_whole(box[3:5], _CENTI)]
        columns = [
            tracks.ids[:, None],
            _poses(places[:, [0, 1, 6]]),
            _whole_array(moves[:, :2], _CENTI),
        ]
        self.moments.append(
            {
                "time": _whole(world.time, _CENTI),
                "place": _poses(np.array([world.ego.pose]))[0].tolist(),
                "speed": _whole(loop.world.ego_motion.speed, _CENTI),
                # Of every track its id, place, velocity, and whether it was missed and is drawn
                # from its forecast.
                "tracks": np.column_stack([*columns, tracks.misses > 0]).tolist(),
                "camera": sightlines(
                    loop.belief.detections,
                    explained(loop.belief.detections, tracks, loop.rig),
                    loop.rig,
                ),
                "seen": "".join(str(int(loop.shows(actor.body))) for actor in self.actors),
            }
        )

    def _body(self, number: int, actor: Actor) -> dict[str, Any]:
        poses = _poses(np.array([moment[number] for moment in self.poses]))
        about = {
            "n": number,
            "kind": actor.kind.name,
            "size": _whole(np.array(actor.kind.size[:2]), _CENTI),
            "reported": actor.label is not None,
            "sought": actor in self.sought,
        }
        # In whole centimetres and milliradians: what moves less stands still in the picture.
        still = bool((poses == poses[0]).all())
        return about | ({"pose": poses[0].tolist()} if still else {"poses": poses.tolist()})


def _sights(loop: ClosedLoop, frame: Keyframe) -> list[str]:
    """How it stands with everybody whom the episode is about: "0" out of the cameras' view, "1" in
    it, "2" detected.
    """
    if loop.world.meetings:
        seen = [(one.in_view, one.detected) for one in frame.sights]
    else:
        seen = [(frame.in_view, frame.detected) for _ in sought(loop.world)]
    return ["2" if detected else str(int(in_view)) for in_view, detected in seen]


def _way(loop: ClosedLoop) -> list[list[int]] | None:
    """Points of the route from its start to where the LiDAR reaches now, None straight ahead."""
    if loop.world.route is None:
        return None
    along = np.arange(0.0, loop.world.along_m + loop.rig.grid.range_m, _WAY_STEP_M)
    points: list[list[int]] = _whole([loop.world.route.pose(float(m))[:2] for m in along], _CENTI)
    return points


def fullness(fired: Cells, grid: Grid) -> str:
    """How much of every sector fires, one digit per sector."""
    # A cell that was fired several times is as full as one that was fired once.
    once = np.unique(fired)
    counts, cells = np.zeros((2, SECTORS), np.int64)
    lidars = grid.lidars_of(once)
    for number, head in enumerate(grid.heads):
        own = head.grid
        sectors = np.floor((own.azimuths + np.pi) / (2 * np.pi) * SECTORS).astype(np.int64)
        # Cells are numbered row by row, so that the remainder is the column.
        columns = once[lidars == number] % own.columns
        counts += np.bincount(sectors[columns], minlength=SECTORS)
        cells += np.bincount(sectors, minlength=SECTORS) * own.rows
    cells = np.maximum(cells, 1)
    return "".join(
        _DIGITS[round(digit)] for digit in (counts / cells * (len(_DIGITS) - 1)).tolist()
    )


def sightlines(detections: ImageDetections, known: Mask, rig: Rig) -> list[list[int]]:
    """The left and right azimuth of every camera box in the sensor frame, and 1 where a track
    explains it.
    """
    lines = []
    for number, (left, _, right, _) in enumerate(detections.boxes.tolist()):
        camera = rig.cameras[int(detections.cameras[number])]
        # The azimuths at mid-height. Since an old picture was taken the car has turned; in the
        # sensor frame of now its boxes are turned the other way.
        ends = camera.rays(np.array([[left, camera.height / 2], [right, camera.height / 2]]))
        azimuths = np.arctan2(ends[:, 1], ends[:, 0]) - detections.yaw_changes[number]
        lines.append([*_whole(azimuths, _MILLI), int(known[number])])
    return lines


def _flags(keyframes: Sequence[Keyframe]) -> dict[str, Any]:
    """What the keyframes tell, one column for each thing."""
    switches = {"in_view": "in_view", "found": "detected", "brake": "braking"}
    written = {
        key: "".join(str(int(getattr(f, name))) for f in keyframes)
        for key, name in switches.items()
    }
    distances = [
        _whole(f.distance_m, _CENTI) if np.isfinite(f.distance_m) else None for f in keyframes
    ]
    contact = next((f.index for f in keyframes if f.impact_speed_mps is not None), None)
    return {**written, "distance": distances, "contact": contact}


def _poses(poses: Floats) -> NDArray[np.int64]:
    """Places in centimetres and headings in milliradians, (n, 3)."""
    return _whole_array(poses * (_CENTI, _CENTI, _MILLI), 1)


def _whole_array(values: Floats, scale: int) -> NDArray[np.int64]:
    return np.rint(values * scale).astype(np.int64)


def _whole(values: Any, scale: int) -> Any:
    return _whole_array(np.asarray(values, float), scale).tolist()
