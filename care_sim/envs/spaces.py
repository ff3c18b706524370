"""The spaces of the environments, and the check of an action at their door."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from care_sim.errors import InvalidInput, as_array
from care_sim.types import CLASSES, MAX_DETECTIONS, MAX_TRACKS, Rig

MAX_SPEED_MPS = 100.0
MAX_COUNT = 2.0**24
"""The largest count float32 holds exactly."""


def observation_space(rig: Rig) -> spaces.Space[Any]:
    """The bounded observation space of a rig; keys and columns as in `care_sim.types`."""
    grid = rig.grid
    far, size, turn = 2 * grid.range_m, 50.0, 4 * np.pi
    width = max(camera.width for camera in rig.cameras)
    height = max(camera.height for camera in rig.cameras)
    classes = len(CLASSES) - 1
    ego = [[0.0, -turn, -MAX_SPEED_MPS], [MAX_SPEED_MPS, turn, MAX_SPEED_MPS]]
    detections = [
        [-1, 0, 0, 0, 0, 0, 0, 0, -turn],
        [classes, 1, width, height, width, height, max(len(rig.cameras) - 1, 1), 60, turn],
    ]
    speed = MAX_SPEED_MPS
    tracks = [
        [-1, 0, -far, -far, -far, 0, 0, 0, -turn, -speed, -speed, 0, 0],
        [MAX_COUNT, classes, far, far, far, size, size, size, turn, speed, speed, MAX_COUNT, MAX_COUNT],
    ]
    return spaces.Dict(
        {
            "ego": _box(ego),
            "budget": spaces.Box(0.0, 1.0, (1,), np.float32),
            "detections": _table(detections, MAX_DETECTIONS),
            "tracks": _table(tracks, MAX_TRACKS),
            "ranges": spaces.Box(0.0, grid.range_m, grid.shape, np.float32),
        }
    )


def checked_scores(action: NDArray[np.floating], shape: tuple[int, int]) -> NDArray[np.float32]:
    """The action as float32 scores; a boolean mask is one too. Raises InvalidInput otherwise."""
    scores = as_array("action", action)
    if scores.shape != shape:
        raise InvalidInput(f"action must have shape {shape} (rows, columns), got {scores.shape}")
    if scores.dtype.kind not in "biuf":
        raise InvalidInput(f"action must hold numbers, got {scores.dtype}")
    with np.errstate(over="ignore"):
        scores = scores.astype(np.float32, copy=False)
    if not np.isfinite(scores).all():
        raise InvalidInput("action must not hold NaN or infinity (of float32); score a cell 0 to leave it out")
    return scores


def _box(bounds: Sequence[Sequence[float]]) -> spaces.Box:
    low, high = (np.asarray(bound, np.float32) for bound in bounds)
    return spaces.Box(low, high, dtype=np.float32)


def _table(bounds: Sequence[Sequence[float]], rows: int) -> spaces.Box:
    low, high = (np.tile(np.asarray(bound, np.float32), (rows, 1)) for bound in bounds)
    return spaces.Box(low, high, dtype=np.float32)
