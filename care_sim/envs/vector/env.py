"""The vector environments of the closed loop: thin Gymnasium adapters around `Worlds`."""

from collections.abc import Sequence
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from care_sim.base.checks import as_array, check_flag, check_whole
from care_sim.base.errors import InvalidInput, shown
from care_sim.base.limits import CORES
from care_sim.base.threads import Threads
from care_sim.base.vectors import shared_attribute
from care_sim.core.arrays import Floats, Mask, places
from care_sim.core.conditions import ClosedLoopConditions
from care_sim.core.rig import Rig
from care_sim.core.types import Action
from care_sim.envs import scenarios
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.sensing import Observed, as_scores, entropy_of
from care_sim.envs.vector.arguments import (
    autoreset_of,
    kept,
    last_rows,
    makers_of,
    models_of,
    seeds_of,
    worlds_to_reset,
)
from care_sim.envs.worlds import Stepped, Worlds

WORLDS_A_THREAD = 32
"""Fewest worlds per thread: with fewer, the overhead of a thread exceeds its gain."""
MOST_WORLDS = 2**16
MOST_THREADS = 1024
MOST_STEPS = 2**31 - 1
_SINGLE = 'pass vectorization_mode="sync" to gymnasium.make_vec (docs/vectors.md)'


def check_steps(single: type[ClosedLoopEnv]) -> None:
    """Raise InvalidInput for an environment with a step or reset of its own."""
    for name in ("step", "reset"):
        if getattr(single, name) is not getattr(ClosedLoopEnv, name):
            raise InvalidInput(
                f"{single.__name__} has its own {name}, which many worlds do not call: {_SINGLE}"
            )


