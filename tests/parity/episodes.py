"""Engines compared in full scans and pictures of every keyframe, and in whole episodes."""

from contextlib import closing
from dataclasses import fields

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.frames import Frame
from care_sim.evaluation.outcomes import outcome
from care_sim.loops.records import Keyframe
from care_sim.sensors.engines.picture_kernels import visible_boxes
from care_sim.study.designs.paper import paper_study
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import trace
from care_sim.world.bullet import NO_BODY
from tests.bench.environments import driven
from tests.parity.engines import Engines, exact_engine
from tests.parity.rays import RayCounts, compare, ray_groups

ENGINES_PLAYED = ("fast", "bullet")


class PictureCounts:
    """Counts over the pictures that two engines draw: pixels that show another body, and visible
    boxes that end elsewhere.
    """

    def __init__(self):
        self.pictures = self.pixels = self.other_pixels = 0
        self.boxes = self.other_boxes = self.in_one_only = 0
        self.widest_px = 0.0

    def compare(self, engine, reference, cameras, sensor):
        """Take in the pictures of a rig in the frame `sensor`."""
        for camera in cameras:
            window = (0, 0, camera.width, camera.height)
            drawn, expected = (
                which.body_ids(camera, sensor, window) for which in (engine, reference)
            )
            self.pictures += 1
            self.pixels += int(np.count_nonzero(expected != NO_BODY))
            self.other_pixels += int(np.count_nonzero(drawn != expected))
            one, other = visible_boxes(drawn), visible_boxes(expected)
            both, mine, theirs = np.intersect1d(one[:, 0], other[:, 0], return_indices=True)
            apart = np.abs(one[mine, 1:5] - other[theirs, 1:5])
            self.boxes += len(other)
            self.other_boxes += int(np.count_nonzero(apart.any(axis=1)))
            self.in_one_only += len(one) + len(other) - 2 * len(both)
            self.widest_px = max(self.widest_px, float(apart.max(initial=0.0)))


def keyframes(scenario, episodes, done):
    """The rays of the full scan, and the pictures, of all keyframes of the first seeds; `done` is
    called with the number of episodes compared so far.
    """
    rays, pictures = RayCounts(), PictureCounts()
    for seed in range(episodes):
        # The policy that the car drives by decides where the keyframes are.
        compare_episode(EpisodeConfig(scenario, "care", 0.1, seed), rays, pictures)
        done(seed + 1)
    return rays, pictures


def compare_episode(config, rays, pictures):
    """Compare one episode, from its first keyframe to the state after its last. Raises
    InvalidInput for a set-up of several LiDARs: of each the engines are those of one.
    """
    with driven(config) as env:
        env.reset(seed=config.seed)
        loop = env.unwrapped.loop
        world = loop.world
        if (count := len(loop.rig.grid.heads)) > 1:
            raise InvalidInput(f"engines are compared with one LiDAR, got {count}")
        kinds = [world.ego_kind, *(actor.kind for actor in world.actors)]
        # No body of these worlds leans.
        groups = ray_groups(kinds, [Frame(0.0, 0.0, 0.0, 0.0)] * len(kinds))
        engines = Engines.of(world.bullet, loop.rig.grid.heads[0].grid)
        cells = np.arange(loop.rig.grid.size)
        with closing(engines.exact):
            ended = is_last = False
            while not is_last:
                is_last = ended
                name = {"seed": config.seed, "keyframe": loop.index}
                # Asking for the world moves its bodies to this keyframe.
                assert loop.world is world
                rays.add(compare(engines, loop.sensor, cells), groups, name)
                pictures.compare(engines.fast, engines.bullet, loop.rig.cameras, loop.sensor)
                if not ended:
                    _, _, terminated, truncated, _ = env.step(0)
                    ended = terminated or truncated


class OutcomeCounts:
    """Counts of episodes played under both engines, and labels of those that differ, in the outcome
    or at any keyframe. Where the outcomes differ, Bullet in millimetres plays the episode too.
    """

    def __init__(self):
        self.episodes = self.keyframes = 0
        self.other_outcomes, self.other_keyframes, self.other_than_exact = [], [], []

    def compare(self, config):
        """Play an episode under both engines."""
        (_, drawn), (_, expected) = (
            trace(config.changed(engine=engine)) for engine in ENGINES_PLAYED
        )
        self.episodes += 1
        self.keyframes += len(expected)
        # An outcome that differs from Bullet's may be owed to Bullet's tolerance.
        if outcome(drawn) != outcome(expected):
            self.other_outcomes.append(config.label)
            with exact_engine() as engine:
                _, exact = trace(config.changed(engine=engine))
            if outcome(drawn) != outcome(exact):
                self.other_than_exact.append(config.label)
        if len(drawn) != len(expected) or not all(map(_is_same, drawn, expected)):
            self.other_keyframes.append(config.label)


def outcomes(seeds, done):
    """The paper's 49 configurations with seeds from 0; `done` is called with the number of seeds
    compared so far.
    """
    compared = OutcomeCounts()
    for seed in range(seeds):
        for config in paper_study([seed]):
            compared.compare(config)
        done(seed + 1)
    return compared


def _is_same(one, other):
    """Whether two records are the same to the last bit."""
    return all(
        np.array_equal(getattr(one, field.name), getattr(other, field.name))
        for field in fields(Keyframe)
    )
