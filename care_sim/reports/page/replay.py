"""An episode played again to be watched: what moved, what was seen and found, and what the policy
knew.

Everything is in the world frame and in the numbers of `care_sim.reports.page.story`.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from care_sim.core.frames import Frame, Pose
from care_sim.core.return_settings import FilmedReturns
from care_sim.core.types import CLASSES
from care_sim.evaluation.recall import CENSORED_AT
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.film import Film
from care_sim.loops.open_loop import OpenLoop
from care_sim.loops.records import Keyframe, Outcome
from care_sim.loops.scene_records import SceneKeyframe
from care_sim.loops.watcher import sought
from care_sim.reports.page.story import CENTI, Known, fullness, whole, whole_poses
from care_sim.reports.page.walls import WALL_M, walls
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.sources.scenes import Scene, Source
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import trace
from care_sim.study.play_config import PlayConfig
from care_sim.study.run_config import Row
from care_sim.study.scene_play import SUMS
from care_sim.study.scene_trace import trace_scene
from care_sim.world.bodies import CATALOGUE

_WAY_STEP_M = 2.0
"""Between two points of the way: on a turn of 7 m the line between them is 7 cm off."""
AWAY, BEYOND, MISSED, FOUND = ".012"
"""How it stands with an object of a film at a keyframe: not annotated, beyond the range that is
scored, not found, found.
"""


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


class Moment(NamedTuple):
    """What there is before a keyframe. Bodies are numbers: of the closed loop their places among
    the actors, of a film those of its objects.
    """

    time_s: float
    place: Pose
    """Of the car."""
    speed_mps: float
    sensor: Frame
    poses: dict[int, Pose]
    """Of the bodies that are there."""
    seen: set[int]
    """Those that the cameras show, of a film those that the policy was shown."""


@dataclass
class Recorder:
    """Watches an episode of either loop. The last moment of the closed loop is after its last
    keyframe.
    """

    moments: list[Moment] = field(default_factory=list)
    known: Known = field(default_factory=Known)
    beliefs: list[dict[str, Any]] = field(default_factory=list)
    rays: list[str] = field(default_factory=list)
    loop: Any = None

    def before(self, loop: ClosedLoop | OpenLoop) -> None:
        """Take down what there is and what is known before the coming keyframe."""
        self.loop = loop
        moment = _of_world(loop) if isinstance(loop, ClosedLoop) else _of_film(loop)
        self.moments.append(moment)
        self.beliefs.append(self.known.at(loop.belief, moment.sensor, loop.rig))

    def after(self, loop: ClosedLoop | OpenLoop, frame: Keyframe | SceneKeyframe) -> None:
        """Take down what the keyframe fired, and what there is before the next."""
        assert frame.fired is not None
        self.rays.append(fullness(frame.fired, loop.rig.grid))
        if isinstance(loop, ClosedLoop) or not loop.over:
            self.before(loop)

    def story(self, bodies: Sequence[int], car_size: Sequence[float]) -> dict[str, Any]:
        """What was recorded, one list per column, with a sign for each of the `bodies`."""
        rig = self.loop.rig
        ego = {
            "size": whole(car_size[:2], CENTI),
            "sensor": whole(rig.sensor_position[:2], CENTI),
            "reach": whole(rig.grid.range_m, CENTI),
        }
        return {
            "ego": ego,
            "time": [whole(moment.time_s, CENTI) for moment in self.moments],
            "place": whole_poses(np.array([moment.place for moment in self.moments])).tolist(),
            "speed": [whole(moment.speed_mps, CENTI) for moment in self.moments],
            "seen": [signs(dict.fromkeys(m.seen, "1"), bodies, "0") for m in self.moments],
            "rays": self.rays,
            "tracked": self.known.tracked,
            **{name: [belief[name] for belief in self.beliefs] for name in self.beliefs[0]},
        }

    def poses(self, body: int) -> list[list[int] | None]:
        """That of a body at every moment, None where it is not there."""
        told = [moment.poses.get(body) for moment in self.moments]
        return [
            None if pose is None else whole_poses(np.array([pose]))[0].tolist() for pose in told
        ]


def signs(given: dict[int, str], bodies: Sequence[int], other: str) -> str:
    """A sign for every body: the `given` one, or the `other`."""
    return "".join(given.get(body, other) for body in bodies)


def _of_world(loop: ClosedLoop) -> Moment:
    world, actors = loop.world, enumerate(loop.world.actors)
    poses = {n: actor.pose_at(world.time) for n, actor in enumerate(world.actors)}
    seen = {n for n, actor in actors if loop.shows(actor.body)}
    return Moment(world.time, world.ego.pose, world.ego_motion.speed, loop.sensor, poses, seen)


def _of_film(loop: OpenLoop) -> Moment:
    shot, (x, y) = loop.shot, loop.film.place
    # The sensor turns with the car and stands `place` before its middle.
    (car,) = shot.sensor.boxes_to_world(np.array([[-x, -y, *[0.0] * 5]]))[:, [0, 1, 6]].tolist()
    boxes = shot.sensor.boxes_to_world(shot.annotations.boxes)[:, [0, 1, 6]].tolist()
    poses = dict(zip(shot.annotations.objects.tolist(), map(tuple, boxes), strict=True))
    seen = {*loop.true_detected_objects().tolist()} - {NO_OBJECT}
    return Moment(shot.time_s, tuple(car), shot.ego.speed, shot.sensor, poses, seen)


def replayed(config: EpisodeConfig | PlayConfig) -> Replay:
    """Play an episode and write down its story."""
    recorder = Recorder()
    if isinstance(config, PlayConfig):
        return _replayed_scene(config, recorder)
    row, keyframes = trace(config, recorder.after, begin=recorder.before)
    world = recorder.loop.world
    bodies = [
        {
            "n": number,
            "kind": actor.kind.name,
            "size": whole(actor.kind.size[:2], CENTI),
            "reported": actor.label is not None,
            "sought": actor in sought(world),
            "poses": recorder.poses(number),
        }
        for number, actor in enumerate(world.actors)
    ]
    # In whole centimetres and milliradians: what moves less stands still in the picture.
    moving = [body for body in bodies if any(pose != body["poses"][0] for pose in body["poses"])]
    standing = [body | {"pose": body.pop("poses")[0]} for body in bodies if body not in moving]
    story = {
        "moving": moving,
        **recorder.story(range(len(bodies)), world.ego_kind.size),
        **_told(recorder.loop, keyframes),
    }
    return Replay(row, standing, story, tuple(Outcome.__dataclass_fields__))


def _told(loop: ClosedLoop, keyframes: Sequence[Keyframe]) -> dict[str, Any]:
    """What the keyframes tell, one column for each thing, and whom the episode is about."""
    world, about = loop.world, sought(loop.world)
    # How it stands with each of them: "0" out of the cameras' view, "1" in it, "2" detected.
    sights = [f.sights if world.meetings else (f,) * len(about) for f in keyframes]
    states = [["2" if one.detected else str(int(one.in_view)) for one in each] for each in sights]
    flags = {"in_view": "in_view", "found": "detected", "brake": "braking"}
    far = [frame.distance_m for frame in keyframes]
    impact = next((frame.impact for frame in keyframes if frame.impact), None)
    hit = impact and {
        "kind": impact.kind,
        "at_front": impact.at_front,
        "speed": whole(impact.speed_mps, CENTI),
    }
    return {
        **{
            key: "".join(str(int(getattr(frame, name))) for frame in keyframes)
            for key, name in flags.items()
        },
        "distance": [whole(metres, CENTI) if np.isfinite(metres) else None for metres in far],
        "contact": next((f.index for f in keyframes if f.impact_speed_mps is not None), None),
        # Whom the strips and distances are of.
        "about": world.first_sighting.kind.name if world.first_sighting else None,
        "sought": [
            (world.actors.index(actor), "".join(each[number] for each in states))
            for number, actor in enumerate(about)
        ],
        "hit": hit,
        "way": _way(loop),
    }


def _way(loop: ClosedLoop) -> list[list[int]] | None:
    """Points of the route from its start to where the LiDAR reaches now, None straight ahead."""
    if loop.world.route is None:
        return None
    along = np.arange(0.0, loop.world.along_m + loop.rig.grid.range_m, _WAY_STEP_M)
    points: list[list[int]] = whole([loop.world.route.pose(float(m))[:2] for m in along], CENTI)
    return points


# A worker plays the policies of a scene in turn.
@lru_cache(maxsize=1)
def _film(source: Source, scene: Scene, returns: FilmedReturns) -> Film:
    return source.film(scene, returns)


def _replayed_scene(config: PlayConfig, recorder: Recorder) -> Replay:
    """The same of a scene. Its world does not react: the bodies are those of the film, for all
    plays, and the walls, which have the number 0.
    """
    film = _film(config.source, config.scene, config.filmed)
    played = trace_scene(config, film, recorder.after, begin=recorder.before)
    about: dict[int, dict[str, Any]] = {}
    for annotations in (shot.annotations for shot in film.shots):
        objects = annotations.objects.tolist()
        for number, label, box in zip(objects, annotations.classes, annotations.boxes, strict=True):
            # An object keeps the size that it has at first: annotated ones breathe.
            about.setdefault(number, {"kind": CLASSES[label], "size": whole(box[3:5], CENTI)})
    numbers = [NO_OBJECT, *sorted(about)]
    bodies = [
        {"n": 0, "kind": "wall", "squares": whole(walls(film), CENTI), "side": whole(WALL_M, CENTI)}
    ]
    bodies += [
        {
            "n": n,
            "object": number,
            **about[number],
            "reported": True,
            "sought": False,
            "poses": recorder.poses(number),
        }
        for n, number in enumerate(numbers[1:], 1)
    ]
    story = recorder.story(numbers, CATALOGUE["ego"].size)
    story |= {
        "moving": [],
        "way": [place[:2] for place in story["place"]],
        **_found(film, played.keyframes, numbers),
        "outcome": asdict(played.score.outcome()),
        "censored": CENSORED_AT,
    }
    return Replay(played.row | asdict(played.score.tally()), bodies, story, SUMS)


def _found(
    film: Film, keyframes: Sequence[SceneKeyframe], numbers: Sequence[int]
) -> dict[str, Any]:
    """How it stands with the objects `numbers` at every keyframe; `entries` are the place among
    them and the keyframe of every first sighting.
    """
    states, entries = [], []
    for frame in keyframes:
        objects = film.shots[frame.index].annotations.objects.tolist()
        told = zip(objects, frame.found, frame.scored, frame.appearing, strict=True)
        given = {}
        for number, found, scored, appears in told:
            given[number] = (FOUND if found else MISSED) if scored else BEYOND
            if appears:
                entries.append([numbers.index(number), frame.index])
        states.append(signs(given, numbers, AWAY))
    return {"states": states, "entries": entries}
