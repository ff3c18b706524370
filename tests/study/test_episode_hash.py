"""What the hash of an episode is made of."""

import hashlib

import gymnasium
import numpy as np

import care_sim  # noqa: F401 (registers the environments)
from care_sim.base.digests import portable_bytes
from care_sim.study.episode_play import EpisodeHash


def test_the_hash_holds_cells_ranges_and_the_pose_of_everybody_at_every_keyframe():
    env = gymnasium.make("CARE-Drive-v0", budget=0.01)
    env.reset(seed=2)
    found, content = EpisodeHash(), hashlib.sha256()
    for _ in range(3):
        observation, *_, info = env.step(np.zeros((32, 512), np.float32))
        world = env.unwrapped.loop.world
        bodies = [world.ego_body, *(actor.body for actor in world.actors)]
        found.add(info["fired"], observation["ranges"], world.boxes_of(np.array(bodies)))
        poses = [world.ego.pose, *(actor.pose_at(world.time) for actor in world.actors)]
        content.update(portable_bytes(info["fired"], observation["ranges"], poses))
    env.close()
    assert found.hexdigest() == content.hexdigest()[:16]
