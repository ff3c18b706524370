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
from care_sim.core.wrapping import Wrapping
from care_sim.policies.learned.grid_features import CHANNELS, EGO_INPUTS
from care_sim.policies.learned.weights import Weights

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
        scores: NDArray[np.float32] = self.of_all(
            {name: values[None] for name, values in observation.items()}
        )[0]
        return scores

    def of_all(self, observation: Observation) -> NDArray[np.float32]:
        """(W, elevations, azimuths) of the observations of W worlds, stacked."""
        # Products of stacks of matrices, which NumPy makes one by one: of every world the very
        # numbers that it has alone. One product of all would round otherwise.
        ego = (self._ego @ observation["ego"][..., None]).swapaxes(1, 2)
        seen = self._windows(observation["grid"]) @ self._kernel + (ego + self._bias)
        weight, bias = self._hidden
        hidden = np.maximum(np.maximum(seen, 0) @ weight.T + bias, 0)
        scores = (hidden @ self._score).reshape(-1, *self._place.shape)
        return np.asarray(np.tanh(scores + self._place))

    def _windows(self, grids: NDArray[np.float32]) -> NDArray[np.float32]:
        """(W, sectors, channels * blocks) what each sector sees; nothing beyond the grid."""
        channels, rows, columns = self._shape
        margin = BLOCK_MARGIN
        padded = np.zeros(
            (len(grids), channels, rows + 2 * margin, columns + 2 * margin), np.float32
        )
        padded[..., margin:-margin, margin:-margin] = grids.reshape(-1, *self._shape)
        # Where columns go round the car, each end continues with the other one's blocks.
        if self._goes_round:
            padded[..., :margin] = padded[..., -2 * margin : -margin]
            padded[..., -margin:] = padded[..., margin : 2 * margin]
        # Windows of neighbouring sectors overlap by the margins.
        tall, wide = self._stride
        windows = np.lib.stride_tricks.sliding_window_view(padded, self._window, axis=(2, 3))[
            ..., ::tall, ::wide, :, :
        ]
        seen = windows.transpose(0, 2, 3, 1, 4, 5)
        return seen.reshape(len(grids), -1, self._kernel.shape[0])
