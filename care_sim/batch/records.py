"""What the episodes of a batch leave behind for the scoring."""

from collections.abc import Iterable

import numpy as np

from care_sim.core.arrays import Integers, Mask
from care_sim.loops.record_columns import Records, kind_of


class History:
    """The records of the running episodes of `worlds` worlds, of up to `keyframes` each."""

    def __init__(self, worlds: int, keyframes: int):
        self._columns = Records(
            *(np.zeros((keyframes, worlds), kind_of(name)) for name in Records._fields)
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
