"""The open-loop environments: thin Gymnasium adapters around `care_sim.loops.open_loop`."""

from collections.abc import Collection, Mapping
from dataclasses import asdict
from functools import lru_cache
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from care_sim.base.checks import check_arguments, check_choice
from care_sim.base.errors import InvalidInput, shown
from care_sim.base.seeds import streams
from care_sim.core.arrays import Mask
from care_sim.core.cells.stack import Grid
from care_sim.core.conditions import IDEAL_CAMERA, changed_settings
from care_sim.core.grid import Place
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import Action
from care_sim.envs.sensing import Observed, SensingEnv, arguments_of, detector_of, split_conditions
from care_sim.evaluation.recall import SceneScore
from care_sim.evaluation.sightings import ANNOTATED, Sightings, check_presence
from care_sim.loops.episode import SensorSeeds
from care_sim.loops.film import Film
from care_sim.loops.open_loop import OpenLoop, OpenLoopKeyframe, SceneKeyframe
from care_sim.loops.stages.choice import Choice
from care_sim.perception import matching
from care_sim.perception.detectors import PROXY

UNFILMED = ("camera_rotation_sigma_deg", "camera_position_sigma_m", "engine")
"""Conditions that a film cannot take on once it is made."""


class OpenLoopEnv(SensingEnv[OpenLoop]):
    """A filmed scene: the agent chooses the LiDAR's cells, and nothing reacts.

    ### Action and observation
    As in `care_sim.envs.closed_loop.ClosedLoopEnv`, with the cameras of the scene. One policy plays
    both loops.

    ### Reward
    Minus the share of the annotated objects within 50 m that this keyframe does not detect. The
    reward contains truth: a learner may learn from it, but a policy must not read it during play.

    ### Episode end
    Truncated after the last keyframe. `env.unwrapped.score` then holds the result of every
    first-sighting event.

    ### Info
    Entries that a policy may read:

    - `fired`, `intensities`, `times_s`, `time_s`: as in the closed loop

    Entries for scoring alone contain truth. `scoring_info=False` removes all but `outcome`.

    - `objects`: number of annotated objects within 50 m
    - `found`: number of these objects that this keyframe detected
    - `seed`, `scene`: from `reset`; repeat the episode
    - `outcome`: at the end; a dict of `care_sim.evaluation.recall.SceneOutcome`

    ### Arguments
    `budget`, `render_mode`, `secret`, `scoring_info`, `detector` and `detector_parameters` are
    those of the closed loop. `presence`, "annotated" or "visible", decides which objects are
    present at scene start and therefore no newcomers (`care_sim.evaluation.sightings`). The fields
    of `care_sim.core.conditions.Conditions` are arguments too. `engine` and errors of the cameras'
    mount are not, because the film exists before it plays. `min_returns` belongs to the detector
    `returns`. A forbidden value raises `care_sim.InvalidInput`.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 2}  # noqa: RUF012 (Gymnasium's)

    def __init__(
        self,
        grid: Grid,
        cameras: tuple[PinholeCamera, ...],
        position: Place,
        keyframe_s: float,
        setup: str = "",
        *,
        budget: float = 0.10,
        detector: str = PROXY,
        detector_parameters: Mapping[str, object] | None = None,
        presence: str = ANNOTATED,
        render_mode: str | None = None,
        secret: str | bool = False,
        scoring_info: bool = True,
        **parameters: Any,
    ):
        check_choice("render_mode", render_mode, self.metadata["render_modes"])
        check_film_arguments(type(self), parameters)
        check_presence(presence)
        conditions, _ = split_conditions(self.conditions_kind, parameters)
        super().__init__(
            conditions,
            grid=grid,
            cameras=cameras,
            position=position,
            budget=budget,
            keyframe_s=keyframe_s,
            secret=secret,
            scoring_info=scoring_info,
            setup=setup,
        )
        self._detector = detector_of(detector, detector_parameters, conditions, self.rig)
        self.metadata = {**self.metadata, "render_fps": 1 / keyframe_s}
        self.render_mode = render_mode
        self.presence = presence
        self.keyframes: list[OpenLoopKeyframe] = []
        self._masks: list[Mask] = []
        self._choice = Choice([self.rig], conditions)

    @property
    def score(self) -> SceneScore:
        """The detected objects of the scene; complete once the episode is over."""
        return SceneScore.of(self._sightings, self._masks)

    @property
    def last(self) -> SceneKeyframe:
        """The last keyframe, with what it found; before the first scan the coming one, without a
        record. Truth: for scoring and people.
        """
        record = self.keyframes[-1] if self.keyframes else None
        index, seen = record.index if record else 0, self._sightings
        shot = self.loop.film.shots[index]
        found = self._masks[-1] if record else np.zeros(len(shot.annotations), np.bool_)
        return SceneKeyframe(shot.time_s, record, found, seen.scored(index), seen.appearing(index))

    def _start(self, film: Film, seed: int) -> tuple[Observed, dict[str, Any]]:
        """Begin an episode over a film.

        Camera faults, noise and floor have independent streams, which the scene's name and the seed
        decide.
        """
        # By name: recorded scenes are all played with one seed, and should not share their faults.
        if film.detected and self.conditions.camera_profile != IDEAL_CAMERA:
            raise InvalidInput(
                "camera_profile must be ideal where the camera's detections come from a file: "
                "a detector made them, with its own errors"
            )
        entropy = seed, crc32(film.name.encode())
        camera, lidar, floor, odometry, luck = streams(entropy, 5, self._secret)
        self._sightings = _sightings(film, self.presence)
        self.keyframes = []
        self._masks = []
        seeds = SensorSeeds(camera, lidar, odometry, luck)
        loop = OpenLoop(film, self.rig, self.conditions, seeds, self._detector)
        info = {"seed": seed, "scene": film.name} if self.scoring_info else {}
        self._begin(loop)
        self._choice.begin(0, floor)
        return loop.belief.to_observation(), info

    def step(self, action: Action) -> tuple[Observed, float, bool, bool, dict[str, Any]]:
        """Fire the cells that `action` scores highest and advance to the next keyframe.

        Raises InvalidInput for an action of the wrong shape or with values that are not finite, and
        gymnasium.error.ResetNeeded before `reset` and after the end.
        """
        loop = self.loop
        counts, cells = self._fired(action)
        fired = cells[0, : counts[0]].copy()
        shot = loop.shot
        record = loop.keyframe(fired)
        found = matching.found_objects(shot.annotations, record.detections)
        self.keyframes.append(record)
        self._masks.append(found)
        scored = found[self._sightings.scored(record.index)]
        self._over = loop.over
        scan = {"fired": fired, **loop.told}
        # Without the floor as lists: Gymnasium's vectors stack arrays of one length.
        info: dict[str, Any] = {
            name: values.copy() if self.conditions.floor else values.tolist()
            for name, values in scan.items()
        }
        info["time_s"] = shot.time_s
        if self.scoring_info:
            info |= {"objects": len(scored), "found": int(scored.sum())}
        if self._over:
            info["outcome"] = asdict(self.score.outcome())
        # A keyframe without annotated objects misses none of them.
        reward = float(scored.mean()) - 1.0 if len(scored) else 0.0
        return loop.belief.to_observation(), reward, False, self._over, info

    def render(self) -> NDArray[np.uint8] | None:
        """A picture (H, W, 3) of the last keyframe from above.

        It shows who was found, what returned and what fired.
        """
        # Imported here because most environments draw nothing.
        from care_sim.viewer.pictures.keyframe import draw_keyframe
        from care_sim.viewer.pictures.scene_view import scene_view

        if self.render_mode is None:
            return None
        return np.asarray(draw_keyframe(scene_view(self.loop, [self.last])))


class FilmEnv(OpenLoopEnv):
    """The open loop over a film that is there already.

    `care_sim.study` plays all policies of a scene in it.
    """

    def __init__(self, film: Film, **parameters: Any):
        if not isinstance(film, Film):
            raise InvalidInput(f"film must be a care_sim.loops.film.Film, got {shown(film)}")
        self.film = film
        super().__init__(film.grid, film.cameras, film.position, film.keyframe_s, **parameters)
        for name in changed_settings(self.conditions.filmed, film.returns):
            raise InvalidInput(
                f"{name} cannot be changed of the film {film.name}, which was made with "
                f"{getattr(film.returns, name)}"
            )
        if self.conditions.filmed.most_shots > film.returns.most_shots:
            raise InvalidInput(
                f"firing {self.conditions.firing} cannot be played on the film {film.name}: it "
                f"holds what returns to {film.returns.most_shots} shots of a cell at most"
            )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observed, dict[str, Any]]:
        """Begin the scene anew. `info` holds what repeats the episode; there are no `options`."""
        return self._start(self.film, self._entropy(seed, options))


def check_film_arguments(kind: type[OpenLoopEnv], parameters: Collection[str]) -> None:
    """Raise InvalidInput for a name that a class of environments does not take."""
    for name in UNFILMED:
        if name in parameters:
            raise InvalidInput(
                f"{name} is no argument of the open loop: its films are made without"
            )
    known = [name for name in arguments_of(kind) if name not in UNFILMED]
    check_arguments(kind.__name__, parameters, known)


# All policies of a scene play one film, whose sightings are the same for all.
@lru_cache(maxsize=1)
def _sightings(film: Film, presence: str) -> Sightings:
    return Sightings.of(
        film.name, [shot.annotations for shot in film.shots], hidden=film.hidden, presence=presence
    )
