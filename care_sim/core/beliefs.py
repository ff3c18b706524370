"""What is believed of the objects of several worlds, as the rows of all: what goes row by row is
then done once for all of them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.belief import HIGHEST, OBSERVED, Belief, Observation, array_of, rows_of
from care_sim.core.belief_kernels import lie_between
from care_sim.core.rig import Rig
from care_sim.core.types import ImageDetections, Tracks


class Beliefs(NamedTuple):
    """The `detections` and `tracks` of W worlds, those of one world after those of another; how
    many are of each, `detected` and `tracked` (W,); and the `budgets` (W,) in cells.
    """

    detections: ImageDetections
    tracks: Tracks
    detected: Integers
    tracked: Integers
    budgets: Integers

    @classmethod
    def of(cls, belief: Belief) -> "Beliefs":
        """Those of one world."""
        detections, tracks = belief.detections, belief.tracks
        counts = np.array([len(detections), len(tracks), belief.budget])
        return cls(detections, tracks, counts[:1], counts[1:2], counts[2:])

    @classmethod
    def from_observation(cls, observation: Observation, rig: Rig, live: Mask) -> "Beliefs":
        """Read an observation of a vector environment, all but its ranges; of worlds that are not
        `live` (W,) there are no rows.

        Raises InvalidInput as `care_sim.core.rig.Rig.read` does for the observation of one.
        """
        check_observed(observation, rig, len(live))
        egos, budgets = (array_of(observation, name, 2, None)[live] for name in ("ego", "budget"))
        if not (lie_between(egos, -HIGHEST, HIGHEST) and lie_between(budgets, 0.0, 1.0)):
            raise InvalidInput(
                f"an observation's ego must hold numbers up to {HIGHEST:g}, its budget lie in "
                "[0, 1]"
            )
        found, detected = _table(observation, "detections", ImageDetections.COLUMNS, live)
        known, tracked = _table(observation, "tracks", Tracks.COLUMNS, live)
        detections = ImageDetections.from_checked_rows(found)
        rig.check_cameras(detections)
        cells = np.zeros(len(live), np.int64)
        cells[live] = np.rint(budgets[:, 0].astype(np.float64) * rig.grid.size)
        return cls(detections, Tracks.from_checked_rows(known), detected, tracked, cells)

    def unturned(self) -> "Beliefs":
        """The same as if no car had turned since its pictures."""
        return self._replace(detections=self.detections.unturned())


def check_observed(observation: Observation, rig: Rig, worlds: int) -> None:
    """Raise InvalidInput for what is no observation of so many worlds with a rig."""
    if not all(name in observation for name in OBSERVED):
        raise InvalidInput(
            "an observation of CARE-Sim's vector environments is needed, as they give it without "
            "wrappers"
        )
    wanted = {
        "ego": (worlds, 3),
        "budget": (worlds, 1),
        "ranges": (worlds, *rig.grid.shape),
    }
    for name, shape in wanted.items():
        if (got := np.shape(observation[name])) != shape:
            raise InvalidInput(f"{name} of an observation must be {shape}, got {got}")
    for name in ("detections", "tracks"):
        if (got := np.shape(observation[name]))[:1] != (worlds,):
            raise InvalidInput(f"{name} of an observation must be of {worlds} worlds, got {got}")


def _table(
    observation: Observation, key: str, columns: tuple[str, ...], live: Mask
) -> tuple[Floats, Integers]:
    tables: NDArray[np.floating] = array_of(observation, key, 3, len(columns))
    return rows_of(tables, live, key, columns)
