"""What `learned-sets` can be trained without, to see what that was worth.

| without | what is taken away |
|---|---|
| `attention` | what an item is told of the others |
| `inputs` | what is told of an item, but its kind, and of a strip, but its place |
| `place` | the map of the strips: one chance for all places |
| `faults` | faults of the camera in the worlds that are learned from |

A kind is a camera box that a track explains, one that no track explains, or a track. So without
`attention`, `inputs` and `place` what is learned are constants: for each kind the shares of items
that are found after so many cells, and one chance for all strips. It is the control of what
learning is worth beside the choice of cells, which stays.

Weights that are taken away are 0 and stay it; those of the map learn as one. So the file has the
form of any other, and acts as such.
"""

from collections.abc import Collection

import numpy as np

from care_sim.base.array_files import Arrays
from care_sim.policies.learned.set_items import ITEM_INPUTS, STRIP_INPUTS

KIND = ("is a camera box", "explained")
"""The inputs that tell an item's kind."""


def kept_weights(without: Collection[str]) -> Arrays:
    """By the name of an array, 1 for the weights that learn and 0 for those that are taken away, of
    a form that can be multiplied with it. Arrays of which all is kept are not named, nor is the
    map, of which one chance is left.
    """
    kept: Arrays = {}
    if "attention" in without:
        kept["value"] = np.zeros(1, np.float32)
    if "inputs" in without:
        kept["first"] = np.isin(ITEM_INPUTS, KIND).astype(np.float32)[:, None]
        kept["strip"] = np.zeros((len(STRIP_INPUTS), 1), np.float32)
    return kept
