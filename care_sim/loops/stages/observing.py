"""The observations of all worlds, within their limits."""

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.belief import MAX_DETECTIONS, MAX_TRACKS, Belief
from care_sim.core.rig import Rig
from care_sim.core.types import Ego, ImageDetections, Tracks
from care_sim.loops.observation_limits import Limits
from care_sim.loops.stages.state import State

# The column of the camera, by which bounds differ.
_CAMERA, _NO_CAMERA = ImageDetections.CAMERA, -1

Observations = dict[str, NDArray[np.float32]]
"""Observations of W worlds, arrays with a row for each."""


def room_for_observations(rig: Rig, worlds: int) -> Observations:
    """Tables for the observations of so many worlds."""
    shapes = {
        "ego": (3,),
        "budget": (1,),
        "detections": (MAX_DETECTIONS, len(ImageDetections.COLUMNS)),
        "tracks": (MAX_TRACKS, len(Tracks.COLUMNS)),
        "ranges": rig.grid.shape,
    }
    return {name: np.zeros((worlds, *shape), np.float32) for name, shape in shapes.items()}


class Observing:
    """Writes observations within their limits, and each of the `budgets` (W,) as a share of all
    cells.
    """

    def __init__(self, limits: Limits, budgets: Integers):
        rig = limits.rig
        self._limits = limits
        self._shares = (budgets[:, None] / rig.grid.size).astype(np.float32)
        self._detection_bounds = limits.detections[0], limits.pictured[1]
        self._track_bounds = limits.tracks[0], limits.tracks[1][None]

    def write(
        self,
        state: State,
        detections: tuple[Integers, Floats],
        tracks: tuple[Integers, Floats],
        observed: Observations,
    ) -> None:
        """Write all but `ranges` of the worlds that play into `observed`. `detections` and
        `tracks` are numbers of rows (W,) and rows (W, n, 9) and (W, n, 13).
        """
        who = state.live
        observed["ego"][who] = state.read[who]
        observed["budget"][who] = self._shares[who]
        fits = _put(*detections, *self._detection_bounds, _CAMERA, observed["detections"], who)
        fits &= _put(*tracks, *self._track_bounds, _NO_CAMERA, observed["tracks"], who)
        for world in np.flatnonzero(who & ~fits).tolist():
            # Numbers beyond the limits, or too many rows.
            ranges = observed["ranges"][world]
            limited = self.belief(world, state.read[world], detections, tracks, ranges)
            tables = limited.to_observation()
            for name in ("detections", "tracks"):
                observed[name][world] = tables[name]

    def belief(
        self,
        world: int,
        ego: Floats,
        detections: tuple[Integers, Floats],
        tracks: tuple[Integers, Floats],
        ranges: NDArray[np.float32],
    ) -> Belief:
        """Return the belief of a world, in full precision. `ego` (3,) as in `State.read`."""
        seen, known = (
            table[world, : counts[world]].copy() for counts, table in (detections, tracks)
        )
        return self._limits.belief(
            Ego(*ego.tolist()),
            ImageDetections.from_checked_rows(seen),
            Tracks.from_checked_rows(known),
            ranges,
        )


@compiled(brief=True)
def _put(
    counts: Integers,
    rows: Floats,
    least: Floats,
    most: Floats,
    camera: int,
    table: NDArray[np.float32],
    who: Mask,
) -> Mask:
    """Write `rows` (W, n, k) into the `table` (W, m, k) of the worlds `who`; each row left over
    begins with -1. Return per world (W,) whether all numbers are between `least` (k,) and `most`
    (c, k), and the rows at most m.

    Row by row `most` is that of the number in the column `camera`, or the only one.
    """
    fits = np.ones(len(counts), np.bool_)
    for w in range(len(counts)):
        if not who[w]:
            continue
        count = min(counts[w], table.shape[1])
        fits[w] = count == counts[w]
        for n in range(count):
            bound = int(rows[w, n, camera]) if camera >= 0 else 0
            for k in range(table.shape[2]):
                number = rows[w, n, k]
                table[w, n, k] = number
                if not least[k] <= number <= most[bound, k]:
                    fits[w] = False
        for n in range(count, table.shape[1]):
            for k in range(table.shape[2]):
                table[w, n, k] = 0.0
            table[w, n, 0] = -1.0
    return fits
