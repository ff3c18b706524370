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
"""Cells of an item, in its order, after which it is asked whether three have returned."""
LEARNED_RETURNS = 3
"""What a detection needed where it was learned. One that needs n times as many is taken to need n
times the cells."""


class SetNetwork:
    """The network of some weights. Raises InvalidInput for weights of another form.

    Items pass a layer of rectified units; one head of scaled dot products tells each of all
    others; a second layer of units reads both (Vaswani et al., Attention is all you need, 2017).
    Strips have a map of their places and one layer of units.
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
        # In float64, and rounded at the end: what a processor or a library sums in another order
        # differs in last bits, by which two cells of nearly one gain would change places.
        self._of = {
            name: weights.array(name, *shape).astype(np.float64) for name, shape in shapes.items()
        }

    def chances(self, items: Items) -> Numbers:
        """(n, `STEPS`) that an object of each item has returned three times after so many cells."""
        of = self._of
        if not len(items.inputs):
            return np.zeros((0, len(STEPS)), np.float32)
        units = np.maximum(items.inputs @ of["first"] + of["first_bias"], 0)
        scores = (units @ of["query"]) @ (units @ of["key"]).T / np.sqrt(of["query"].shape[1])
        told = _softmax(scores) @ (units @ of["value"])
        both = np.hstack([units, told])
        units = np.maximum(both @ of["second"] + of["second_bias"], 0)
        shares = _softmax(units @ of["out"] + of["out_bias"])
        # The last share is that of items without such an object.
        return np.cumsum(shares[:, :-1], axis=1).astype(np.float32)

    def strip_chances(self, items: Items, places: np.ndarray) -> Numbers:
        """(S,) that a strip finds an object of which no box and no track tells."""
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
"""What it is worth to detect again an object that was last detected a second ago, beside 1 for an
object that has no track; it is worth 1 at most. Chosen on the streets 2000 to 2003 and the drives
2000 to 2023, none of which is scored."""


class LearnedSets(Policy):
    """Camera boxes and tracks as a set, each with a learned chance; cells go where they gain most.

    Every camera box and every track is an item of a set, and so are strips of cells for whatever
    neither tells of. A small network with attention over the items says of each the chance that
    its first 3, 4, 5, ... cells detect an object. The cells of the budget go, piece by piece, where
    a cell gains most.

    An object without a track is worth 1, one with a track `refresh_per_s` for every second since
    it was last detected. So which items are served, and with how many cells, is learned; nothing
    is spent on what is found already or cannot be found. The cells of an item are listed with the
    undilated core first (`core-spread`), unless the rig has an order. There are no exploitation
    sets: the share rho plays no part.

    `path` is a file of weights that `care-sim train learned-sets` wrote; without it the shipped
    ones act. They serve any budget and any cameras. Raises InvalidInput for a file of something
    else or one made for another grid.
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
        """One layer of one set: the cells in the order of what they gain."""
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
