"""The records of keyframes as columns: those of an episode, or of a keyframe of many."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.loops.records import Keyframe


class Records(NamedTuple):
    """A keyframe of W worlds, (W,) each, or the keyframes of one world; as in
    `care_sim.loops.records.Keyframe`. `fired` is how many cells were fired, and `impact_speed_mps`
    NaN where nothing was hit.
    """

    time_s: Floats
    fired: Integers
    in_view: Mask
    detected: Mask
    braking: Mask
    speed_mps: Floats
    distance_m: Floats
    nearest_m: Floats
    clearance_m: Floats
    impact_speed_mps: Floats
    unfounded: Mask

    @classmethod
    def of(cls, keyframes: Sequence[Keyframe]) -> "Records":
        """Those of an episode."""
        columns = {name: [getattr(one, name) for one in keyframes] for name in cls._fields}
        columns["fired"] = [len(one.fired) for one in keyframes]
        # None, where nothing was hit, becomes NaN.
        return cls(**{name: np.array(columns[name], kind_of(name)) for name in cls._fields})


def kind_of(column: str) -> type:
    """What the numbers of a column are."""
    kinds: dict[str, type] = {"fired": np.int64} | dict.fromkeys(
        ("in_view", "detected", "braking", "unfounded"), np.bool_
    )
    return kinds.get(column, np.float64)
