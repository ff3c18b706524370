"""Where a keyframe's time goes."""

import time
from contextlib import ExitStack

from care_sim.core.belief import Belief
from care_sim.driving.braking import BrakingController
from care_sim.measure.bench.driven import Environment, driven
from care_sim.measure.bench.timing import timed
from care_sim.perception.proxy import ReturnsDetector
from care_sim.perception.tracker import TrackMemory
from care_sim.sensors.camera import CameraDetector, Picture
from care_sim.sensors.engines.bullet import Bullet
from care_sim.sensors.engines.fast import Fast
from care_sim.sensors.lidar import Lidar
from care_sim.study.episode_config import EpisodeConfig
from care_sim.world.world import World

POLICY, REST, WHOLE = "policy + allocation", "the rest", "whole keyframe"
STAGES: dict[str, tuple[tuple[type, str], ...]] = {
    "camera": (
        (Bullet, "body_ids"),
        (Fast, "body_ids"),
        (Picture, "of"),
        (CameraDetector, "detect"),
    ),
    "cast": ((Lidar, "fire"),),
    "detect": ((ReturnsDetector, "detect"),),
    "track": ((TrackMemory, "update"), (TrackMemory, "predict"), (TrackMemory, "tracks")),
    "control": ((BrakingController, "command"),),
    "world step": ((World, "advance"),),
    "observation": ((Belief, "to_observation"),),
}
"""The callables that make up each stage of a keyframe; none of them calls another."""


def stages(config: EpisodeConfig) -> dict[str, float]:
    """Mean milliseconds per keyframe of every stage over one episode; `REST` is what no stage
    holds, `WHOLE` the sum.
    """
    with driven(config) as env, ExitStack() as watches:
        env.reset(seed=config.seed)
        measured = {POLICY: ((type(env.policy), "__call__"),), **STAGES}
        calls = {
            name: [watches.enter_context(timed(*part)) for part in parts]
            for name, parts in measured.items()
        }
        whole, keyframes = _to_the_end(env)
    spent = {name: sum(map(sum, parts)) for name, parts in calls.items()}
    spent |= {REST: whole - sum(spent.values()), WHOLE: whole}
    return {name: 1e3 * seconds / keyframes for name, seconds in spent.items()}


def _to_the_end(env: Environment) -> tuple[float, int]:
    """Seconds and keyframes until the episode ends."""
    started, keyframes, ended = time.perf_counter(), 0, False
    while not ended:
        _, _, terminated, truncated, _ = env.step(0)
        keyframes, ended = keyframes + 1, terminated or truncated
    return time.perf_counter() - started, keyframes
