"""Widths and speed limit of every street here, and ranges that a seed draws from."""

import numpy as np

Range = tuple[float, float]
"""Low and high. The seed draws uniformly between them."""

SPEED_LIMIT_MPS = 30 / 3.6
"""All scenarios take place in a 30 km/h zone, the residential default of many European cities."""
LANE_WIDTH_M = 3.5
"""Of a traffic lane (German RASt 06)."""
PARKING_WIDTH_M = 2.5
"""Of a parking lane that lorries may use (RASt 06)."""
PAVEMENT_WIDTH_M = 2.5
"""Between parking lane and houses (RASt 06)."""


def draw(rng: np.random.Generator, values: Range) -> float:
    """A uniform draw from a range (low, high)."""
    return float(rng.uniform(*values))
