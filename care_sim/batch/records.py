"""What the episodes of a batch leave behind for the scoring."""

import math
from typing import NamedTuple

import numpy as np

from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.loops.records import Keyframe


class Records(NamedTuple):
    """A keyframe of W worlds; (W,) each, as in `care_sim.loops.records.Keyframe`. `fired` is how
    many cells were fired, and `impact_speed_mps` NaN where nothing was hit.
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


class History:
    """The records of the running episodes of `worlds` worlds, of up to `keyframes` each."""

    def __init__(self, worlds: int, keyframes: int):
        kinds = {"fired": np.int64, "in_view": np.bool_, "detected": np.bool_, "braking": np.bool_}
        self._columns = Records(
            *(
                np.zeros((keyframes, worlds), kinds.get(name, np.float64))
                for name in Records._fields
            )
        )

    def note(self, who: Mask, keyframes: Integers, records: Records) -> None:
        """Keep the records of the worlds `who` (W,), of their `keyframes` (W,)."""
        worlds = np.flatnonzero(who)
        for table, column in zip(self._columns, records, strict=True):
            table[keyframes[worlds], worlds] = column[worlds]

    def episode(self, world: int, keyframes: int) -> list[Keyframe]:
        """The first `keyframes` records of a world's episode. Instead of the fired cells they hold
        as many numbers.
        """
        columns = [table[:keyframes, world].tolist() for table in self._columns]
        cells = np.zeros(self._columns.fired[:keyframes, world].max(), np.int64)
        return [
            Keyframe(
                index=index,
                time_s=time,
                fired=cells[:fired],
                in_view=in_view,
                detected=detected,
                braking=braking,
                speed_mps=speed,
                distance_m=distance,
                nearest_m=nearest,
                clearance_m=clearance,
                impact_speed_mps=None if math.isnan(impact) else impact,
            )
            for index, (
                time,
                fired,
                in_view,
                detected,
                braking,
                speed,
                distance,
                nearest,
                clearance,
                impact,
            ) in enumerate(zip(*columns, strict=True))
        ]
