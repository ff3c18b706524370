"""Chance that depends on the seed, the object and the time alone, so that all policies meet the
same.

Numbers that change gradually are drawn for every object at every keyframe (`PersistentNormals`).
Numbers that few objects ever need are hashes of a key (`key_of`, `care_sim.base.hashing`): whether
one is used changes no other.
"""

import math
from functools import partial

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.hashing import mixed
from care_sim.core.arrays import Floats, Integers, Mask, filled
from care_sim.sensors.camera_faults import DrawnAhead

_AHEAD = 16
"""Keyframes for which numbers are drawn at once."""


class PersistentNormals:
    """Standard normal numbers (W, n, k), k of each of n objects of W worlds.

    At a distance of t seconds they have the correlation `lasting` + `share` exp(-t / `time_s`), and
    1 at t = 0.
    """

    def __init__(
        self,
        worlds: int,
        columns: int,
        lasting: float,
        share: float,
        time_s: float,
        keyframe_s: float,
    ):
        self._kept = np.exp(-keyframe_s / time_s)
        self._lasting, self._share = np.sqrt(lasting), np.sqrt(share)
        self._fresh = np.sqrt(1 - lasting - share)
        self._always = self._slow = np.zeros((worlds, 0, columns))
        self._started = np.zeros(worlds, np.bool_)
        self._draws = DrawnAhead(worlds, _AHEAD)

    def begin(self, world: int, objects: int, rng: np.random.Generator) -> None:
        """Begin an episode with so many objects."""
        always, slow = rng.standard_normal((2, objects, self._slow.shape[2]))
        # Both tables grow or neither does: `next` adds them.
        self._always, self._slow = (
            filled(self._always, world, self._lasting * always),
            filled(self._slow, world, slow),
        )
        self._started[world] = False
        self._draws.begin(world, partial(_moves, rng, slow.shape))

    def next(self, live: Mask) -> Floats:
        """(W, n, k) the numbers of the next keyframe of the `live` worlds."""
        drawn = self._draws.next(live, 2 * self._slow[0].size).reshape(*self._slow.shape, 2)
        moved = self._kept * self._slow + np.sqrt(1 - self._kept**2) * drawn[..., 0]
        self._slow = np.where((live & self._started)[:, None, None], moved, self._slow)
        self._started |= live
        numbers: Floats = self._always + self._share * self._slow + self._fresh * drawn[..., 1]
        return numbers


class Renewals:
    """The keyframe (W, n, k) since which each of k states of n objects of W worlds lasts.

    From one keyframe to the next a state stays with the chance exp(-keyframe / `time_s`), and else
    begins anew.
    """

    def __init__(self, worlds: int, states: int, time_s: float, keyframe_s: float):
        self._stays = math.exp(-keyframe_s / time_s)
        self._begun = np.zeros((worlds, 0, states), np.int64)
        self._keyframes = np.zeros((worlds, 1, 1), np.int64)
        self._draws = DrawnAhead(worlds, _AHEAD)

    def begin(self, world: int, objects: int, rng: np.random.Generator) -> None:
        """Begin an episode with so many objects."""
        states = objects, self._begun.shape[2]
        self._begun = filled(self._begun, world, np.zeros(states, np.int64))
        self._keyframes[world] = 0
        self._draws.begin(world, partial(_shares, rng, objects * states[1]))

    def next(self, live: Mask) -> Integers:
        """(W, n, k) the beginnings at the next keyframe of the `live` worlds."""
        here = live[:, None, None]
        self._keyframes += here
        draws = self._draws.next(live, self._begun[0].size).reshape(self._begun.shape)
        self._begun = np.where(here & (draws >= self._stays), self._keyframes, self._begun)
        return self._begun


# No closures: copies of a world draw from copies of the generators.
def _moves(rng: np.random.Generator, shape: tuple[int, ...], keyframes: int) -> Floats:
    """(keyframes, ...) for each number its move and what is fresh, side by side."""
    drawn = rng.standard_normal((keyframes, 2, *shape))
    return np.moveaxis(drawn, 1, -1).reshape(keyframes, -1)


def _shares(rng: np.random.Generator, states: int, keyframes: int) -> Floats:
    return rng.random((keyframes, states))


@compiled()
def key_of(key: np.uint64, one: int, two: int, three: int) -> np.uint64:
    """A key of its own for every three numbers from 0 up, below a key."""
    return mixed(mixed(mixed(key, one), two), three)
