"""A small network over a set of items, in NumPy: every item sees all others by attention."""

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.policies.learned.set_items import ITEM_INPUTS, STRIP_INPUTS, Items
from care_sim.policies.learned.set_kernels import Numbers
from care_sim.policies.learned.weights import Weights

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
