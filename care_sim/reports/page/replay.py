"""An episode played again to watch: motions, detections, and the policy's knowledge.

Everything is in the world frame and in the numbers of `care_sim.reports.page.story`.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from care_sim.core.conditions import FilmedReturns
from care_sim.core.types import CLASSES
from care_sim.evaluation.recall import CENSORED_AT
from care_sim.loops.film import Film
from care_sim.loops.one_world import OneWorld
from care_sim.loops.open_loop import OpenLoop, SceneKeyframe
from care_sim.loops.records import Keyframe, Outcome
from care_sim.loops.watcher import sought
from care_sim.reports.page.story import CENTI, fullness, known_before, whole, whole_pose
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.sources.scenes import Scene, Source
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import trace
from care_sim.study.play_config import PlayConfig
from care_sim.study.run_config import Row
from care_sim.study.scene_play import SUMS, trace_scene
from care_sim.world.bodies import CATALOGUE

_WAY_STEP_M = 2.0
"""Between two points of the way: on a turn of 7 m the line between them is 7 cm off."""
_AWAY, _BEYOND, _MISSED, _FOUND = ".012"
"""States of a film's object at a keyframe: not annotated, beyond the scored range, not detected,
detected.
"""
_WALL_M = 0.5
"""Side of the squares in which walls are drawn: a scene has about a thousand."""
_WALL_FROM_M = 0.5
"""Over the road: what returns below is the ground or a kerb."""


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


class Recorder:
    """Watches an episode of either loop. The last moment of the closed loop is after its last
    keyframe.

    Bodies are numbers: of the closed loop their places among the actors, of a film those of its
    objects.
    """

    def __init__(self) -> None:
        self.loop: Any = None
        self._columns: dict[str, list[Any]] = {"rays": []}
        self._tracked: dict[int, list[Any]] = {}
        self._poses: list[dict[int, list[int]]] = []
        self._seen: list[set[int]] = []

    def before(self, loop: OneWorld | OpenLoop) -> None:
        """Record the bodies and the policy's knowledge before the next keyframe."""
        self.loop = loop
        read: Any = _of_world if isinstance(loop, OneWorld) else _of_film
        moment, poses, seen = read(loop)
        self._poses.append({body: whole_pose(pose) for body, pose in poses.items()})
        self._seen.append(seen)
        sensor = loop.sensor if isinstance(loop, OneWorld) else loop.shot.sensor
        moment |= known_before(loop.belief, sensor, loop.rig, self._tracked)
        for name, value in moment.items():
            self._columns.setdefault(name, []).append(value)

    def after(self, loop: OneWorld | OpenLoop, frame: Keyframe | SceneKeyframe) -> None:
        """Record the fired cells of the keyframe, and the bodies before the next."""
        assert frame.fired is not None
        self._columns["rays"].append(fullness(frame.fired, loop.rig.grid))
        if isinstance(loop, OneWorld) or not loop.over:
            self.before(loop)

    def story(self, bodies: Sequence[int], car_size: Sequence[float]) -> dict[str, Any]:
        """Return the recording, one list per column, with a sign for each of the `bodies`."""
        rig = self.loop.rig
        ego = {
            "size": whole(car_size[:2], CENTI),
            "sensor": whole(rig.sensor_position[:2], CENTI),
            "reach": whole(rig.grid.range_m, CENTI),
        }
        seen = ["".join("01"[body in each] for body in bodies) for each in self._seen]
        return {"ego": ego, "seen": seen, "tracked": self._tracked, **self._columns}

    def poses(self, body: int) -> list[list[int] | None]:
        """Return the pose of a body at every moment, None where it is not there."""
        return [poses.get(body) for poses in self._poses]


def _of_world(loop: OneWorld) -> tuple[dict[str, Any], dict[int, Any], set[int]]:
    """The moment, the poses of the bodies that are there, and which of them the cameras show."""
    world, actors = loop.world, [*enumerate(loop.world.actors)]
    poses = {n: actor.pose_at(world.time) for n, actor in actors}
    seen = {n for n, actor in actors if loop.shows(actor.body)}
    return _moment(world.time, world.ego.pose, world.ego_motion.speed), poses, seen


