"""How sure the camera's detector is of a box, by the visible pixels of what it shows."""

from typing import TypeVar

import numpy as np

from care_sim.core.arrays import Floats

MIN_PIXELS = 12
"""Visible pixels below which an object has no box. At 320 x 180 this is 4 x 12 pixels at 640 x 360,
and an unoccluded adult at about 40 m."""
FULL_CONFIDENCE = 3 * MIN_PIXELS
"""Visible pixels at which n / (n + FULL_CONFIDENCE) is one half; the least box then has confidence
0.25, the detector threshold of the paper."""

Pixels = TypeVar("Pixels", float, Floats)


def confidence_of(pixels: Pixels) -> Pixels:
    """The confidence, from 0 to 1, of a box of so many visible pixels."""
    return pixels / (pixels + FULL_CONFIDENCE)


def pixels_of(confidences: Floats) -> Floats:
    """(n,) the visible pixels that would give these confidences, very many for 1."""
    # c = n / (n + F) solved for n; a confidence of 1 would need infinitely many.
    return FULL_CONFIDENCE * confidences / np.maximum(1 - confidences, 1e-12)
