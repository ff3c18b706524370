"""History with a learned reserve: cells in which objects without a track are likely to return."""

from os import PathLike

import numpy as np
from numpy.typing import NDArray

from care_sim.core.allocation import half_up
from care_sim.core.belief import Belief
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy
from care_sim.policies.learned.cell_inputs import (
    CELL_MARKS,
    RIG_INPUTS,
    SCAN_INPUTS,
    CellFeatures,
    CellInputs,
    MarkWeights,
    RigTerms,
    network_scores,
)
from care_sim.policies.learned.weights import Weights, load_weights, shipped_weights


class LearnedScorer(Policy):
    """The learned scorer of the paper (Sec. 5.1): history with a learned reserve.

    A small network scores every cell (`care_sim.policies.learned.cell_inputs`), and the reserve
    demands the rho B highest. Budget for cells that exploitation already took goes to the floor, as
    with `history-uniform`.

    `path` is a file of weights that `care-sim train learned-scorer` wrote, by default the shipped
    one. Weights serve any budget and any cameras. Raises InvalidInput for another kind of file or
    another grid.
    """

    name = "learned-scorer"
    tags = ("causal", "learned")
    source = "CARE paper, Sec. 5.1 (learned), after Lang et al., SampleNet, CVPR 2020"

    def __init__(self, rig: Rig, path: str | PathLike[str] | None = None):
        super().__init__(rig)
        weights = load_weights(shipped_weights(self.name) if path is None else path)
        weights.check(self.name, rig)
        self._inputs = CellInputs(rig)
        self._network = CellNetwork(weights, self._inputs.rig_inputs)
        # The reserve is the rest after exploitation, as Algorithm 1 rounds it.
        self._reserve = rig.budget - half_up((1 - rig.reserve_fraction) * rig.budget)

    def demand(self, belief: Belief) -> Demand:
        """Return the hulls, then the cells of the highest scores."""
        hulls = self.rig.hulls(belief.tracks.boxes)
        return Demand(
            hulls, [[highest(self._network.scores(self._inputs.of(belief, hulls)), self._reserve)]]
        )


class CellNetwork:
    """The network over cells with fixed inputs of the rig (N, `RIG_INPUTS`)."""

    def __init__(self, weights: Weights, rig_inputs: NDArray[np.float32]):
        # The first layer is linear, so its sum splits into parts. The parts of the rig and of each
        # code of marks are computed once. A keyframe looks them up and adds two products.
        layer = weights.array("layer", SCAN_INPUTS + len(RIG_INPUTS), None)
        units = layer.shape[1]
        self._out = weights.array("out", units)
        hidden = rig_inputs @ layer[SCAN_INPUTS:] + weights.array("bias", units)
        self._rig_terms = RigTerms(hidden, np.maximum(hidden, 0) @ self._out)
        by_size, by_nearness = np.ascontiguousarray(layer[len(CELL_MARKS) : SCAN_INPUTS])
        self._mark_weights = MarkWeights(_by_code(layer[: len(CELL_MARKS)]), by_size, by_nearness)

    def scores(self, seen: CellFeatures) -> NDArray[np.float32]:
        """Return (N,) scores of cells, higher where an untracked object is likelier."""
        return network_scores(*seen, self._rig_terms, self._mark_weights, self._out)


def _by_code(layer: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (256, h) the contribution of every code of marks to the units, from the weights of
    marks (8, h).
    """
    codes = np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], axis=1, bitorder="little")
    return codes.astype(np.float32) @ layer


def highest(scores: NDArray[np.float32], count: int) -> Cells:
    """Return the `count` cells of the highest scores, ascending. If scores are equal, the lowest
    index is taken.
    """
    if not 0 < count < len(scores):
        return np.arange(len(scores))[:count]
    # A partition, not a sort: the order among the highest does not matter.
    least = np.partition(scores, -count)[-count]
    above = np.flatnonzero(scores > least)
    equal = np.flatnonzero(scores == least)[: count - len(above)]
    return np.sort(np.concatenate([above, equal]))
