"""What a learned agent sees of a belief: coarse pictures of the angular grid, and its own motion.

The pictures hold values from 0 to 1, the motion values from -1 to 1.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from care_sim.base.checks import check_whole
from care_sim.core.belief import Belief, Observation
from care_sim.core.cells.sets import CellSets
from care_sim.core.grid import Cells
from care_sim.core.observation.beliefs import Beliefs
from care_sim.core.residual import camera_layers_of
from care_sim.core.rig import Rig
from care_sim.perception.cluster.road import KERB_CLEARANCE_M
from care_sim.policies.learned.block_kernels import AboveRoad, draw_pictures
from care_sim.policies.learned.tiling import Tiling

CHANNELS = ("forecast", "residual", "explained", "nearness", "fired", "undetected")
"""The pictures, in order; see `care_sim.envs.wrappers.grid_observation.GridObservation`."""
EGO_INPUTS = ("speed", "yaw_rate", "acceleration", "budget")
EGO_SCALES = np.array([30.0, 1.0, 10.0, 1.0], np.float32)
"""m/s, rad/s, m/s^2 and the share of the cells that are shown as 1."""
STANDING_M = (KERB_CLEARANCE_M, 4.0)
"""Heights above the road between which a return stands for something: over kerbs, under the bodies
of bridges and the crowns of trees. The tallest of the five classes are lower.
"""


@dataclass(frozen=True)
class GridFeatures:
    """Beliefs of a rig as pictures and a vector.

    The pictures are `CHANNELS` over `columns` x `rows` blocks of the grid, the vector `EGO_INPUTS`.
    A block of `nearness` takes the largest value of its cells, one of the other channels a share of
    them. Raises InvalidInput unless the blocks divide the grid. Not for several threads at once,
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
        """`grid` (channels * rows * columns,) and `ego` (4,), both float32."""
        return {name: rows[0] for name, rows in self.of_all(Beliefs.of(belief, self.rig)).items()}

    def of_all(self, beliefs: Beliefs) -> dict[str, NDArray[np.float32]]:
        """The same of W worlds: `grid` (W, channels * rows * columns) and `ego` (W, 4)."""
        out = np.zeros((len(beliefs), len(CHANNELS), self.rows * self.columns), np.float32)
        # In the order of the first three channels; where the first, the hulls, lie is asked again
        # when the returns are drawn.
        groups = [beliefs.hulls, *camera_layers_of(beliefs)]
        sets = CellSets.joined([group.sets for group in groups])
        counts = np.array([group.counts for group in groups])
        told = sets.cells, sets.sizes, counts, beliefs.ranges
        draw_pictures(*told, self._above, self._blocks, self._marks, out)
        # Shares are sums of float32 parts, and a full block may end a little above 1.
        grid = np.minimum(out, 1, out=out).reshape(len(beliefs), -1)
        return {"grid": grid, "ego": self._egos(beliefs)}

    def _egos(self, beliefs: Beliefs) -> NDArray[np.float32]:
        """(W, 4) the `EGO_INPUTS`, scaled and clipped to -1 to 1."""
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
        """(N,) the block of every cell."""
        blocks = np.empty(self.rig.grid.size, np.int64)
        blocks[self.blocks.cells] = np.arange(self.rows * self.columns)[:, None]
        return blocks

    @cached_property
    def _marks(self) -> NDArray[np.uint8]:
        """(N,) memory of the kernels: which of the first three channels a cell lies in."""
        return np.empty(self.rig.grid.size, np.uint8)
