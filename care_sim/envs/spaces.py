"""The spaces of the environments, and the check of an action."""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from care_sim.base.checks import as_array
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats
from care_sim.core.belief import MAX_DETECTIONS, MAX_TRACKS
from care_sim.core.observation.limits import Limits
from care_sim.core.rig import Rig


def observation_space(rig: Rig) -> spaces.Space[Any]:
    """The bounded observation space of a rig.

    Keys and columns are as in `care_sim.core.types`, bounds as in
    `care_sim.core.observation.limits`.
    """
    grid = rig.grid
    limits = Limits(rig)
    return spaces.Dict(
        {
            "ego": _box(limits.ego),
            "budget": spaces.Box(0.0, 1.0, (1,), np.float32),
            "detections": _table(limits.detections, MAX_DETECTIONS),
            "tracks": _table(limits.tracks, MAX_TRACKS),
            "ranges": spaces.Box(0.0, grid.range_m, grid.shape, np.float32),
        }
    )


def checked_scores(action: NDArray[np.floating], shape: tuple[int, ...]) -> NDArray[np.float32]:
    """The action as float32 scores; a boolean mask is one too. Raises InvalidInput otherwise."""
    scores = as_array("action", action)
    if scores.shape != shape:
        raise InvalidInput(f"action must have shape {shape} (rows, columns), got {scores.shape}")
    if scores.dtype.kind not in "biuf":
        raise InvalidInput(f"action must hold numbers, got {scores.dtype}")
    if scores.dtype != np.float32:
        # What overflows float32 becomes infinite, and is refused below.
        with np.errstate(over="ignore"):
            scores = scores.astype(np.float32)
    if not np.isfinite(scores).all():
        raise InvalidInput(
            "action must not hold NaN or infinity (of float32); score a cell 0 to leave it out"
        )
    return scores


def _box(bounds: Floats) -> spaces.Box:
    low, high = (np.asarray(bound, np.float32) for bound in bounds)
    return spaces.Box(low, high, dtype=np.float32)


def _table(bounds: Floats, rows: int) -> spaces.Box:
    low, high = (np.tile(np.asarray(bound, np.float32), (rows, 1)) for bound in bounds)
    return spaces.Box(low, high, dtype=np.float32)
