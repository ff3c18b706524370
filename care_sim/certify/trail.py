"""The trail that an episode leaves: some bytes of a running hash after every stage, which tell the
first stage at which two episodes differ.
"""

import hashlib
import math
from collections.abc import Mapping
from dataclasses import asdict, astuple
from typing import Any

import gymnasium
import numpy as np

from care_sim.base.digests import portable_bytes
from care_sim.certify.design import Drawn
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.evaluation.outcomes import outcome
from care_sim.loops.one_world import OneWorld

CONFIGURATION = "configuration"
OUTCOME = "outcome"
TRAIL_STAGES = (
    "scenario and poses",
    "camera detections",
    "tracks",
    "cells chosen",
    "returns",
    "detections",
)
"""Fields of every keyframe, in order. The configuration comes before the first keyframe, the
outcome after the last.
"""
_CLOSED_LOOP_OUTCOME = (
    "detection_distance_m",
    "undetected_to_m",
    "braked",
    "min_distance_m",
    "clearance_m",
    "collision",
    "impact_speed_mps",
    "rays_fired",
)
"""The fields of the outcome that published trails hold: a later one would change every trail."""
DIGEST_BYTES = 8
STAGE_BYTES = 3
"""By chance one of 16.8 million differences is named a stage late."""


class Trail(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Plays one episode of the list and keeps its trail. The arguments of `reset` and steps after
    the end have no effect.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], episode: Drawn):
        super().__init__(env)
        self._episode = episode
        self._content = hashlib.sha256()
        self._stages = bytearray()
        self._keyframes = 0
        self._reward, self._objects, self._found = 0.0, 0, 0
        self._observation: Any = None
        self.over = False
        """Whether the trail is whole."""

    @property
    def played(self) -> bytes:
        """The trail: `DIGEST_BYTES` of the hash over all, then `STAGE_BYTES` per stage."""
        return self._content.digest()[:DIGEST_BYTES] + bytes(self._stages)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin the episode."""
        # Only the first reset begins the episode.
        if not self._stages:
            self._observation, _ = super().reset(seed=self._episode.seed)
            self._note(self._episode.text)
            self._look(self._observation)
        return self._observation, {}

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Play a keyframe, or none after the end. `info` is empty: vectors cannot stack arrays of
        different budgets.
        """
        if not self.over:
            self._play(action)
        return self._observation, 0.0, False, False, {}

    def _play(self, action: Any) -> None:
        self._observation, reward, terminated, truncated, info = super().step(action)
        self._keyframes += 1
        self._reward += float(reward)
        self._objects += info.get("objects", 0)
        self._found += info.get("found", 0)
        self._act(self._observation, np.asarray(info["fired"], np.int64))
        self.over = terminated or truncated or self._keyframes == self._episode.keyframes
        if self.over:
            gained = self._reward, self._objects, self._found
            self._note(*gained, _outcome(self.env.unwrapped, info), terminated, truncated)
        else:
            self._look(self._observation)

    def _look(self, observation: Any) -> None:
        """Note the first three of `TRAIL_STAGES`, before the policy chooses."""
        loop = self.env.unwrapped.loop  # type: ignore[attr-defined]
        self._note(
            *(_moving(loop) if isinstance(loop, OneWorld) else _filmed(loop)),
            observation["ego"],
        )
        self._note(observation["detections"])
        self._note(observation["tracks"])

    def _act(self, observation: Any, fired: Any) -> None:
        """Note the other three of `TRAIL_STAGES`, after the keyframe."""
        self._note(fired)
        self._note(observation["ranges"].ravel()[fired])
        self._note(*_detected(self.env.unwrapped))

    def _note(self, *parts: Any) -> None:
        # The hash runs on: once two episodes differ, so does every later stage.
        self._content.update(portable_bytes(*parts))
        self._stages += self._content.digest()[-STAGE_BYTES:]


def first_difference(trail: bytes, other: bytes) -> tuple[str, int | None]:
    """The first stage at which two trails differ, and its keyframe, None if it belongs to none."""
    one, two = _stages(trail), _stages(other)
    last = min(len(one), len(two)) - 1
    place = next((n for n in range(last) if one[n] != two[n]), last)

    # The first stage is the configuration, the last the outcome, and between them come those of
    # keyframe after keyframe.
    if place <= 0:
        return CONFIGURATION, None
    if place == last:
        return OUTCOME, None
    keyframe, number = divmod(place - 1, len(TRAIL_STAGES))
    return TRAIL_STAGES[number], keyframe


def _stages(trail: bytes) -> list[bytes]:
    stages = trail[DIGEST_BYTES:]
    return [stages[n : n + STAGE_BYTES] for n in range(0, len(stages), STAGE_BYTES)]


def _outcome(env: Any, info: Mapping[str, Any]) -> tuple[tuple[str, Any], ...]:
    """The outcome of the closed loop by the keyframes so far; that of the open loop, which is empty
    before its end.
    """
    if isinstance(env, ClosedLoopEnv):
        ended = outcome(env.keyframes)
        sums = {name: getattr(ended, name) for name in _CLOSED_LOOP_OUTCOME}
    else:
        sums = asdict(env.score.tally()) if "outcome" in info else {}
    # None has no bytes of its own: NaN stands for it.
    return tuple((name, math.nan if value is None else value) for name, value in sums.items())


def _moving(loop: OneWorld) -> tuple[Any, ...]:
    world = loop.world
    poses = [world.ego.pose, *(actor.pose_at(world.time) for actor in world.actors)]
    return world.time, poses, astuple(world.ego_motion)


def _filmed(loop: Any) -> tuple[Any, ...]:
    shot = loop.shot
    annotations = shot.annotations
    return (
        shot.time_s,
        astuple(shot.sensor),
        astuple(shot.ego),
        annotations.objects,
        annotations.classes,
        annotations.boxes,
    )


def _detected(env: Any) -> tuple[Any, ...]:
    if isinstance(env, ClosedLoopEnv):
        record = env.keyframes[-1]
        sights = np.array([astuple(sight) for sight in record.sights], float)
        return record.detected, record.braking, record.needless, sights
    found = env.keyframes[-1].detections
    return found.classes, found.boxes, found.returns
