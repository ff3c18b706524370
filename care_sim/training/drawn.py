"""Drawn episodes: their draws, the environment that plays them, and their common reward.

| camera | share of episodes | drawn evenly from |
|---|---|---|
| without a fault | 40% | |
| misses | 25% | 10 to 60% of the objects, for 1 to 5 keyframes at a time |
| late | 20% | 1 to 3 keyframes |
| blind | 15% | |

False boxes are not drawn: they belong to another drive, which would have to be played first.

The reward is minus the missed chances of a first detection. In the closed loop a newcomer is the
first-sighting actor, or in a drive every planned meeting of the ego. In the open loop a newcomer is
the object of a first-sighting event, until its time to first detection is censored. A keyframe has
a chance if the newcomer has never been detected and a scan of every cell would give it the returns
that the proxy needs. A missed chance costs 1. So a return is minus the time to first detection
(paper, Remark 1) in keyframes, relative to the full scan. The full scan has 0, the best return. No
term counts collisions. Collisions are rare, at most one per episode, and follow from late
detections.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from care_sim.base.errors import InvalidInput
from care_sim.base.seeds import SPLITS, split_of
from care_sim.core.cells.stack import Grid
from care_sim.core.rig import Rig
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.open_loop import OpenLoopEnv
from care_sim.envs.scenes import StreetEnv
from care_sim.envs.sensing import Observed, SensingEnv, sensing
from care_sim.envs.wrappers.grid_observation import GridArrays
from care_sim.evaluation.recall import CENSORED_AT
from care_sim.policies.learned.grid_features import EGO_INPUTS
from care_sim.sources.street_films import street_film

STREETS = 24
"""Streets drawn from every split. A street takes 2.5 s to film, as long as playing 2,500 keyframes,
and 25 MB.
"""
_STREAM = 22
"""Separates these draws from an environment's streams of the same seed."""
_CAMERAS = ("without", "misses", "late", "blind")
_SHARES = (0.40, 0.25, 0.20, 0.15)


@dataclass(frozen=True)
class Draw:
    """A drawn episode: the index of its environment, its budget, camera faults as arguments,
    whether left and right are swapped, and the seeds of its world and its street.
    """

    place: int
    budget: float
    faults: dict[str, Any]
    mirrored: bool
    seed: int
    street: int


def drawn(seed: int, places: int, budgets: Sequence[float], faulty: bool = True) -> Draw:
    """Draw the episode of a seed. The same seed draws the same, and seed and street are of one
    split.

    `places` is the number of environments. With `faulty=False` the camera has no fault and all
    other draws stay. Raises InvalidInput for a seed of no split.
    """
    rng = np.random.default_rng([seed, _STREAM])
    place, number, street = (int(rng.integers(most)) for most in (places, len(budgets), STREETS))
    mirrored = bool(rng.random() < 0.5)
    # Last, so that episodes without faults are otherwise the same.
    faults = _faults(rng) if faulty else {}
    streets = SPLITS[split_of([seed])]
    return Draw(place, budgets[number], faults, mirrored, seed, streets[street])


def _faults(rng: np.random.Generator) -> dict[str, Any]:
    camera = rng.choice(_CAMERAS, p=_SHARES)
    if camera == "misses":
        return {
            "false_negative_rate": float(rng.uniform(0.1, 0.6)),
            "false_negative_burst": int(rng.integers(1, 6)),
        }
    if camera == "late":
        return {"camera_latency": int(rng.integers(1, 4))}
    return {"false_negative_rate": 1.0} if camera == "blind" else {}


AnyEnv = gymnasium.Env[Any, Any]


class DrawnEnv(gymnasium.Env[Any, Any]):
    """An environment that draws an episode at every reset (`care_sim.training.drawn`). `make` makes
    the episode's environment, with the same spaces and errors.

    `unwrapped` and `rig` are those of the running episode; before the first one, of an episode of
    the first environment. Raises InvalidInput at once for errors of any of the environments, and
    for LiDARs that differ.
    """

    def __init__(
        self,
        make: Callable[[Draw], AnyEnv],
        places: int,
        budgets: Sequence[float],
        faulty: bool = True,
    ):
        self._make = make
        self._given = places, budgets, faulty
        grids = list[Grid]()
        # Mirrored, to check that every sensor can be. The first environment comes last: its spaces
        # stay.
        for place in reversed(range(places)):
            for budget in budgets:
                self._env = make(Draw(place, budget, {}, True, 0, 0))
                self._env.close()
            grids.append(self.rig.grid)
        # Weights fit one grid, and their card holds that of the last episode.
        if any(grid != grids[0] for grid in grids):
            raise InvalidInput("episodes can be drawn only of environments with the same LiDAR")
        self._follow()

    @property
    def unwrapped(self) -> SensingEnv[Any]:
        """The environment of the running episode, without its wrappers."""
        return sensing(self._env)

    @property
    def rig(self) -> Rig:
        """Return the rig of the running episode."""
        return self.unwrapped.rig

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin the episode that a seed draws. Without a seed, the next seed follows from the last
        one. Raises InvalidInput for a seed of no split.
        """
        super().reset(seed=seed)
        own = int(self.np_random.integers(2**31 - 1)) if seed is None else int(seed)
        draw = drawn(own, *self._given)
        self._env.close()
        self._env = self._make(draw)
        self._follow()
        return self._env.reset(seed=draw.seed, options=options)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Advance to the next keyframe."""
        return self._env.step(action)

    def close(self) -> None:
        """Free the simulator."""
        self._env.close()

    def _follow(self) -> None:
        # Environments differ in cameras and in the bounds of their boxes. Behind the wrappers of
        # learners all spaces are the same.
        self.observation_space = self._env.observation_space
        self.action_space = self._env.action_space