class ClosedLoopVectorEnv(VectorEnv[Observed, Action, Any]):
    """Worlds of one environment, played together: `num_envs` of them. Up to `threads` threads share
    the compiled work, by default one per `WORLDS_A_THREAD` worlds and at most one per core.

    World i, begun with a seed, is the single environment begun with it, to the last bit, whatever
    the other worlds do and however many threads there are. All keyword arguments of the single
    environment are taken but `render_mode`. Episodes are truncated after `max_episode_steps`, as
    Gymnasium's `TimeLimit` does. The `budget` and whatever the camera gets wrong
    (`care_sim.envs.vector.arguments.OF_EACH_WORLD`) may be lists of a value for each world.

    Observations, rewards and infos are those that `gymnasium.vector.SyncVectorEnv` gives, in all
    three of its modes of `autoreset_mode`: "NextStep", "SameStep" and "Disabled". With `copy=False`
    the next step overwrites the returned observations.
    """

    single: ClassVar[type[ClosedLoopEnv]]
    """The environment of which these are many."""
    thread_pool: Threads
    """Threads that share the compiled work. A policy of this vector uses them too."""

    def __init__(
        self,
        num_envs: int = 1,
        *,
        threads: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        copy: bool = True,
        max_episode_steps: int | None = None,
        **arguments: Any,
    ):
        check_whole("num_envs", num_envs, 1, MOST_WORLDS)
        if threads is None:
            threads = min(CORES, MOST_THREADS, max(1, num_envs // WORLDS_A_THREAD))
        check_whole("threads", threads, 1, MOST_THREADS)
        check_flag("copy", copy)
        if arguments.get("render_mode") is not None:
            raise InvalidInput(f"many worlds draw no pictures: leave render_mode out, or {_SINGLE}")
        if max_episode_steps is not None:
            check_whole("max_episode_steps", max_episode_steps, 1, MOST_STEPS)
        self._most_steps = max_episode_steps or MOST_STEPS
        self.num_envs = num_envs
        self.autoreset_mode = autoreset_of(autoreset_mode)
        self.metadata = {**self.single.metadata, "autoreset_mode": self.autoreset_mode}
        self.copy = copy
        check_steps(self.single)
        self._models = models_of(makers_of(self.single, arguments, num_envs))
        # Settings that all worlds share are read from world 0.
        self._model = self._models[0]
        self.single_observation_space = self._model.observation_space
        self.single_action_space = self._model.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

        settings = [model.setting for model in self._models]
        self.thread_pool = Threads(min(num_envs, threads))
        # Infos without clearances need few of them.
        exact = self._model.scoring_info
        self._worlds = Worlds(settings, exact, self.thread_pool)
        self._observed = self._worlds.observed
        # Each draws the seeds of its later episodes as the single environment does.
        self._seeded = [gymnasium.Env[Any, Any]() for _ in range(num_envs)]
        self._steps = np.zeros(num_envs, np.int64)
        self._over = np.zeros(num_envs, np.bool_)
        self._begun = np.zeros(num_envs, np.bool_)

    @property
    def rig(self) -> Rig:
        """The fixed settings of the sensing task. Raises InvalidInput where budgets differ."""
        rig: Rig = shared_attribute(self, "rig")
        return rig

    @property
    def conditions(self) -> ClosedLoopConditions:
        """The conditions of all worlds. Raises InvalidInput where cameras differ."""
        conditions: ClosedLoopConditions = shared_attribute(self, "conditions")
        return conditions

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of each world (W,), as of Gymnasium's own vectors: `rig`, `conditions`, or
        another one that a single environment has before its first episode.
        """
        return tuple(getattr(model, name) for model in self._models)

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """An attribute of each world (W,), as `get_attr` gives it. Raises InvalidInput for a
        method: no world has an environment of its own.
        """
        values = self.get_attr(name)
        if args or kwargs or any(map(callable, values)):
            raise InvalidInput(f"call reads attributes of many worlds; for a method {_SINGLE}")
        return values

    def set_attr(self, name: str, values: Any) -> None:
        """Raise InvalidInput: what is fixed about the worlds stays so."""
        raise InvalidInput(
            f"many worlds keep their {shown(name)}: make the vector anew with the value, or "
            f"{_SINGLE}"
        )

    def render(self) -> None:
        """Raise InvalidInput: many worlds draw no pictures."""
        raise InvalidInput(f"many worlds draw no pictures: {_SINGLE}, with a render_mode")

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observed, dict[str, Any]]:
        """Begin an episode in every world, or in those of `options["reset_mask"]` (W,).

        With a whole number for a `seed` world i takes `seed + i`; a list has one for each. Raises
        gymnasium.error.ClosedEnvironmentError once the environment is closed, as `step` does.
        """
        self._check_open()
        seeds = seeds_of(seed, self.num_envs)
        who = worlds_to_reset(options, self.num_envs)
        infos = self._begin(who, seeds, {})
        return self._handed_out(), infos

    def step(self, actions: Action) -> tuple[Observed, Floats, Mask, Mask, dict[str, Any]]:
        """Fire the cells that each world's row of `actions` (W, E, A) scores highest.

        Raises InvalidInput for actions of the wrong shape, and for values that are not finite in
        worlds that play.
        Raises gymnasium.error.ResetNeeded before `reset`, after an error or interrupt in the middle
        of a step, and for a world that is over in the mode "Disabled".
        """
        self._check_open()
        if not self._begun.all():
            raise gymnasium.error.ResetNeeded("call reset() before stepping")
        begins = self._over.copy()
        if self.autoreset_mode == AutoresetMode.DISABLED and begins.any():
            raise gymnasium.error.ResetNeeded(
                f"worlds {shown(places(begins))} are over: call reset() with a reset_mask"
            )
        scores = as_scores(as_array("actions", actions), self.action_space.shape or ())
        fired = self._worlds.fired(scores, ~begins)
        # An error leaves worlds at different keyframes: then all have to begin anew.
        self._begun[:] = False
        stepped = self._worlds.step(fired, ~begins)
        self._steps += ~begins
        stepped.truncated[:] |= ~begins & (self._steps >= self._most_steps)
        over = stepped.terminated | stepped.truncated

        # Episodes that are over begin anew, now or at the next step. The mode "SameStep" returns
        # their last observation and info beside the first ones of the new episode.
        anybody = [None] * self.num_envs
        if self.autoreset_mode == AutoresetMode.SAME_STEP and over.any():
            final = {
                "final_obs": last_rows(self._observed, over),
                "_final_obs": over.copy(),
                "final_info": self._infos(stepped, over),
                "_final_info": over.copy(),
            }
            infos = self._begin(over, anybody, self._infos(stepped, ~over)) | final
        else:
            infos = self._begin(begins, anybody, self._infos(stepped, ~begins))
            self._over = over
        observed = self._handed_out()
        self._begun[:] = True
        return observed, stepped.rewards, stepped.terminated, stepped.truncated, infos

    def close_extras(self, **_: Any) -> None:
        """Free the worlds and end the threads."""
        self.thread_pool.close()
        self._worlds.close()

    def _check_open(self) -> None:
        if self.closed:
            raise gymnasium.error.ClosedEnvironmentError("the environment is closed: make another")

    def _begin(
        self, who: Mask, seeds: Sequence[int | None], infos: dict[str, Any]
    ) -> dict[str, Any]:
        """Begin episodes in the worlds `who`, and add their infos."""
        if not who.any():
            return infos
        self._begun[who] = False
        # A task that is left would use up the random streams of the new episodes.
        self.thread_pool.settle()
        own = {world: entropy_of(self._seeded[world], seeds[world]) for world in places(who)}
        for world, info in self._worlds.begin(own).items():
            infos = self._add_info(infos, info, world)
        self._over[who] = False
        self._steps[who] = 0
        self._begun[who] = True
        return infos

    def _infos(self, stepped: Stepped, who: Mask) -> dict[str, Any]:
        """Return the infos of a step of the worlds `who` (W,)."""
        infos = kept(stepped.columns, who) if who.any() else {}
        for world, info in stepped.single.items():
            if who[world]:
                infos = self._add_info(infos, info, world)
        return infos

    def _handed_out(self) -> Observed:
        if not self.copy:
            return self._observed
        return {name: values.copy() for name, values in self._observed.items()}


def _many(single: type[ClosedLoopEnv]) -> type[ClosedLoopVectorEnv]:
    """The vector environment of a single one."""
    name = f"{single.__name__.removesuffix('Env')}VectorEnv"
    own = {"single": single, "__module__": __name__, "__doc__": ClosedLoopVectorEnv.__doc__}
    return type(name, (ClosedLoopVectorEnv,), own)


DartoutVectorEnv = _many(scenarios.DartoutEnv)
DenseVectorEnv = _many(scenarios.DenseEnv)
CutInVectorEnv = _many(scenarios.CutInEnv)
R157VectorEnv = _many(scenarios.R157Env)
NcapVectorEnv = _many(scenarios.NcapEnv)
DriveVectorEnv = _many(scenarios.DriveEnv)
ScenarioVectorEnv = _many(scenarios.ScenarioEnv)
"""Any scenario of the closed loop many times."""