def _of_film(loop: OpenLoop) -> tuple[dict[str, Any], dict[int, Any], set[int]]:
    """The same of a film, and which of its objects the policy was shown."""
    shot, (x, y) = loop.shot, loop.film.place
    # The sensor turns with the car and stands `place` before its middle.
    (car,) = shot.sensor.boxes_to_world(np.array([[-x, -y, *[0.0] * 5]]))[:, [0, 1, 6]]
    boxes = shot.sensor.boxes_to_world(shot.annotations.boxes)[:, [0, 1, 6]]
    poses = dict(zip(shot.annotations.objects.tolist(), boxes, strict=True))
    seen = {*loop.true_detected_objects().tolist()} - {NO_OBJECT}
    return _moment(shot.time_s, car, shot.ego.speed), poses, seen


def _moment(time_s: float, car: Sequence[float], speed_mps: float) -> dict[str, Any]:
    return {
        "time": whole(time_s, CENTI),
        "place": whole_pose(car),
        "speed": whole(speed_mps, CENTI),
    }


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
    story = recorder.story(range(len(bodies)), world.ego_kind.size)
    story |= {"moving": moving, **_keyframe_columns(recorder.loop, keyframes)}
    return Replay(row, standing, story, tuple(Outcome.__dataclass_fields__))


def _keyframe_columns(loop: OneWorld, keyframes: Sequence[Keyframe]) -> dict[str, Any]:
    """Return the keyframes as columns, and whom the episode is about."""
    world, about = loop.world, sought(loop.world)

    def flags(read: Callable[[Any], bool]) -> str:
        return "".join(str(int(read(frame))) for frame in keyframes)

    # State of each actor: "0" out of the cameras' view, "1" in it, "2" detected.
    sights = [f.sights if world.meetings else (f,) * len(about) for f in keyframes]
    states = [["2" if one.detected else str(int(one.in_view)) for one in each] for each in sights]
    far = [frame.distance_m for frame in keyframes]
    impact = next((frame.impact for frame in keyframes if frame.impact), None)
    return {
        "in_view": flags(lambda frame: frame.in_view),
        "found": flags(lambda frame: frame.detected),
        "brake": flags(lambda frame: frame.braking),
        "distance": [whole(metres, CENTI) if np.isfinite(metres) else None for metres in far],
        "contact": next((f.index for f in keyframes if f.impact_speed_mps is not None), None),
        # Whom the strips and distances are of.
        "about": world.first_sighting.kind.name if world.first_sighting else None,
        "sought": [
            (world.actors.index(actor), "".join(each[number] for each in states))
            for number, actor in enumerate(about)
        ],
        "hit": impact
        and {
            "kind": impact.kind,
            "at_front": impact.at_front,
            "speed": whole(impact.speed_mps, CENTI),
        },
        "way": _way(loop),
    }


def _way(loop: OneWorld) -> list[list[int]] | None:
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
    bodies: list[dict[str, Any]] = [
        {"n": 0, "kind": "wall", "squares": _walls(film), "side": whole(_WALL_M, CENTI)}
    ]
    for n, number in enumerate(numbers[1:], 1):
        body = {"n": n, "object": number, "reported": True, "sought": False}
        bodies.append(body | about[number] | {"poses": recorder.poses(number)})
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
    """Return the states of the objects `numbers` at every keyframe. `entries` are the place among
    them and the keyframe of every first sighting.
    """
    states, entries = [], []
    for frame in keyframes:
        objects = film.shots[frame.index].annotations.objects.tolist()
        told = zip(objects, frame.found, frame.scored, frame.appearing, strict=True)
        given = {}
        for number, found, scored, appears in told:
            given[number] = (_FOUND if found else _MISSED) if scored else _BEYOND
            if appears:
                entries.append([numbers.index(number), frame.index])
        states.append("".join(given.get(number, _AWAY) for number in numbers))
    return {"states": states, "entries": entries}


def _walls(film: Film) -> Any:
    """(n, 2) the corners of all squares in which anything that nobody annotated returns at some
    keyframe: what hides those behind it.
    """
    squares = []
    for shot in film.shots:
        points = shot.cloud.points[shot.cloud.objects == NO_OBJECT]
        # Over the road as the sensor stands on it: of a recording it may slope.
        points = points[points[:, 2] > _WALL_FROM_M - film.sensor_height_m]
        places = shot.sensor.origin + shot.sensor.vectors_to_world(points)
        squares.append(np.floor(places[:, :2] / _WALL_M))
    return whole(np.unique(np.concatenate(squares), axis=0) * _WALL_M, CENTI)
