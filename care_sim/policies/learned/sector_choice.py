"""What scores of sectors fire, in several worlds at once.

It is what the shared allocator makes of `care_sim.policies.learned.tiling.reserve_demand` and
`sector_demand`.
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from care_sim.core.allocation import Allocator
from care_sim.core.cell_sets import CellSets
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.core.world_sets import WorldSets
from care_sim.policies.learned.seen import Seen
from care_sim.policies.learned.tiling import Tiling, enough_beside_hulls


class SectorChoice:
    """Actions of `worlds` worlds of a rig from scores of `sectors`: (W, E, A), read-only, and
    overwritten by the next call.
    """

    def __init__(self, rig: Rig, sectors: Tiling, worlds: int = 1):
        self._rig = rig
        self._sectors = sectors
        self._budgets = np.full(worlds, rig.budget)
        self._allocator = Allocator(worlds, rig.grid.size, rig.reserve_fraction)

    def reserve(self, seen: Seen, scores: NDArray[np.floating]) -> NDArray[np.float32]:
        """Scores of the cells of `reserve_demand`, from those of the sectors (W, elevations,
        azimuths).
        """
        hulls = WorldSets(self._rig.listed(seen.hulls.sets), seen.hulls.counts)
        return self._actions(hulls, scores, enough_beside_hulls(self._rig))

    def alone(self, scores: NDArray[np.floating]) -> NDArray[np.float32]:
        """The same of `sector_demand`."""
        return self._actions(WorldSets.nothing(len(scores)), scores, self._rig.budget)

    def _actions(
        self, hulls: WorldSets, scores: NDArray[np.floating], enough: int
    ) -> NDArray[np.float32]:
        ranked, counts = self._sectors.best(scores, enough)
        # The layer at every place of the ranking is one sector of each world that has as many. They
        # are gathered at once, and then parted.
        served = np.arange(counts.max())[:, None] < counts
        cells = self._listed[ranked.T[: len(served)][served]]
        sizes = np.full(len(cells), cells.shape[1])
        ends = np.cumsum(np.count_nonzero(served, axis=1)).tolist()
        layers = [
            WorldSets(CellSets(cells[start:end].ravel(), sizes[start:end]), own)
            for start, end, own in zip([0, *ends], ends, served.astype(np.int64), strict=False)
        ]
        actions = self._allocator.scores([hulls, *layers], self._budgets)
        return actions.reshape(-1, *self._rig.grid.shape)

    @cached_property
    def _listed(self) -> Cells:
        """(sectors, n) the cells of every sector in the order in which they are taken."""
        cells = self._sectors.cells
        return self._rig.listed(list(cells)).cells.reshape(cells.shape)
