"""Weights that have learned nothing: real files for the policy `ppo`, of any budget, and for the
detector `pillars`.
"""

import numpy as np

from care_sim.core.defaults import Wrapping
from care_sim.core.grid import AngularGrid
from care_sim.perception.pillars.detector import CALIBRATION, array_shapes, save_detector
from care_sim.policies.learned.grid_features import CHANNELS, EGO_INPUTS
from care_sim.policies.learned.ppo import BLOCK_MARGIN
from care_sim.policies.learned.weights import Card, save_weights

USUAL = Wrapping()


def shapes(wrapping, hidden=5):
    tall, wide = wrapping.blocks_per_sector
    return {
        "window.weight": (hidden, len(CHANNELS), tall + 2 * BLOCK_MARGIN, wide + 2 * BLOCK_MARGIN),
        "window.bias": (hidden,),
        "ego.weight": (hidden, len(EGO_INPUTS)),
        "hidden.weight": (hidden, hidden),
        "hidden.bias": (hidden,),
        "score.weight": (hidden,),
        "place": (wrapping.elevations, wrapping.azimuths),
    }


def untrained(path, wrapping=USUAL, seed=0, **card):
    rng = np.random.default_rng(seed)
    arrays = {
        name: rng.normal(0, 0.5, shape).astype(np.float32)
        for name, shape in shapes(wrapping).items()
    }
    save_weights(
        path,
        arrays,
        Card(**{"kind": "ppo", "grid": AngularGrid(), "wrapper": wrapping} | card),
    )
    return path


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
