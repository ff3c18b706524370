"""The beliefs of several worlds at once: the rows of their tables lie one after the other."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.base.checks import as_array
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.belief import HIGHEST, OBSERVED, Belief, Observation
from care_sim.core.cell_sets import CellSets
from care_sim.core.residual import _first_explaining, wedges
from care_sim.core.rig import Rig
from care_sim.core.types import ImageDetections, Tracks


class Beliefs:
    """What W worlds of a rig know at a keyframe.

    `egos` (W, 3) are speed, yaw rate and acceleration, `budgets` (W,) cells, `ranges` (W, N) the
    last scans in metres. `detections` and `tracks` are those of all worlds, world after world:
    `detection_ends` and `track_ends` (W,) say where each world's end.
    """

    def __init__(
        self,
        rig: Rig,
        egos: Floats,
        budgets: Floats,
        ranges: NDArray[np.float32],
        rows: tuple[ImageDetections, Integers],
        tracked: tuple[Tracks, Integers],
    ):
        self.egos = egos
        self.budgets = budgets
        self.ranges = ranges
        self.detections, self.detection_ends = rows
        self.tracks, self.track_ends = tracked
        self._rig = rig

    @classmethod
    def of(cls, belief: Belief, rig: Rig) -> "Beliefs":
        """That of one world."""
        ego, detections, tracks = belief.ego, belief.detections, belief.tracks
        return cls(
            rig,
            np.array([[ego.speed, ego.yaw_rate, ego.acceleration]]),
            np.array([belief.budget]),
            belief.ranges.reshape(1, -1),
            (detections, np.array([len(detections)])),
            (tracks, np.array([len(tracks)])),
        )

    @classmethod
    def read(cls, observation: Observation, rig: Rig) -> "Beliefs":
        """Those of the observations of W worlds, stacked as a vector environment gives them; what
        `Rig.read` reads of each, and refuses of any. They keep nothing of the arrays but `ranges`.
        """
        egos, budgets, ranges, tables = _stacked(observation, rig)
        # All worlds are read as one belief: the rows of its tables are theirs, its picture is as
        # high as theirs together.
        flat = {name: table.reshape(-1, table.shape[-1]) for name, table in tables.items()}
        one = {"ego": egos[0], "budget": budgets[0], "ranges": ranges.reshape(-1, ranges.shape[-1])}
        every = Belief.from_observation(flat | one)
        cameras = every.detections.cameras
        if not ((cameras >= 0) & (cameras < len(rig.cameras))).all():
            raise InvalidInput(
                f"detections of an observation must be of cameras 0 to {len(rig.cameras) - 1}"
            )
        ends = {
            name: np.cumsum(np.count_nonzero(table[..., 0] != -1, axis=1))
            for name, table in tables.items()
        }
        size = rig.grid.size
        return cls(
            rig,
            egos.astype(np.float64),
            np.rint(budgets[:, 0].astype(np.float64) * size),
            every.ranges.reshape(-1, size),
            (every.detections, ends["detections"]),
            (every.tracks, ends["tracks"]),
        )

    def __len__(self) -> int:
        return len(self.egos)

    @cached_property
    def hulls(self) -> CellSets:
        """The dilated hull of every track."""
        return self._rig.hulls(self.tracks.boxes)

    @cached_property
    def wedges(self) -> CellSets:
        """The wedge of every detection."""
        return wedges(self.detections, self._rig)

    @cached_property
    def explained(self) -> Mask:
        """Whether a forecast of its own world explains each detection."""
        detections, tracks = self.detections, self.tracks
        if not len(detections):
            return np.zeros(0, np.bool_)
        matched = _first_explaining(
            np.ascontiguousarray(detections.boxes),
            np.ascontiguousarray(detections.classes),
            np.ascontiguousarray(detections.cameras),
            np.ascontiguousarray(detections.yaw_changes),
            np.ascontiguousarray(tracks.boxes[:, :3]),
            np.ascontiguousarray(tracks.classes),
            np.diff(self.detection_ends, prepend=0),
            np.diff(self.track_ends, prepend=0),
            self._rig.camera_models,
        )
        explained: Mask = matched >= 0
        return explained


def _stacked(observation: Observation, rig: Rig) -> tuple[Any, Any, Any, dict[str, NDArray[Any]]]:
    """Motions (W, 3), budgets (W, 1), range images (W, E, A) and tables (W, m, k). Raises
    InvalidInput for other shapes, and for vectors of what no sensor says.
    """
    if not (isinstance(observation, Mapping) and observation.keys() >= {*OBSERVED}):
        raise InvalidInput(
            "an observation of CARE-Sim's environments is needed, as they give it without wrappers"
        )
    arrays = {name: as_array(f"{name} of an observation", observation[name]) for name in OBSERVED}
    worlds = len(arrays["budget"]) if arrays["budget"].ndim else 0
    forms = {
        "ego": (worlds, 3),
        "budget": (worlds, 1),
        "detections": (worlds, None, len(ImageDetections.COLUMNS)),
        "tracks": (worlds, None, len(Tracks.COLUMNS)),
        "ranges": (worlds, *rig.grid.shape),
    }
    for name, form in forms.items():
        shape = arrays[name].shape
        fits = len(shape) == len(form) and all(
            wanted in (None, n) for n, wanted in zip(shape, form, strict=True)
        )
        if not (worlds and fits and arrays[name].dtype.kind in "iuf"):
            raise InvalidInput(
                f"{name} of the observations of several worlds must be numbers of the shape "
                f"{form}, got {arrays[name].dtype} of {shape}"
            )
    egos, budgets = arrays.pop("ego"), arrays.pop("budget")
    if not ((np.abs(egos) <= HIGHEST).all() and ((budgets >= 0) & (budgets <= 1)).all()):
        raise InvalidInput(
            f"ego of an observation must hold numbers up to {HIGHEST:g}, its budget lie in [0, 1]"
        )
    return egos, budgets, arrays.pop("ranges"), arrays
