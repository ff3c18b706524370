"""Jitter of camera boxes: they lie a little beside the object, larger or smaller than it."""

from collections.abc import Sequence

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.pinhole import PinholeCamera

LEAST_PX = 1.0
"""Width and height that a box keeps within its picture."""


def jittered(
    boxes: Floats,
    draws: Floats,
    spreads: Floats,
    of_cameras: Integers,
    cameras: Sequence[PinholeCamera],
) -> Floats:
    """(n, 4) image `boxes` (n, 4) after Gaussian errors, cut at the edges of their pictures.

    `spreads` (n, 4) are relative to the box: of its middle across and down, and of the logarithms
    of its width and height. `draws` (n, 4) from 0 to 1 decide; 0.5 leaves a box as it is.
    `of_cameras` (n,) are places in `cameras`.
    """
    from scipy.special import ndtri

    across, down, wider, higher = (ndtri(draws) * spreads).T
    sizes = boxes[:, 2:] - boxes[:, :2]
    middles = (boxes[:, :2] + boxes[:, 2:]) / 2 + sizes * np.column_stack([across, down])
    half = sizes * np.exp(np.column_stack([wider, higher])) / 2
    # Of a box at the edge something stays in the picture: it was seen there.
    pictures = np.array([(camera.width, camera.height) for camera in cameras], float)
    limits = pictures.reshape(-1, 2)[of_cameras]
    low = np.clip(middles - half, 0.0, limits - LEAST_PX)
    high = np.clip(middles + half, low + LEAST_PX, limits)
    return np.concatenate([low, high], axis=1)
