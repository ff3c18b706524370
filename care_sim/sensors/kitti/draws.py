"""Chance that depends on the seed, the object and the time alone, so that all policies meet the
same.

Numbers that change gradually are drawn for every object at every keyframe (`PersistentNormals`).
Numbers that few objects ever need are hashes of a key (`key_of`, `care_sim.base.hashing`): whether
one is used changes no other.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from care_sim.base.compiled import compiled
from care_sim.base.hashing import mixed
from care_sim.core.arrays import Floats, Integers


class PersistentNormals:
    """Standard normal numbers (n, k), k of each of n objects.

    At a distance of t seconds column j has the correlation
    `lasting[j]` + `shares[j]` exp(-t / `times_s[j]`), and 1 at t = 0.
    """

    def __init__(
        self,
        objects: int,
        lasting: ArrayLike,
        shares: ArrayLike,
        times_s: ArrayLike,
        keyframe_s: float,
        rng: np.random.Generator,
    ):
        lasting, shares = np.asarray(lasting, float), np.asarray(shares, float)
        self._kept = np.exp(-keyframe_s / np.asarray(times_s, float))
        self._share, self._fresh = np.sqrt(shares), np.sqrt(1 - lasting - shares)
        self._rng = rng
        always, self._slow = rng.standard_normal((2, objects, len(shares)))
        self._always = np.sqrt(lasting) * always
        self._started = False

    def next(self) -> Floats:
        """(n, k) the numbers of the next keyframe."""
        moves, fresh = self._rng.standard_normal((2, *self._slow.shape))
        if self._started:
            self._slow = self._kept * self._slow + np.sqrt(1 - self._kept**2) * moves
        self._started = True
        numbers: Floats = self._always + self._share * self._slow + self._fresh * fresh
        return numbers


class Renewals:
    """The keyframe (...) since which each of many states lasts, in an array of any `shape`.

    From one keyframe to the next a state stays with the chance exp(-keyframe / `time_s`), and else
    begins anew.
    """

    def __init__(
        self, shape: tuple[int, ...], time_s: float, keyframe_s: float, rng: np.random.Generator
    ):
        self._stays = math.exp(-keyframe_s / time_s)
        self._rng = rng
        self._begun = np.zeros(shape, np.int64)
        self._keyframe = 0

    def next(self) -> Integers:
        """(...) the beginnings at the next keyframe."""
        self._keyframe += 1
        anew = self._rng.random(self._begun.shape) >= self._stays
        self._begun = np.where(anew, self._keyframe, self._begun)
        return self._begun


@compiled()
def key_of(key: np.uint64, one: int, two: int, three: int) -> np.uint64:
    """A key of its own for every three numbers from 0 up, below a key."""
    return mixed(mixed(mixed(key, one), two), three)
