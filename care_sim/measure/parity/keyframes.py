"""Engines compared in full scans and pictures of every keyframe of the closed loop's scenarios."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.frames import Frame
from care_sim.core.pinhole import PinholeCamera
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.measure.driven import driven
from care_sim.measure.parity.answers import Millimetres
from care_sim.measure.parity.scenes import AWAY
from care_sim.measure.parity.tally import AgreementCounts, ray_groups
from care_sim.measure.parity.verdicts import Engines, compare
from care_sim.sensors.camera import Picture
from care_sim.sensors.engines import ENGINES, Engine
from care_sim.study.episode_config import EpisodeConfig
from care_sim.world.bullet import NO_BODY

_POLICY = "care"
_BUDGET = 0.1
"""What the car drives by. It decides where the keyframes are; what is compared is the full scan."""


class PictureAgreement:
    """Counts over the pictures that two engines draw: pixels that show another body, and visible
    boxes that end elsewhere.
    """

    def __init__(self) -> None:
        self.pictures = 0
        self.pixels = 0
        self.other_pixels = 0
        self.boxes = 0
        self.other_boxes = 0
        self.in_one_only = 0
        self.widest_px = 0.0

    def compare(
        self, engine: Engine, reference: Engine, cameras: Sequence[PinholeCamera], sensor: Frame
    ) -> None:
        """Take in the pictures of a rig in the frame `sensor`."""
        for camera in cameras:
            window = (0, 0, camera.width, camera.height)
            drawn, expected = (
                which.body_ids(camera, sensor, window) for which in (engine, reference)
            )
            self.pictures += 1
            self.pixels += int(np.count_nonzero(expected != NO_BODY))
            self.other_pixels += int(np.count_nonzero(drawn != expected))
            self._compare_boxes(Picture.of(drawn), Picture.of(expected))

    def _compare_boxes(self, drawn: Picture, expected: Picture) -> None:
        both, one, other = np.intersect1d(drawn.bodies, expected.bodies, return_indices=True)
        apart = np.abs(drawn.boxes[one] - expected.boxes[other])
        self.boxes += len(expected.bodies)
        self.other_boxes += int(np.count_nonzero(apart.any(axis=1)))
        self.in_one_only += len(drawn.bodies) + len(expected.bodies) - 2 * len(both)
        self.widest_px = max(self.widest_px, float(apart.max(initial=0.0)))

    def figures(self) -> dict[str, Any]:
        """The counts."""
        return dict(vars(self))


@dataclass
class KeyframeAgreement:
    """Verdicts on every ray of the full scan, and the pictures of the camera, of every keyframe."""

    rays: AgreementCounts = field(default_factory=AgreementCounts)
    pictures: PictureAgreement = field(default_factory=PictureAgreement)


def keyframes(scenario: str, episodes: int, done: Callable[[int], None]) -> KeyframeAgreement:
    """All keyframes of the first seeds; `done` is called with the number of episodes compared so
    far.
    """
    compared = KeyframeAgreement()
    for seed in range(episodes):
        compare_episode(EpisodeConfig(scenario, _POLICY, _BUDGET, seed), compared)
        done(seed + 1)
    return compared


def compare_episode(config: EpisodeConfig, compared: KeyframeAgreement) -> None:
    """Compare one episode, from its first keyframe to the state after its last. Raises
    InvalidInput for a set-up of several LiDARs: of each the engines are those of one.
    """
    with driven(config) as env:
        env.reset(seed=config.seed)
        loop: ClosedLoop = env.unwrapped.loop  # type: ignore[attr-defined]
        if (count := len(loop.rig.grid.heads)) > 1:
            raise InvalidInput(f"engines are compared with one LiDAR, got {count}")
        ended = False
        with closing(_exact(loop)) as exact:
            bullet = loop.world.bullet
            grid = loop.rig.grid.heads[0].grid
            fast = ENGINES["fast"](bullet, grid)
            reference = ENGINES["bullet"](bullet, grid)
            engines = Engines(fast, reference, exact)
            while True:
                _compare_scans(loop, engines, exact, config.seed, compared.rays)
                compared.pictures.compare(fast, reference, loop.rig.cameras, loop.sensor)
                if ended:
                    break
                _, _, terminated, truncated, _ = env.step(0)
                ended = terminated or truncated


def _exact(loop: ClosedLoop) -> Millimetres:
    """The same bodies, in the order of their ids: the car, which no ray hits, is kept away."""
    world = loop.world
    kinds = [world.ego_kind, *(actor.kind for actor in world.actors)]
    return Millimetres(kinds, loop.rig.grid.heads[0].grid)


def _compare_scans(
    loop: ClosedLoop, engines: Engines, exact: Millimetres, seed: int, tally: AgreementCounts
) -> None:
    world = loop.world
    poses = (actor.pose_at(world.time) for actor in world.actors)
    frames = [AWAY, *(Frame(x, y, 0.0, yaw) for x, y, yaw in poses)]
    exact.place(frames)
    answers = compare(engines, loop.sensor, np.arange(loop.rig.grid.size))
    kinds = [world.ego_kind, *(actor.kind for actor in world.actors)]
    tally.add(answers, ray_groups(kinds, frames), {"seed": seed, "keyframe": loop.index})
