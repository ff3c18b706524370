"""Observation of a learned agent: coarse pictures of the angular grid, and the car's own motion.

The pictures hold values from 0 to 1, the motion values from -1 to 1.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.base.checks import check_whole
from care_sim.base.compiled import compiled
from care_sim.core.arrays import Integers
from care_sim.core.belief import Belief, Observation
from care_sim.core.beliefs import Beliefs
from care_sim.core.cells.sets import CellSets
from care_sim.core.grid import Cells
from care_sim.core.residual import camera_layers_of
from care_sim.core.rig import Rig
from care_sim.perception.cluster.points import KERB_CLEARANCE_M
from care_sim.policies.learned.sectors import Tiling

BlockPictures = NDArray[np.float32]
"""(k, B) one number per block, for k pictures."""


class AboveRoad(NamedTuple):
    """Heights of rays above the road, and the heights between which a return counts as standing."""

    rises: NDArray[np.float64]
    """(N,) rise of each ray per metre of range."""
    heights_m: NDArray[np.float64]
    """(N,) height of each ray's origin above the road."""
    reach_m: float
    lowest_m: float
    highest_m: float


@compiled()
def draw_pictures(
    cells: Cells,
    sizes: Integers,
    counts: Integers,
    scans: NDArray[np.float32],
    above: AboveRoad,
    blocks: Cells,
    marks: NDArray[np.uint8],
    out: NDArray[np.float32],
) -> None:
    """Fill `out` (W, 6, B), zeros before, with the six pictures of W worlds: of objects, and of
    their last `scans` (W, N) in metres. Only marked or fired cells are touched, since most cells of
    a keyframe are neither.

    The objects are sets of `sizes` cells, concatenated in `cells`, in three groups. Within each
    group they are ordered by world, with `counts[g, w]` sets of group g in world w. `blocks` (N,)
    is the block of every cell, `marks` (N,) working memory.
    """
    ends = np.cumsum(sizes)
    firsts = counts.sum(axis=1)
    firsts = np.cumsum(firsts) - firsts
    for world in range(len(out)):
        marks[:] = 0
        for group in range(len(counts)):
            last = firsts[group] + counts[group, world]
            for n in range(firsts[group], last):
                own = cells[ends[n] - sizes[n] : ends[n]]
                _add_object(own, group, blocks, marks, out[world])
            firsts[group] = last
        _add_returns(scans[world], above, blocks, marks, out[world, 3:])


@compiled()
def _add_object(
    cells: Cells, group: int, blocks: Cells, marks: NDArray[np.uint8], out: BlockPictures
) -> None:
    """Add to `out[group]` the share of each block's cells that are among `cells` and not in the
    group yet. Bit g of a cell's mark is set if it is in group g.
    """
    # Contribution of one cell to the share of its block.
    part = np.float32(out.shape[1] / len(blocks))
    for cell in cells:
        # Sets of a group overlap; a cell counts once per group.
        if not marks[cell] >> group & 1:
            marks[cell] |= 1 << group
            out[group, blocks[cell]] += part


@compiled()
def _add_returns(
    ranges: NDArray[np.float32],
    above: AboveRoad,
    blocks: Cells,
    marks: NDArray[np.uint8],
    out: BlockPictures,
) -> None:
    """Fill `out` from a scan (N,), per block. The nearness of its nearest return, the share of its
    fired cells, and the share of cells with a return above the road and outside every hull. The
    hulls are the first group of `marks`.
    """
    part = np.float32(out.shape[1] / len(blocks))
    for cell in range(len(ranges)):
        distance = ranges[cell]
        # A cell that did not fire reads 0.
        if not distance > 0:
            continue
        block = blocks[cell]
        out[1, block] += part
        # A ray without a return reads the reach.
        if distance < above.reach_m:
            out[0, block] = max(out[0, block], np.float32(1 - distance / above.reach_m))
            height = above.heights_m[cell] + distance * above.rises[cell]
            if not marks[cell] & 1 and above.lowest_m < height < above.highest_m:
                out[2, block] += part


