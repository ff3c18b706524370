"""The luck of objects with a measured detector, and the errors of their boxes.

Both are made of standard normals that depend only on the episode's seed, the object and the
keyframe. So every policy meets the same numbers, for any mask and any order of objects. Each of
`care_sim.perception.measured.tables.SIGNALS` is

    sqrt(stays) * constant + sqrt(decays) * slow + sqrt(1 - stays - decays) * quick,

where `slow` decays in the measured time and `quick` in `flash_s`. Both follow an autoregressive
process of first order from the keyframe on at which the object is first annotated. A signal that no
keyframe needs is advanced later, by the same steps.
"""

from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.hashing import mixed, normal
from care_sim.core.arrays import Floats, Integers
from care_sim.perception.measured.tables import SIGNALS, Luck

LUCK, TURNED, FIRST_ERROR = range(3)
"""Places in `SIGNALS`."""
CHANNELS = 3 * len(SIGNALS)
"""Numbers per object: the slow and the quick process of every signal, then the constants."""
_CONSTANT = 2**20
"""A keyframe that no episode reaches; its normals are the constants."""


class Shares(NamedTuple):
    """Weights of `SIGNALS` for a keyframe length; c classes."""

    kept: Floats
    """(c, 16) the factors by which the slow and the quick process of each signal decay per
    keyframe.
    """
    fresh: Floats
    """(c, 16) the weight of the normals that are added to them."""
    weights: Floats
    """(c, 8, 3) the weights of the constant, the slow and the quick part of each signal."""


class Memory(NamedTuple):
    """The state of up to m objects in each of W worlds."""

    first: Integers
    """(W, m) the keyframe at which each is first annotated."""
    last: Integers
    """(W, m, 8) the keyframe to which each signal is advanced, -1 before the first time."""
    processes: Floats
    """(W, m, CHANNELS)"""
    returns: Floats
    """(W, m, k) the returns at the last k keyframes, each in the column of its keyframe modulo
    k.
    """
    rows: Integers
    """(W, m) the row of each present object in these tables."""
    ranks: Integers
    """(W, m) the place of each present object among them by ascending number."""

    @classmethod
    def of(cls, worlds: int, objects: int, keyframes: int) -> "Memory":
        """Tables of objects that nobody has met."""
        shape = worlds, objects
        return cls(
            np.zeros(shape, np.int64),
            np.full((*shape, len(SIGNALS)), -1),
            np.zeros((*shape, CHANNELS)),
            np.zeros((*shape, keyframes)),
            np.tile(np.arange(objects), (worlds, 1)),
            np.tile(np.arange(objects), (worlds, 1)),
        )


def shares_of(luck: Luck, keyframe_s: float, flash_s: float) -> Shares:
    """Return the shares of a detector for a keyframe length."""
    lasts = np.stack([luck.decay_s, np.full_like(luck.decay_s, flash_s)], axis=2)
    kept = np.where(lasts > 0, np.exp(-keyframe_s / np.maximum(lasts, 1e-9)), 0.0)
    new = np.maximum(1 - luck.stays - luck.decays, 0.0)
    weights = np.sqrt(np.stack([luck.stays, luck.decays, new], axis=2))
    flat = kept.reshape(len(kept), -1)
    return Shares(flat, np.sqrt(1 - flat**2), weights)


@compiled()
def signal_of(
    key: np.uint64,
    keyframe: int,
    row: tuple[int, int],
    place: tuple[int, int],
    memory: Memory,
    shares: Shares,
) -> float:
    """Return one of the `SIGNALS` of an object at a keyframe, a standard normal. `key` is the
    object's, `row` its world and its row in the `memory`, which is advanced. `place` is its class
    and the signal.
    """
    label, signal = place
    own, constant, slow = memory.processes[row], 2 * len(SIGNALS) + signal, 2 * signal
    met, first = memory.first[row], memory.last[row][signal] + 1
    if first == 0:
        own[constant] = normal(mixed(key, _CONSTANT), slow)
        first = met
    for step in range(first, keyframe + 1):
        now = mixed(key, step)
        for channel in (slow, slow + 1):
            kept = 0.0 if step == met else shares.kept[label, channel]
            fresh = 1.0 if step == met else shares.fresh[label, channel]
            own[channel] = kept * own[channel] + fresh * normal(now, channel)
    memory.last[row][signal] = keyframe
    weights = shares.weights[label, signal]
    total: float = weights[0] * own[constant] + weights[1] * own[slow] + weights[2] * own[slow + 1]
    return total
