"""A learned allocator: a small network, trained by proximal policy optimisation, scores sectors.

Its inputs are in `care_sim.policies.learned.grid_features`, its file of weights in `weights`, and
its training in `care_sim.training`. The network is small and slides over the sectors.

It reads the coarse blocks of a sector, one more block on each side (also across the seam of a full
turn), and the car's own motion. Hidden layers are rectified, scores are hyperbolic tangents of

    score.weight . relu(hidden.weight relu(window.weight * blocks + ego.weight ego + window.bias) +
    hidden.bias) + place

with `place` one number per sector.
"""

from os import PathLike
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from care_sim.base.errors import InvalidInput
from care_sim.core.belief import Observation
from care_sim.core.beliefs import Beliefs
from care_sim.core.cells.sets import WorldSets
from care_sim.core.defaults import Wrapping
from care_sim.core.rig import Rig
from care_sim.policies.base import RowPolicy
from care_sim.policies.learned.grid_features import CHANNELS, EGO_INPUTS, GridFeatures
from care_sim.policies.learned.sectors import SectorChoice, Tiling
from care_sim.policies.learned.weights import Weights, load_weights, shipped_weights

BLOCK_MARGIN = 1
"""Blocks beyond a sector on every side that the network reads."""


class ScoreMap:
    """Scores of sectors from the observation of `GridObservation`. `goes_round` is True for a full
    turn. Raises InvalidInput for arrays that do not fit.
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
        """Return (elevations, azimuths) scores from -1 to 1."""
        scores: NDArray[np.float32] = self.of_all(
            {name: values[None] for name, values in observation.items()}
        )[0]
        return scores

    def of_all(self, observation: Observation) -> NDArray[np.float32]:
        """Return (W, elevations, azimuths) scores of the stacked observations of W worlds."""
        # NumPy multiplies stacks of matrices one by one, so every world has the same numbers as
        # alone. One product of all worlds would round differently.
        ego = (self._ego @ observation["ego"][..., None]).swapaxes(1, 2)
        seen = self._windows(observation["grid"]) @ self._kernel + (ego + self._bias)
        weight, bias = self._hidden
        hidden = np.maximum(np.maximum(seen, 0) @ weight.T + bias, 0)
        scores = (hidden @ self._score).reshape(-1, *self._place.shape)
        return np.asarray(np.tanh(scores + self._place))

    def _windows(self, grids: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return (W, sectors, channels * blocks) the inputs of each sector, 0 beyond the grid."""
        channels, rows, columns = self._shape
        margin = BLOCK_MARGIN
        padded = np.zeros(
            (len(grids), channels, rows + 2 * margin, columns + 2 * margin), np.float32
        )
        padded[..., margin:-margin, margin:-margin] = grids.reshape(-1, *self._shape)
        # On a full turn, each end continues with the blocks of the other.
        if self._goes_round:
            padded[..., :margin] = padded[..., -2 * margin : -margin]
            padded[..., -margin:] = padded[..., margin : 2 * margin]
        # Windows of neighbouring sectors overlap by their margins.
        tall, wide = self._stride
        windows = np.lib.stride_tricks.sliding_window_view(padded, self._window, axis=(2, 3))[
            ..., ::tall, ::wide, :, :
        ]
        seen = windows.transpose(0, 2, 3, 1, 4, 5)
        return seen.reshape(len(grids), -1, self._kernel.shape[0])


class PpoPolicy(RowPolicy):
    """A small network, trained by proximal policy optimisation, scores sectors of the grid.

    The policy acts as the learner does behind its wrappers, without exploration.

    `path` is a file of weights that `care-sim train ppo` wrote. The shipped default was learned on
    the dense street at all budgets of its tables. Raises InvalidInput for weights that are missing,
    damaged, of another kind, or made for another grid or budget.
    """

    name = "ppo"
    tags = ("causal", "learned")
    source = (
        "Schulman et al. 2017 (proximal policy optimisation), with Stable-Baselines3; learned on "
        "the dense street"
    )
    keeps_order = True
    weights: ClassVar[str] = "ppo-dense"

    def __init__(self, rig: Rig, path: str | PathLike[str] | None = None):
        super().__init__(rig)
        file = load_weights(shipped_weights(self.weights) if path is None else path)
        # Not `self.name`: weights of both scenarios are of the kind 'ppo'.
        file.check(PpoPolicy.name, rig)
        wrapping = file.card.wrapper
        if wrapping is None:
            raise InvalidInput(f"weights {file.path}: the card names no wrapper")
        self._reserve_alone = wrapping.action == "SectorReserve"
        self._features = GridFeatures(rig, wrapping.columns, wrapping.rows)
        sectors = Tiling(rig.grid, wrapping.azimuths, wrapping.elevations)
        self._choice = SectorChoice(rig, sectors)
        self._score_map = ScoreMap(file, wrapping, rig.grid.goes_round)

    def stages(self, beliefs: Beliefs) -> list[WorldSets]:
        """Return hulls and the sectors scored above 0, best first; or, if learned with
        `SectorScores`, only the sectors.
        """
        scores = self._score_map.of_all(self._features.of_all(beliefs))
        if self._reserve_alone:
            return self._choice.reserve(beliefs, scores)
        return self._choice.alone(scores, beliefs.budgets)


class PpoDartoutPolicy(PpoPolicy):
    """The policy `ppo`, learned on the dart-out."""

    name = "ppo-dartout"
    source = (
        "Schulman et al. 2017 (proximal policy optimisation), with Stable-Baselines3; learned on "
        "the dart-out"
    )
    weights = "ppo-dartout"
