"""Weights that have learned nothing: real files for the policy `ppo`, of any budget."""

import tempfile
from dataclasses import asdict
from functools import cache
from pathlib import Path

import numpy as np

from care_sim.features import CHANNELS, EGO
from care_sim.grid import AngularGrid
from care_sim.policies.score_map import MARGIN
from care_sim.policies.weights import Card, save
from care_sim.policies.wrapping import Wrapping

USUAL = Wrapping()


def shapes(wrapping, hidden=5):
    tall, wide = wrapping.blocks_a_sector
    return {
        "window.weight": (hidden, len(CHANNELS), tall + 2 * MARGIN, wide + 2 * MARGIN),
        "window.bias": (hidden,),
        "ego.weight": (hidden, len(EGO)),
        "hidden.weight": (hidden, hidden),
        "hidden.bias": (hidden,),
        "score.weight": (hidden,),
        "place": (wrapping.elevations, wrapping.azimuths),
    }


def untrained(path, wrapping=USUAL, seed=0, **card):
    rng = np.random.default_rng(seed)
    arrays = {name: rng.normal(0, 0.5, shape).astype(np.float32) for name, shape in shapes(wrapping).items()}
    save(path, arrays, Card(**{"kind": "ppo", "grid": asdict(AngularGrid()), "wrapper": str(wrapping)} | card))
    return path


@cache
def _file():
    return untrained(Path(tempfile.mkdtemp()) / "untrained.npz")


def parameters(name):
    """What a built-in policy cannot do without."""
    return {"path": _file()} if name == "ppo" else {}
