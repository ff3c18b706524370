"""Engines compared in full scans and pictures of every keyframe of the closed loop's scenarios."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field

import numpy as np

from care_sim.core.frames import Frame
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.measure.driven import driven
from care_sim.measure.parity.answers import Millimetres
from care_sim.measure.parity.pictures import Pictures
from care_sim.measure.parity.scenes import AWAY
from care_sim.measure.parity.tally import AgreementCounts, groups
from care_sim.measure.parity.verdicts import Engines, compare
from care_sim.sensors.engines import ENGINES
from care_sim.study.episode_config import EpisodeConfig

POLICY, BUDGET = "care", 0.1
"""They drive the car; what is compared is the full scan."""


@dataclass
class Compared:
    """Verdicts on every ray of the full scan, and the pictures of the camera, of every keyframe."""

    rays: AgreementCounts = field(default_factory=AgreementCounts)
    pictures: Pictures = field(default_factory=Pictures)


def keyframes(scenario: str, episodes: int, done: Callable[[int], None]) -> Compared:
    """All keyframes of the first seeds; `done` hears how many episodes are compared."""
    compared = Compared()
    for seed in range(episodes):
        compare_episode(EpisodeConfig(scenario, POLICY, BUDGET, seed), compared)
        done(seed + 1)
    return compared


def compare_episode(config: EpisodeConfig, compared: Compared) -> None:
    """Compare one episode, from its first keyframe to the state after its last."""
    with driven(config) as env:
        env.reset(seed=config.seed)
        loop, ended = env.unwrapped.loop, False  # type: ignore[attr-defined]
        with closing(_exact(loop)) as exact:
            bullet, grid = loop.world.bullet, loop.rig.grid
            fast, reference = ENGINES["fast"](bullet, grid), ENGINES["bullet"](bullet, grid)
            while True:
                _compare_scans(
                    loop, Engines(fast, reference, exact), exact, config.seed, compared.rays
                )
                compared.pictures.compare(fast, reference, loop.rig.cameras, loop.sensor)
                if ended:
                    break
                _, _, terminated, truncated, _ = env.step(0)
                ended = terminated or truncated


def _exact(loop: ClosedLoop) -> Millimetres:
    """The same bodies, in the order of their ids: the car, which no ray hits, is kept away."""
    world = loop.world
    return Millimetres([world.ego_kind, *(actor.kind for actor in world.actors)], loop.rig.grid)


def _compare_scans(
    loop: ClosedLoop, engines: Engines, exact: Millimetres, seed: int, tally: AgreementCounts
) -> None:
    world = loop.world
    poses = (actor.pose_at(world.time) for actor in world.actors)
    frames = [AWAY, *(Frame(x, y, 0.0, yaw) for x, y, yaw in poses)]
    exact.place(frames)
    answers = compare(engines, loop.sensor, np.arange(loop.rig.grid.size))
    kinds = [world.ego_kind, *(actor.kind for actor in world.actors)]
    tally.add(answers, groups(kinds, frames), {"seed": seed, "keyframe": loop.index})
