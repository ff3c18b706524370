"""What the episodes of a batch leave behind for the scoring."""

from collections.abc import Iterable, Sequence
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

    @classmethod
    def of(cls, keyframes: Sequence[Keyframe]) -> "Records":
        """Those of an episode."""
        columns = {name: [getattr(one, name) for one in keyframes] for name in cls._fields}
        columns["fired"] = [len(one.fired) for one in keyframes]
        # None, where nothing was hit, becomes NaN.
        return cls(**{name: np.array(columns[name], _kind(name)) for name in cls._fields})


class History:
    """The records of the running episodes of `worlds` worlds, of up to `keyframes` each."""

    def __init__(self, worlds: int, keyframes: int):
        self._columns = Records(
            *(np.zeros((keyframes, worlds), _kind(name)) for name in Records._fields)
        )

    def note(self, who: Mask, keyframes: Integers, records: Records) -> None:
        """Keep the records of the worlds `who` (W,), of their `keyframes` (W,)."""
        worlds = np.flatnonzero(who)
        for table, column in zip(self._columns, records, strict=True):
            table[keyframes[worlds], worlds] = column[worlds]

    def episode(self, world: int, keyframes: int) -> Records:
        """The first `keyframes` records of a world's episode, (keyframes,) each."""
        columns: Iterable[np.ndarray] = self._columns
        return Records(*(table[:keyframes, world] for table in columns))


def _kind(column: str) -> type:
    kinds: dict[str, type] = {"fired": np.int64} | dict.fromkeys(
        ("in_view", "detected", "braking"), np.bool_
    )
    return kinds.get(column, np.float64)
