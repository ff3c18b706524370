"""Weights of the detector `pillars` that nobody trained."""

import numpy as np

from care_sim.perception.pillars.detector import CALIBRATION, array_shapes, save_detector


def drawn_arrays(seed=0):
    """Arrays of a network that answers something, with logits as scores."""
    rng = np.random.default_rng(seed)
    made = {
        name: (rng.standard_normal(shape) / np.sqrt(max(np.prod(shape[1:]), 20))).astype(np.float32)
        for name, shape in array_shapes().items()
    }
    made[CALIBRATION][:] = 1, 0
    return made


def drawn_weights(path, seed=0):
    """A file of them."""
    save_detector(path, drawn_arrays(seed), {"kind": "pillars"})
    return path
