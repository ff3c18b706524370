"""Episodes that are played in one line."""

import numpy as np

import care_sim


def played(env, policy="care", seed=0, keyframes=None):
    """The results of `reset` and every step, to the end of the episode or for so many keyframes; as
    steps: the reset has the reward 0. A `policy` that is None scores nothing.
    """
    nothing = np.zeros(env.action_space.shape, np.float32)
    chooses = care_sim.make_policy(policy, env) if policy else lambda _: nothing
    observation, info = env.reset(seed=seed)
    if policy:
        chooses.reset()
    steps = [(observation, 0.0, False, False, info)]
    while not (steps[-1][2] or steps[-1][3]) and len(steps) - 1 != keyframes:
        steps.append(env.step(chooses(steps[-1][0])))
    return steps


def outcome(env, policy="care", seed=0):
    """The outcome of an episode."""
    return played(env, policy, seed)[-1][4]["outcome"]
