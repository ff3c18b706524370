"""Camera boxes and tracks as a set, each with a learned chance; cells go where they gain most."""

from collections.abc import Mapping
from os import PathLike
from typing import ClassVar

import numpy as np

from care_sim.base.checks import check_number, check_whole
from care_sim.core.arrays import Floats
from care_sim.core.belief import Belief
from care_sim.core.conditions import MIN_RETURNS
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy
from care_sim.policies.learned.set_items import ITEM_INPUTS, STRIP_INPUTS, ItemReader, Items
from care_sim.policies.learned.set_kernels import Numbers, best_cells
from care_sim.policies.learned.weights import Weights, load_weights, shipped_weights

STEPS = (3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 48)
"""Numbers of an item's first cells at which the network predicts whether three have returned."""
LEARNED_RETURNS = 3
"""Returns per detection in the training. A detector that needs n times as many is assumed to need n
times the cells.
"""


class SetNetwork:
    """The network of some weights. Raises InvalidInput for weights of another form.

    Items pass a layer of rectified units. One attention head combines all items (Vaswani et al.,
    Attention is all you need, 2017), and a second layer reads both. Strips have a map of their
    places and one layer of units.
    """

    def __init__(self, weights: Weights, places: int):
        units = weights.array("first", len(ITEM_INPUTS), None).shape[1]
        width = weights.array("query", units, None).shape[1]
        shapes: dict[str, tuple[int | None, ...]] = {
            "first": (len(ITEM_INPUTS), units),
            "first_bias": (units,),
            "query": (units, width),
            "key": (units, width),
            "value": (units, units),
            "second": (2 * units, units),
            "second_bias": (units,),
            "out": (units, len(STEPS) + 1),
            "out_bias": (len(STEPS) + 1,),
            "map": (places,),
        }
        strip_units = weights.array("strip", len(STRIP_INPUTS), None).shape[1]
        shapes |= {
            "strip": (len(STRIP_INPUTS), strip_units),
            "strip_bias": (strip_units,),
            "strip_out": (strip_units,),
        }
        # In float64, rounded at the end. Processors and libraries sum in different orders, and
        # differences in the last bits would swap cells of nearly equal gain.
        self._of = {
            name: weights.array(name, *shape).astype(np.float64) for name, shape in shapes.items()
        }

    def chances(self, items: Items) -> Numbers:
        """Return (n, `STEPS`) the chance that each item's object has returned three times after
        these numbers of cells.
        """
        of = self._of
        if not len(items.inputs):
            return np.zeros((0, len(STEPS)), np.float32)
        units = np.maximum(items.inputs @ of["first"] + of["first_bias"], 0)
        scores = (units @ of["query"]) @ (units @ of["key"]).T / np.sqrt(of["query"].shape[1])
        told = _softmax(scores) @ (units @ of["value"])
        both = np.hstack([units, told])
        units = np.maximum(both @ of["second"] + of["second_bias"], 0)
        shares = _softmax(units @ of["out"] + of["out_bias"])
        # The last share belongs to items without such an object.
        return np.cumsum(shares[:, :-1], axis=1).astype(np.float32)

    def strip_chances(self, items: Items, places: np.ndarray) -> Numbers:
        """Return (S,) the chance that a strip detects an object without a box and a track."""
        of = self._of
        units = np.maximum(items.strips @ of["strip"] + of["strip_bias"], 0)
        logits = units @ of["strip_out"] + of["map"][places]
        chances: Floats = 1 / (1 + np.exp(-np.clip(logits, -30, 30)))
        return chances.astype(np.float32)


def _softmax(scores: Floats) -> Floats:
    powers = np.exp(scores - scores.max(axis=1, keepdims=True))
    shares: Floats = powers / powers.sum(axis=1, keepdims=True)
    return shares


REFRESH_PER_S = 0.3
"""Worth of detecting again an object that was last detected a second ago; an untracked object is
worth 1, the maximum. Chosen on the streets 2000 to 2003 and the drives 2000 to 2023, none of which
is scored.
"""


class LearnedSets(Policy):
    """Camera boxes and tracks as a set, each with a learned chance; cells go where they gain most.

    Camera boxes, tracks and strips of other cells are the items of a set. A small network with
    attention over the items predicts for each the chance that its first 3, 4, 5, ... cells detect
    an object. The budget's cells go, piece by piece, where a cell gains most.

    An object without a track is worth 1. An object with a track is worth `refresh_per_s` for every
    second since its last detection. So the network learns which items to serve, and with how many
    cells. Detected or undetectable objects get no cells. An item's cells begin with the undilated
    core (`core-spread`), unless the rig has an order. There are no exploitation sets: the share rho
    plays no part.

    `path` is a file of weights that `care-sim train learned-sets` wrote, by default the shipped
    one. Weights serve any budget and any cameras. Raises InvalidInput for another kind of file or
    another grid.
    """

    name = "learned-sets"
    tags = ("causal", "learned")
    source = "own: attention over camera boxes and tracks, cells by what they gain"
    told: ClassVar[Mapping[str, str]] = {"min_returns": "min_returns"}
    keeps_order = True

    def __init__(
        self,
        rig: Rig,
        path: str | PathLike[str] | None = None,
        min_returns: int = MIN_RETURNS,
        refresh_per_s: float = REFRESH_PER_S,
    ):
        super().__init__(rig)
        check_whole("min_returns", min_returns, 1)
        check_number("refresh_per_s", refresh_per_s, 0, 1000)
        weights = load_weights(shipped_weights(self.name) if path is None else path)
        weights.check(self.name, rig)
        steps = np.ceil(np.array(STEPS) / LEARNED_RETURNS * min_returns)
        self._steps = np.minimum(steps, rig.grid.size).astype(np.int64)
        self._items = ItemReader(rig, int(self._steps[-1]))
        self._network = SetNetwork(weights, int(self._items.places.max()) + 1)
        self._refresh_per_s = refresh_per_s

    def demand(self, belief: Belief) -> Demand:
        """Return one layer of one set: the cells by descending gain."""
        items = self._items.of(belief)
        unseen_s = (belief.tracks.misses + 1) * self.rig.keyframe_s
        worth = np.ones(len(items.sets), np.float32)
        worth[items.boxes :] = np.minimum(self._refresh_per_s * unseen_s, 1)
        cells = best_cells(
            items.sets.cells,
            items.sets.sizes,
            self._steps,
            self._network.chances(items) * worth[:, None],
            self._items.strips,
            self._network.strip_chances(items, self._items.places),
            belief.budget,
            np.zeros(self.rig.grid.size, np.bool_),
        )
        return Demand(layers=[[cells]])
