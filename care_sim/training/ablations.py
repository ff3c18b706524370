"""What a learner can be trained without, to see what that was worth.

| without | what is taken away |
|---|---|
| `pictures` | all six pictures: what is left is the car's motion, the budget and the place |
| `place` | the number of its own that each sector has: what is seen alone decides its score |
| `tracks` | all that forecasts tell in the pictures; the allocator goes on to fire at their hulls |
| `faults` | faults of the camera in the training episodes; those of the validation keep them |

Pictures are taken away by a matrix before the first layer. It is multiplied into the weights that
are kept, which therefore act in NumPy like any others. Tracks are in four pictures: `forecast` and
`undetected` vanish, and `residual` and `explained`, which forecasts tell apart, become one. `fired`
and `nearness` stay: they show the last scan, hulls at which the allocator fired among the rest.
"""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from care_sim.policies.learned.grid_features import CHANNELS


def mixing(without: Collection[str]) -> NDArray[np.float32]:
    """(channels, channels) of what is seen, from what the pictures show; the unit matrix where none
    is taken away.
    """
    matrix = np.eye(len(CHANNELS), dtype=np.float32)
    if "tracks" in without:
        forecast, residual, explained, undetected = (
            CHANNELS.index(name) for name in ("forecast", "residual", "explained", "undetected")
        )
        matrix[[forecast, undetected, explained]] = 0
        matrix[residual, explained] = 1
    return matrix * ("pictures" not in without)
