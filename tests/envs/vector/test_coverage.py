"""What is not played as arrays."""

import numpy as np

from care_sim.envs.scenarios import DartoutEnv
from care_sim.envs.vector.arguments import why_separate
from care_sim.envs.vector.env import ClosedLoopVectorEnv


class Miser(DartoutEnv):
    """Pays nothing."""

    def step(self, action):
        observation, _, *rest = super().step(action)
        return observation, 7.0, *rest


class Misers(ClosedLoopVectorEnv):
    single = Miser


def test_a_class_that_derives_from_an_environment_plays_as_it_does():
    assert why_separate(DartoutEnv()) is None
    assert why_separate(Miser()) == "the class Miser"
    env = Misers(2, threads=1)
    env.reset(seed=0)
    assert env.step(np.zeros(env.action_space.shape, np.float32))[1].tolist() == [7.0, 7.0]
    env.close()
