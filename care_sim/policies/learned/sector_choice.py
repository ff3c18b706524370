"""What scores of sectors fire, in several worlds at once.

It is what the shared allocator makes of `care_sim.policies.learned.tiling.reserve_demand` and
`sector_demand`.
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.core.allocation import _fill_stages
from care_sim.core.arrays import Integers
from care_sim.core.cell_sets import CellSets
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.policies.learned.beliefs import Beliefs
from care_sim.policies.learned.tiling import Tiling, enough_beside_hulls


class SectorChoice:
    """Actions of a rig from scores of `sectors`."""

    def __init__(self, rig: Rig, sectors: Tiling):
        self._rig = rig
        self._sectors = sectors

    def reserve(self, beliefs: Beliefs, scores: NDArray[np.floating]) -> NDArray[np.float32]:
        """Scores (W, E, A) of the cells of `reserve_demand`, from those of the sectors (W,
        elevations, azimuths).
        """
        enough = enough_beside_hulls(self._rig)
        return self._actions(scores, enough, beliefs.hulls, beliefs.track_ends)

    def alone(self, scores: NDArray[np.floating]) -> NDArray[np.float32]:
        """The same of `sector_demand`."""
        none = np.zeros(len(scores), np.int64)
        return self._actions(scores, self._rig.budget, CellSets.of([]), none)

    def _actions(
        self, scores: NDArray[np.floating], enough: int, hulls: CellSets, ends: Integers
    ) -> NDArray[np.float32]:
        rig = self._rig
        ranked, counts = self._sectors.best(scores, enough)
        hulls = rig.listed(hulls)
        exploited = round((1 - rig.reserve_fraction) * rig.budget)
        actions = np.zeros((len(scores), rig.grid.size), np.float32)
        _score_cells(
            *(hulls.cells, hulls.sizes, ends, exploited),
            *(self._listed, ranked, counts, rig.budget),
            actions,
        )
        return actions.reshape(-1, *rig.grid.shape)

    @cached_property
    def _listed(self) -> Cells:
        """(sectors, n) the cells of every sector in the order in which they are taken."""
        cells = self._sectors.cells
        return self._rig.listed(list(cells)).cells.reshape(cells.shape)


@compiled()
def _score_cells(
    hulls: Cells,
    hull_sizes: Integers,
    hull_ends: Integers,
    exploited: int,
    sectors: Cells,
    ranked: Integers,
    counts: Integers,
    budget: int,
    out: NDArray[np.float32],
) -> None:
    """Fill `out` (W, N), zeros before, with scores of the cells that each world's hulls take, at
    most `exploited`, and then the first `counts` (W,) of its `ranked` (W, m) sectors, up to the
    budget.
    """
    width = sectors.shape[1]
    place = first = 0
    for world in range(len(out)):
        # Exploitation is one stage of all hulls, every sector a stage of its own.
        sizes = np.full(hull_ends[world] - first + counts[world], width)
        held = len(sizes) - counts[world]
        sizes[:held] = hull_sizes[first : first + held]
        inside = sizes[:held].sum()
        cells = np.empty(sizes.sum(), np.int64)
        cells[:inside] = hulls[place : place + inside]
        for n in range(counts[world]):
            begin = inside + n * width
            cells[begin : begin + width] = sectors[ranked[world, n]]
        limits = np.full(counts[world] + 1, budget)
        limits[0] = exploited
        ends = held + np.arange(counts[world] + 1)
        chosen = _fill_stages(cells, sizes, ends, limits, 0, out.shape[1] - 1)
        _lay_scores(chosen, out[world])
        first, place = first + held, place + inside


@compiled()
def _lay_scores(cells: Cells, out: NDArray[np.float32]) -> None:
    """Write into `out` (N,) what `care_sim.core.actions.scores_of` gives cells of one shot each."""
    whole = np.float32(2 * max(len(cells), 1))
    for n in range(len(cells)):
        out[cells[n]] = (whole - np.float32(n)) / whole
