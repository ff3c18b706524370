"""A vector of environments that costs a learner nothing. The module subclasses a class of
Stable-Baselines3 and so needs the optional extra 'rl'.
"""

from typing import Any

from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn


class AnsweredAtOnce(VecEnvWrapper):
    """Plays one step, and answers every later one as that: what is left of the time is the
    learner's own.
    """

    _answer: VecEnvStepReturn | None = None

    def reset(self) -> VecEnvObs:
        """Begin episodes."""
        begun: VecEnvObs = self.venv.reset()
        return begun

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions of the first step alone."""
        if self._answer is None:
            self.venv.step_async(actions)

    def step_wait(self) -> VecEnvStepReturn:
        """What the first step gave."""
        if self._answer is None:
            self._answer = self.venv.step_wait()
        return self._answer