CHANNELS = ("forecast", "residual", "explained", "nearness", "fired", "undetected")
"""The pictures, in order; see `care_sim.envs.wrappers.grid_observation.GridObservation`."""
EGO_INPUTS = ("speed", "yaw_rate", "acceleration", "budget")
EGO_SCALES = np.array([30.0, 1.0, 10.0, 1.0], np.float32)
"""Values shown as 1: m/s, rad/s, m/s^2 and the share of the cells."""
STANDING_M = (KERB_CLEARANCE_M, 4.0)
"""Heights above the road between which a return counts as standing: over kerbs, under bridges and
the crowns of trees. The tallest of the five classes are lower.
"""


@dataclass(frozen=True)
class GridFeatures:
    """Beliefs of a rig as pictures and a vector.

    The pictures are `CHANNELS` over `columns` x `rows` blocks of the grid, the vector `EGO_INPUTS`.
    A block of `nearness` takes the largest value of its cells; in other channels it takes a share
    of cells. Raises InvalidInput unless the blocks divide the grid. Use it in one thread at a time,
    since it reuses its memory.
    """

    rig: Rig
    columns: int = 64
    rows: int = 8

    def __post_init__(self) -> None:
        check_whole("columns", self.columns, 1, self.rig.grid.columns)
        check_whole("rows", self.rows, 1, self.rig.grid.rows)
        self.blocks  # noqa: B018 (refuses what does not divide)

    @cached_property
    def blocks(self) -> Tiling:
        """The blocks as tiles of the grid."""
        return Tiling(self.rig.grid, self.columns, self.rows)

    @property
    def shape(self) -> tuple[int, int, int]:
        """(channels, rows, columns)."""
        return len(CHANNELS), self.rows, self.columns

    def __call__(self, belief: Belief) -> Observation:
        """Return `grid` (channels * rows * columns,) and `ego` (4,), both float32."""
        return {name: rows[0] for name, rows in self.of_all(Beliefs.of(belief, self.rig)).items()}

    def of_all(self, beliefs: Beliefs) -> dict[str, NDArray[np.float32]]:
        """Return the same of W worlds: `grid` (W, channels * rows * columns) and `ego` (W, 4)."""
        out = np.zeros((len(beliefs), len(CHANNELS), self.rows * self.columns), np.float32)
        # In the order of the first three channels. The first, the hulls, is used again when the
        # returns are drawn.
        groups = [beliefs.hulls, *camera_layers_of(beliefs)]
        sets = CellSets.joined([group.sets for group in groups])
        counts = np.array([group.counts for group in groups])
        told = sets.cells, sets.sizes, counts, beliefs.ranges
        draw_pictures(*told, self._above, self._blocks, self._marks, out)
        # Shares are sums of float32 parts, so a full block may be slightly above 1.
        grid = np.minimum(out, 1, out=out).reshape(len(beliefs), -1)
        return {"grid": grid, "ego": self._egos(beliefs)}

    def _egos(self, beliefs: Beliefs) -> NDArray[np.float32]:
        """Return (W, 4) the `EGO_INPUTS`, scaled and clipped to -1 to 1."""
        shares = beliefs.budgets[:, None] / self.rig.grid.size
        values = np.concatenate([beliefs.egos, shares], axis=1).astype(np.float32)
        return np.asarray(np.clip(values / EGO_SCALES, -1, 1))

    @cached_property
    def _above(self) -> AboveRoad:
        return AboveRoad(self._rises, self._heights, self.rig.grid.range_m, *STANDING_M)

    @cached_property
    def _rises(self) -> NDArray[np.float64]:
        return np.ascontiguousarray(self.rig.grid.directions[:, 2])

    @cached_property
    def _heights(self) -> NDArray[np.float64]:
        rig = self.rig
        heights = np.empty(rig.grid.size)
        for head in rig.grid.heads:
            heights[head.cells] = rig.sensor_height_m + head.place[2]
        return heights

    @cached_property
    def _blocks(self) -> Cells:
        """Return (N,) the block of every cell."""
        blocks = np.empty(self.rig.grid.size, np.int64)
        blocks[self.blocks.cells] = np.arange(self.rows * self.columns)[:, None]
        return blocks

    @cached_property
    def _marks(self) -> NDArray[np.uint8]:
        """Return (N,) working memory of the kernels: marks of the first three channels."""
        return np.empty(self.rig.grid.size, np.uint8)
