"""The network of learned allocators in NumPy: one small network slides over the sectors and scores
each.

It sees the coarse blocks of a sector and one block more on each side, over the seam of a grid that
goes all round, too, and the car's own motion. Hidden layers are rectified, scores are hyperbolic
tangents of

    score.weight . relu(hidden.weight relu(window.weight * blocks + ego.weight ego + window.bias) +
    hidden.bias) + place

with `place` one number per sector.
"""

import numpy as np
from numpy.typing import NDArray

from care_sim.core.belief import Observation
from care_sim.policies.learned.grid_features import CHANNELS, EGO_INPUTS
from care_sim.policies.learned.weights import Weights
from care_sim.policies.learned.wrapping import Wrapping

BLOCK_MARGIN = 1
"""Blocks seen beyond a sector on every side."""


class ScoreMap:
    """Scores of sectors from the observation of `GridObservation`; `goes_round` says whether the
    grid does. Raises InvalidInput for arrays that do not fit.
    """

    def __init__(self, weights: Weights, wrapping: Wrapping, goes_round: bool = True):
        self._goes_round = goes_round
        self._shape = len(CHANNELS), wrapping.rows, wrapping.columns
        self._stride = wrapping.blocks_per_sector
        self._window = tuple(blocks + 2 * BLOCK_MARGIN for blocks in self._stride)
        kernel = weights.array("window.weight", None, len(CHANNELS), *self._window)
        hidden = len(kernel)
        # The convolution is one product of matrices: windows (sectors, inputs) by (inputs, hidden).
        self._kernel = np.ascontiguousarray(kernel.reshape(hidden, -1).T)
        self._bias = weights.array("window.bias", hidden)
        self._ego = weights.array("ego.weight", hidden, len(EGO_INPUTS))
        self._hidden = (
            weights.array("hidden.weight", hidden, hidden),
            weights.array("hidden.bias", hidden),
        )
        self._score = weights.array("score.weight", hidden)
        self._place = weights.array("place", wrapping.elevations, wrapping.azimuths)

    def __call__(self, observation: Observation) -> NDArray[np.float32]:
        """(elevations, azimuths) from -1 to 1."""
        seen = self._windows(observation["grid"]) @ self._kernel + (
            self._ego @ observation["ego"] + self._bias
        )
        weight, bias = self._hidden
        hidden = np.maximum(np.maximum(seen, 0) @ weight.T + bias, 0)
        return np.asarray(np.tanh((hidden @ self._score).reshape(self._place.shape) + self._place))

    def _windows(self, grid: NDArray[np.float32]) -> NDArray[np.float32]:
        """(sectors, channels * blocks) what each sector sees; nothing beyond the grid."""
        channels, rows, columns = self._shape
        padded = np.zeros(
            (channels, rows + 2 * BLOCK_MARGIN, columns + 2 * BLOCK_MARGIN), np.float32
        )
        padded[:, BLOCK_MARGIN:-BLOCK_MARGIN, BLOCK_MARGIN:-BLOCK_MARGIN] = grid.reshape(
            self._shape
        )
        # Where columns go round the car, each end continues with the other one's blocks.
        if self._goes_round:
            padded[:, :, :BLOCK_MARGIN] = padded[:, :, -2 * BLOCK_MARGIN : -BLOCK_MARGIN]
            padded[:, :, -BLOCK_MARGIN:] = padded[:, :, BLOCK_MARGIN : 2 * BLOCK_MARGIN]
        # Windows of neighbouring sectors overlap by the margins.
        tall, wide = self._stride
        windows = np.lib.stride_tricks.sliding_window_view(padded, self._window, axis=(1, 2))[
            :, ::tall, ::wide
        ]
        return windows.transpose(1, 2, 0, 3, 4).reshape(-1, self._kernel.shape[0])
