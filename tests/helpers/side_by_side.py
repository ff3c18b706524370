"""Single environments side by side, and the tables of a batch filled from them keyframe by
keyframe: what a stage makes of the tables is held to what the single loop did.
"""

import gymnasium
import numpy as np

import care_sim
from care_sim.batch.state import BatchState, Fired, filled


class SideBySide:
    """Environments of `CARE-{name}-v0`, one a seed, played by `policy`."""

    def __init__(self, name, seeds, policy="care", **arguments):
        self.envs = [gymnasium.make(f"CARE-{name}-v0", **arguments).unwrapped for _ in seeds]
        self.policies = [care_sim.make_policy(policy, env) for env in self.envs]
        self.observations = [
            env.reset(seed=seed)[0] for env, seed in zip(self.envs, seeds, strict=True)
        ]
        self.state = BatchState(len(seeds))
        self.state.live[:] = True
        self.conditions, self.rig = self.envs[0].conditions, self.envs[0].rig
        self.fill()

    @property
    def loops(self):
        return [env.loop for env in self.envs]

    def fired(self):
        """The actions of the coming keyframe, and what they fire."""
        actions = [
            policy(seen) for policy, seen in zip(self.policies, self.observations, strict=True)
        ]
        rows = [env.would_fire(action) for env, action in zip(self.envs, actions, strict=True)]
        cells = np.zeros((len(rows), max(map(len, rows))), np.int64)
        for row, own in zip(cells, rows, strict=True):
            row[: len(own)] = own
        return actions, Fired(np.array([len(own) for own in rows]), cells)

    def step(self, actions):
        """Play the keyframe in all that are live, and fill the tables of the next one."""
        infos = [{}] * len(self.envs)
        for n in np.flatnonzero(self.state.live).tolist():
            seen, _, terminated, truncated, infos[n] = self.envs[n].step(actions[n])
            self.observations[n] = seen
            self.state.live[n] = not (terminated or truncated)
        self.fill()
        return infos

    def fill(self):
        for world, loop in enumerate(self.loops):
            if self.state.live[world]:
                fill(self.state, world, loop)

    def close(self):
        for env in self.envs:
            env.close()


def fill(state, world, loop):
    """Write what a loop is about to scan into the tables of a world; its tracks are left alone."""
    primitives = loop.world.bullet.primitives
    count = len(primitives.poses)
    state.bodies.counts[world] = count
    state.bodies = state.bodies._replace(
        boxes=filled(state.bodies.boxes, world, loop.world.boxes_of(np.arange(count))),
        poses=filled(state.bodies.poses, world, primitives.poses),
    )
    parts = primitives.tables
    state.solids.counts[world] = len(parts[-1])
    state.solids = type(state.solids)(
        state.solids.counts,
        *(filled(table, world, rows) for table, rows in zip(state.solids[1:], parts, strict=True)),
    )
    labels = loop.world.labels()
    state.reported.counts[world] = len(labels)
    state.reported = state.reported._replace(
        bodies=filled(state.reported.bodies, world, np.array([*labels])),
        classes=filled(state.reported.classes, world, np.array([*labels.values()])),
    )
    sensor = loop.sensor
    pose = sensor.x, sensor.y, sensor.z, sensor.yaw, sensor.roll, sensor.pitch
    state.sensors.poses[world] = pose
    state.sensors.turns[world] = np.cos(sensor.yaw), np.sin(sensor.yaw)
    state.sensors.turns_back[world] = sensor.turn_back
    state.egos.speeds[world] = loop.belief.ego.speed
