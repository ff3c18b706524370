"""Equal tiles of the angular grid: sectors that an agent scores, and coarse blocks of its inputs.
Also the demand of sector scores on the shared allocator, and the resulting actions, in any number
of worlds.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from care_sim.base.checks import check_whole
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Integers
from care_sim.core.belief import Belief
from care_sim.core.beliefs import Beliefs
from care_sim.core.cells.sets import CellSets, WorldSets
from care_sim.core.cells.stack import Grid
from care_sim.core.firing.actions import Allocator
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.core.types import Action, Demand

_Cells = TypeVar("_Cells", int, Integers)


@dataclass(frozen=True)
class Tiling:
    """`azimuths` x `elevations` tiles. Raises InvalidInput unless they divide the grid's columns
    and rows.

    A tile's index is `elevation * azimuths + azimuth`; as with cells, elevation 0 is the highest
    and azimuth 0 begins straight behind, at -pi. `shape` is that of a picture of the tiles.
    """

    grid: Grid
    azimuths: int = 32
    elevations: int = 4

    def __post_init__(self) -> None:
        sides = (
            ("azimuths", self.azimuths, self.grid.columns),
            ("elevations", self.elevations, self.grid.rows),
        )
        for name, count, cells in sides:
            check_whole(name, count, 1, cells)
            if cells % count:
                raise InvalidInput(f"{name} must divide the {cells} of the grid, got {count}")
        # A tile must not mix two LiDARs.
        tall, _ = self.tile_shape
        if any(head.grid.rows % tall for head in self.grid.heads):
            rows = ", ".join(str(head.grid.rows) for head in self.grid.heads)
            raise InvalidInput(
                f"elevations must make tiles that lie in one LiDAR each: {self.elevations} of them "
                f"are {tall} rows tall, and the LiDARs have {rows} rows"
            )

    @property
    def shape(self) -> tuple[int, int]:
        """(elevations, azimuths)."""
        return self.elevations, self.azimuths

    @property
    def tile_shape(self) -> tuple[int, int]:
        """Rows and columns of cells in a tile."""
        return self.grid.rows // self.elevations, self.grid.columns // self.azimuths

    @cached_property
    def cells(self) -> Cells:
        """(tiles, n) the cells of every tile, ascending."""
        rows, columns = self.tile_shape
        # Axes: tile row, row in the tile, tile column, column in the tile. Swapping the middle two
        # puts the cells of a tile together.
        pictured = np.arange(self.grid.size).reshape(self.elevations, rows, self.azimuths, columns)
        return pictured.swapaxes(1, 2).reshape(self.elevations * self.azimuths, rows * columns)

    def ranked(self, scores: NDArray[np.floating], enough: int) -> tuple[Integers, Integers]:
        """Return the best tiles (W, m) of W pictures of `scores` (W, ...), ties by ascending index.
        Also returns how many (W,) of them have a positive score. The tiles hold at most `enough`
        cells, rounded up to a tile.
        """
        flat = scores.reshape(len(scores), -1)
        most = min(-(-enough // self.cells.shape[1]), len(self.cells))
        # A stable sort of the negated scores: among equals the lower index comes first.
        best = np.argsort(-flat, axis=1, kind="stable")[:, :most]
        return best, np.minimum(np.count_nonzero(flat > 0, axis=1), most)


def reserve_demand(
    belief: Belief, rig: Rig, sectors: Tiling, scores: NDArray[np.floating]
) -> Demand:
    """Return the forecasts' hulls, then the sectors with a positive score as reserve layers, best
    first, for your own policy. The demand is that of
    `care_sim.policies.learned.sectors.SectorChoice` in one world, before the rig's `cell_order`.
    """
    enough = count_beside_hulls(rig.budget)
    (ranked,), (count,) = sectors.ranked(np.reshape(scores, (1, -1)), enough)
    return Demand(
        rig.hulls(belief.tracks.boxes), [[cells] for cells in sectors.cells[ranked[:count]]]
    )


def count_beside_hulls(budget: _Cells) -> _Cells:
    """Return the number of sector cells that fill a budget, or several, whatever the hulls take."""
    # Hulls take at most one budget of the sectors' cells.
    return 2 * budget


class SectorChoice:
    """Stages of Algorithm 1 for scores (W, ...) of the `sectors` of W worlds. All sets are already
    in the rig's `cell_order`.
    """

    def __init__(self, rig: Rig, sectors: Tiling):
        self._rig = rig
        self._sectors = sectors

    def reserve(self, beliefs: Beliefs, scores: NDArray[np.floating]) -> list[WorldSets]:
        """Return the forecasts' hulls, then the sectors with a positive score in the reserve, best
        first. Each world has its own budget.
        """
        hulls = beliefs.hulls
        listed = WorldSets(self._rig.listed(hulls.sets), hulls.counts)
        return [listed, self._best(scores, count_beside_hulls(beliefs.budgets))]

    def alone(self, scores: NDArray[np.floating], budgets: Integers) -> list[WorldSets]:
        """Return only the sectors with a positive score, best first, for `budgets` (W,)."""
        return [WorldSets.nothing(len(scores)), self._best(scores, budgets)]

    def _best(self, scores: NDArray[np.floating], enough: Integers) -> WorldSets:
        """Return one set per world: the cells of the sectors with a positive score, best first, up
        to `enough` (W,) cells. One set in this order equals a layer per sector.
        """
        tile = self._sectors.cells.shape[1]
        ranked, counts = self._sectors.ranked(scores, int(enough.max()))
        counts = np.minimum(counts, -(-enough // tile))
        cells = self._listed[ranked[np.arange(ranked.shape[1]) < counts[:, None]]]
        return WorldSets(CellSets(cells.ravel(), counts * tile), np.ones(len(counts), np.int64))

    @cached_property
    def _listed(self) -> Cells:
        """Return (sectors, n) the cells of every sector in the order of firing."""
        cells = self._sectors.cells
        return self._rig.listed(list(cells)).cells.reshape(cells.shape)


class SectorActions:
    """Actions (W, E, A) for scores (W, ...) of the `sectors` of W worlds with `budgets` (W,). They
    are read-only, and the next call overwrites them.
    """

    def __init__(self, rig: Rig, sectors: Tiling, budgets: Integers):
        self._choice = SectorChoice(rig, sectors)
        self._allocator = Allocator(rig, len(budgets))
        self._budgets = budgets

    def reserve(self, beliefs: Beliefs, scores: NDArray[np.floating]) -> Action:
        """See `SectorChoice.reserve`."""
        return self._allocator.scores(self._choice.reserve(beliefs, scores), beliefs.budgets)

    def alone(self, scores: NDArray[np.floating]) -> Action:
        """See `SectorChoice.alone`."""
        return self._allocator.scores(self._choice.alone(scores, self._budgets), self._budgets)
