"""A play of the open loop, played again to be watched: the scene from above, who of it was found,
and what the policy knew.

The world does not react, so that the bodies of a scene are those of its film, for all plays. All is
in the world frame and in the numbers of `care_sim.reports.page.story`.
"""

from dataclasses import asdict, dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.return_settings import FilmedReturns
from care_sim.core.types import CLASSES
from care_sim.evaluation.recall import CENSORED_AT, SceneScore
from care_sim.loops.film import Film, Shot
from care_sim.loops.open_loop import OpenLoop
from care_sim.loops.scene_records import SceneKeyframe
from care_sim.reports.page.replay import Replay
from care_sim.reports.page.story import CENTI, Known, fullness, whole, whole_poses
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.sources.scenes import Scene, Source
from care_sim.study.play_config import PlayConfig
from care_sim.study.scene_play import SUMS
from care_sim.study.scene_trace import trace_scene
from care_sim.world.bodies import CATALOGUE

_WALL_M = 0.5
"""Side of the squares in which walls are drawn: a scene has about a thousand."""
_WALL_FROM_M = 0.5
"""Over the road: what returns below is the ground or a kerb."""
AWAY, BEYOND, MISSED, FOUND = ".012"
"""How it stands with an object at a keyframe: not annotated, beyond the range that is scored, not
found, found.
"""


def replayed_scene(config: PlayConfig) -> Replay:
    """Play a scene and write down its story."""
    film = _film(config.source, config.scene, config.filmed)
    bodies = _bodies(film)
    recorder = _SceneRecorder({body["object"]: body["n"] for body in bodies[1:]})
    played = trace_scene(config, film, recorder.after, begin=recorder.before)
    story = {"moving": [], **_told(film), **recorder.story(), **_ending(played.score)}
    row = played.row | asdict(played.score.tally())
    return Replay(row, bodies, story, SUMS)


# A worker plays the policies of a scene in turn.
@lru_cache(maxsize=1)
def _film(source: Source, scene: Scene, returns: FilmedReturns) -> Film:
    return source.film(scene, returns)


def _bodies(film: Film) -> list[dict[str, Any]]:
    """The walls, and every object that the film annotates: class, size, and its pose at every
    keyframe, None where it is not annotated.
    """
    poses: dict[int, list[list[int] | None]] = {}
    about: dict[int, dict[str, Any]] = {}
    for index, shot in enumerate(film.shots):
        annotations = shot.annotations
        places = shot.sensor.boxes_to_world(annotations.boxes)
        labels = annotations.classes.tolist()
        for number, label, box in zip(annotations.objects.tolist(), labels, places, strict=True):
            # An object keeps the size that it has at first: annotated ones breathe.
            size = whole(box[3:5], CENTI)
            about.setdefault(number, {"object": number, "kind": CLASSES[label], "size": size})
            own = poses.setdefault(number, [None] * len(film.shots))
            own[index] = whole_poses(box[None, [0, 1, 6]])[0].tolist()
    usual = {"reported": True, "sought": False}
    walls = {"n": 0, "kind": "wall", "squares": _walls(film), "side": whole(_WALL_M, CENTI)}
    return [
        walls,
        *(
            {"n": n, **about[number], **usual, "poses": poses[number]}
            for n, number in enumerate(sorted(about), 1)
        ),
    ]


def _walls(film: Film) -> list[list[int]]:
    """The corners of all squares in which anything that nobody annotated returns at some keyframe:
    what hides those behind it.
    """
    squares = [np.floor(_standing(shot, film.sensor_height_m) / _WALL_M) for shot in film.shots]
    corners = np.unique(np.concatenate(squares), axis=0) * _WALL_M
    found: list[list[int]] = whole(corners, CENTI)
    return found


def _standing(shot: Shot, height_m: float) -> Floats:
    """(n, 2) world places of returns that are neither on an object nor on the ground."""
    points = shot.cloud.points[shot.cloud.objects == NO_OBJECT]
    # Over the road as the sensor stands on it: of a recording it may slope.
    points = points[points[:, 2] > _WALL_FROM_M - height_m]
    places: Floats = (shot.sensor.origin + shot.sensor.vectors_to_world(points))[:, :2]
    return places


def _told(film: Film) -> dict[str, Any]:
    """What no play changes: the car, its way, and the time of every keyframe."""
    x, y = film.place
    # The sensor turns with the car and stands `place` before its middle.
    frames = [shot.sensor for shot in film.shots]
    car = [frame.boxes_to_world(np.array([[-x, -y, *[0.0] * 5]]))[0] for frame in frames]
    places = whole_poses(np.array(car)[:, [0, 1, 6]])
    ego = {
        "size": whole(np.array(CATALOGUE["ego"].size[:2]), CENTI),
        "sensor": whole([x, y], CENTI),
    }
    return {
        "ego": ego | {"reach": whole(film.grid.range_m, CENTI)},
        "time": [whole(shot.time_s, CENTI) for shot in film.shots],
        "place": places.tolist(),
        "speed": [whole(shot.ego.speed, CENTI) for shot in film.shots],
        "way": places[:, :2].tolist(),
    }


def _ending(score: SceneScore) -> dict[str, Any]:
    outcome = asdict(score.outcome())
    return {"outcome": outcome, "censored": CENSORED_AT}


@dataclass
class _SceneRecorder:
    """Watches a play; `numbers` are those of the bodies, by object."""

    numbers: dict[int, int]
    known: Known = field(default_factory=Known)
    moments: list[dict[str, Any]] = field(default_factory=list)
    rays: list[str] = field(default_factory=list)
    states: list[str] = field(default_factory=list)
    entries: list[list[int]] = field(default_factory=list)

    def before(self, loop: OpenLoop) -> None:
        """Take down what the policy knows when it chooses the cells of the coming keyframe."""
        seen = [self.numbers.get(number, -1) for number in loop.true_detected_objects().tolist()]
        known = self.known.at(loop.belief, loop.shot.sensor, loop.rig)
        self.moments.append(known | {"seen": self._flags({n: "1" for n in seen if n > 0}, "0")})

    def after(self, loop: OpenLoop, frame: SceneKeyframe) -> None:
        """Take down what the keyframe fired and found, and what is known before the next."""
        assert frame.fired is not None
        self.rays.append(fullness(frame.fired, loop.rig.grid))
        objects = loop.film.shots[frame.index].annotations.objects.tolist()
        bodies = [self.numbers[number] for number in objects]
        states = {
            body: FOUND if found and scored else MISSED if scored else BEYOND
            for body, found, scored in zip(bodies, frame.found, frame.scored, strict=True)
        }
        self.states.append(self._flags(states, AWAY))
        new = (body for body, appears in zip(bodies, frame.appearing, strict=True) if appears)
        self.entries.extend([body, frame.index] for body in new)
        if not loop.over:
            self.before(loop)

    def story(self) -> dict[str, Any]:
        """What was recorded, one list per column; `entries` are the body and the keyframe of every
        first sighting.
        """
        columns = {name: [moment[name] for moment in self.moments] for name in self.moments[0]}
        told = {"tracked": self.known.tracked, "rays": self.rays, "states": self.states}
        return {**told, "entries": self.entries, **columns}

    def _flags(self, given: dict[int, str], other: str) -> str:
        """A sign for every body, from the first on, which is the walls."""
        return other + "".join(given.get(body, other) for body in self.numbers.values())
