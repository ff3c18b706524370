"""The luck of objects at a measured detector, and the errors of their boxes.

Both are made of standard normals that depend on the episode's seed, the object and the keyframe
alone: every policy meets the same, whatever it fires, in whatever order objects are asked for. Each
of `care_sim.perception.measured.tables.SIGNALS` is

    sqrt(stays) * constant + sqrt(decays) * slow + sqrt(1 - stays - decays) * quick,

where `slow` decays in the measured time and `quick` in `flash_s`. Both follow an autoregressive
process of first order, which is advanced at every keyframe at which the object is annotated,
detected or not.
"""

import math

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.hashing import mixed, normal
from care_sim.core.arrays import Floats, Integers
from care_sim.perception.measured.tables import SIGNALS, Luck

LUCK, TURNED, FIRST_ERROR = range(3)
"""Places in `SIGNALS`."""
CHANNELS = 3 * len(SIGNALS)
"""Numbers of each object: of every signal the slow process and the quick one, then the constants.
"""
_CONSTANT = 2**20
"""A keyframe that no episode reaches, whose normals are those that stay."""


@compiled()
def normal_of(seed: np.uint64, number: int, keyframe: int, channel: int) -> float:
    """The standard normal of an object at a keyframe."""
    return normal(mixed(mixed(seed, number), keyframe), channel)


@compiled()
def advance(
    clock: tuple[np.uint64, int, float, float],
    objects: Integers,
    classes: Integers,
    rows: Integers,
    last: Integers,
    processes: Floats,
    table: Luck,
) -> Floats:
    """(n, 8) the `SIGNALS` of annotated `objects` (n,) of `classes` (n,) at a keyframe, standard
    normals. The `clock` holds the episode's seed, the keyframe, seconds between keyframes, and
    seconds of the quick ones.

    `rows` (n,) are their places in `last` (m,), the keyframe at which each was annotated before or
    -1, and in `processes` (m, CHANNELS), which are advanced.
    """
    seed, keyframe, keyframe_s, flash_s = clock
    signals = np.empty((len(objects), len(SIGNALS)))
    for n in range(len(objects)):
        row, label = rows[n], classes[n]
        begins = last[row] < 0
        elapsed_s = (keyframe - last[row]) * keyframe_s
        for signal in range(len(SIGNALS)):
            slow, quick = 2 * signal, 2 * signal + 1
            for channel in (slow, quick):
                lasts_s = table.decay_s[label, signal] if channel == slow else flash_s
                kept = 0.0 if begins or lasts_s <= 0 else math.exp(-elapsed_s / lasts_s)
                processes[row, channel] = kept * processes[row, channel] + math.sqrt(
                    1.0 - kept * kept
                ) * normal_of(seed, objects[n], keyframe, channel)
            constant = 2 * len(SIGNALS) + signal
            if begins:
                processes[row, constant] = normal_of(seed, objects[n], _CONSTANT, slow)
            stays, decays = table.stays[label, signal], table.decays[label, signal]
            signals[n, signal] = (
                math.sqrt(stays) * processes[row, constant]
                + math.sqrt(decays) * processes[row, slow]
                + math.sqrt(max(1.0 - stays - decays, 0.0)) * processes[row, quick]
            )
        last[row] = keyframe
    return signals
