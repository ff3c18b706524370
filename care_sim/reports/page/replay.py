"""An episode played again to be watched: what moved, what the camera and the LiDAR saw, and what
the policy knew.

Everything is in the world frame and in the numbers of `care_sim.reports.page.story`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from care_sim.core.frames import Pose
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.records import Keyframe, Outcome
from care_sim.loops.watcher import sought
from care_sim.reports.page.story import (
    CENTI,
    Known,
    fullness,
    whole,
    whole_poses,
)
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import trace
from care_sim.study.run_config import Row
from care_sim.world.world import Actor

_WAY_STEP_M = 2.0
"""Between two points of the way: on a turn of 7 m the line between them is 7 cm off."""


@dataclass(frozen=True)
class Replay:
    """A replayed episode: its row, and its story as plain data that `play.js` draws.

    `bodies` are those that stand still, of the open loop all, in a list of their own because many
    episodes share it. `ending` are the columns of the row that say how the episode ended.
    """

    row: Row
    bodies: list[dict[str, Any]]
    story: dict[str, Any]
    ending: tuple[str, ...]


def replayed(config: EpisodeConfig) -> Replay:
    """Play an episode and write down its story."""
    recorder = Recorder()
    row, keyframes = trace(config, recorder.after, begin=recorder.before)
    bodies = recorder.bodies()
    standing = [body for body in bodies if "poses" not in body]
    moving = [body for body in bodies if "poses" in body]
    story = {"moving": moving, **recorder.story(), **_flags(keyframes)}
    return Replay(row, standing, story, tuple(Outcome.__dataclass_fields__))


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
    known: Known = field(default_factory=Known)

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
            self.hit = {
                "kind": frame.impact.kind,
                "at_front": frame.impact.at_front,
                "speed": whole(frame.impact.speed_mps, CENTI),
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
            "size": whole(np.array(self.ego_size[:2]), CENTI),
            "sensor": whole(np.array(self.sensor), CENTI),
            "reach": whole(self.reach, CENTI),
        }
        # How it stands with each at every keyframe, and whom the strips and distances are of.
        about = self.first_sighting.kind.name if self.first_sighting else None
        states = ["".join(each) for each in zip(*self.sights, strict=True)]
        bodies = [self.actors.index(actor) for actor in self.sought]
        about_whom = {"about": about, "sought": [*zip(bodies, states, strict=True)]}
        told = {"hit": self.hit, "way": self.way, **about_whom}
        return {"ego": ego, "tracked": self.known.tracked, "rays": self.rays, **told, **columns}

    def _take(self, loop: ClosedLoop) -> None:
        world = loop.world
        self.poses.append([actor.pose_at(world.time) for actor in self.actors])
        self.moments.append(
            {
                "time": whole(world.time, CENTI),
                "place": whole_poses(np.array([world.ego.pose]))[0].tolist(),
                "speed": whole(world.ego_motion.speed, CENTI),
                **self.known.at(loop.belief, loop.sensor, loop.rig),
                "seen": "".join(str(int(loop.shows(actor.body))) for actor in self.actors),
            }
        )

    def _body(self, number: int, actor: Actor) -> dict[str, Any]:
        poses = whole_poses(np.array([moment[number] for moment in self.poses]))
        about = {
            "n": number,
            "kind": actor.kind.name,
            "size": whole(np.array(actor.kind.size[:2]), CENTI),
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
    points: list[list[int]] = whole([loop.world.route.pose(float(m))[:2] for m in along], CENTI)
    return points


def _flags(keyframes: Sequence[Keyframe]) -> dict[str, Any]:
    """What the keyframes tell, one column for each thing."""
    switches = {"in_view": "in_view", "found": "detected", "brake": "braking"}
    written = {
        key: "".join(str(int(getattr(f, name))) for f in keyframes)
        for key, name in switches.items()
    }
    distances = [
        whole(f.distance_m, CENTI) if np.isfinite(f.distance_m) else None for f in keyframes
    ]
    contact = next((f.index for f in keyframes if f.impact_speed_mps is not None), None)
    return {**written, "distance": distances, "contact": contact}