# Streets of training and of validation.
_film = lru_cache(maxsize=2 * STREETS)(street_film)


class DrawnStreet(StreetEnv):
    """The street of the seed `street` in every episode; the seed of `reset` draws faults, noise and
    floor.
    """

    def __init__(self, street: int, **parameters: Any):
        super().__init__(**parameters)
        self._street = street

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observed, dict[str, Any]]:
        """Begin an episode in the street."""
        film = _film(self._street, self._secret, self._setup, self.conditions.filmed)
        return self._start(film, self._entropy(seed, options))


_YAW_RATE = EGO_INPUTS.index("yaw_rate")
_LAST_BITS = 1e-9


class Mirrored(gymnasium.Wrapper[GridArrays, NDArray[np.float32], Any, Any]):
    """Mirrors the pictures of `GridObservation` at the car's middle plane, and mirrors the scores
    of sectors back. `shape` (channels, rows, columns) is that of the pictures. It fits every
    environment, and a learner then meets both sides equally often. Raises InvalidInput for a LiDAR
    that is not symmetric.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], shape: tuple[int, int, int]):
        super().__init__(env)
        self._shape = shape
        if not _is_symmetric(sensing(env).rig):
            raise InvalidInput(
                "sides can be drawn only of a LiDAR that stands in the middle of the car and is "
                "alike on both"
            )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[GridArrays, dict[str, Any]]:
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._reflected(observation), info

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[GridArrays, Any, bool, bool, dict[str, Any]]:
        """Advance to the next keyframe."""
        observation, reward, terminated, truncated, info = self.env.step(action[:, ::-1])
        return self._reflected(observation), reward, terminated, truncated, info

    def _reflected(self, observation: GridArrays) -> GridArrays:
        grid = observation["grid"].reshape(self._shape)[..., ::-1].ravel()
        ego = observation["ego"].copy()
        ego[_YAW_RATE] *= -1
        return {"grid": grid, "ego": ego}


def _is_symmetric(rig: Rig) -> bool:
    """Return True if the grid's left columns mirror the right ones."""
    directions = rig.grid.directions.reshape(*rig.grid.shape, 3)
    reflected = directions[:, ::-1] * (1, -1, 1)
    return not rig.sensor_y_m and bool(np.abs(directions - reflected).max() < _LAST_BITS)


class MissedChances(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Replaces the reward by minus the missed chances of a keyframe. Like every reward it may read
    the truth. Observation and action stay as they are.
    """

    _count: "_InWorld | _InScene"

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        begun = self.env.reset(seed=seed, options=options)
        inner = sensing(self.env)
        if isinstance(inner, OpenLoopEnv):
            self._count = _InScene(inner)
        else:
            assert isinstance(inner, ClosedLoopEnv)
            self._count = _InWorld(inner)
        return begun

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Advance to the next keyframe."""
        # Before the world moves on.
        self._count.look()
        observation, _, terminated, truncated, info = self.env.step(action)
        return observation, -float(self._count.missed()), terminated, truncated, info


class _InWorld:
    """Counts the chances of the closed loop. `look`, before a keyframe, stores which newcomers
    could be detected. `missed`, after it, returns how many of them were not.
    """

    def __init__(self, env: ClosedLoopEnv):
        self._env = env
        world = env.loop.world
        first = world.first_sighting
        met = [one.body for one in world.meetings]
        self._unseen = {*(met or ([] if first is None else [first.body]))} & {*world.labels()}
        self._chances: list[int] = []

    def look(self) -> None:
        self._chances = [body for body in self._unseen if self._env.loop.would_detect(body)]

    def missed(self) -> int:
        record, world = self._env.keyframes[-1], self._env.loop.world
        if world.meetings:
            pairs = zip(world.meetings, record.sights, strict=True)
            seen = {one.body for one, sight in pairs if sight.detected}
        else:
            seen = self._unseen if record.detected else set()
        self._unseen = self._unseen - seen
        return sum(body in self._unseen for body in self._chances)


class _InScene:
    """Counts the chances of the open loop."""

    def __init__(self, env: OpenLoopEnv):
        self._env = env
        self._ages: dict[int, int] = {}

    def look(self) -> None:
        pass

    def missed(self) -> int:
        last = self._env.last
        shot = self._env.loop.film.shots[last.index]
        objects = shot.annotations.objects
        for number in objects[last.appearing].tolist():
            self._ages[number] = 0
        for number in objects[last.found].tolist():
            self._ages.pop(number, None)
        waiting = np.isin(objects, [*self._ages]) & last.scored
        self._ages = {
            number: age + 1 for number, age in self._ages.items() if age + 1 < CENSORED_AT
        }
        if not waiting.any():
            return 0
        returns = shot.cloud.to_shots().objects
        return sum(
            int(np.count_nonzero(returns == number)) >= self._env.min_returns
            for number in objects[waiting].tolist()
        )
