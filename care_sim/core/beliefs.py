"""Beliefs of several worlds, as the rows of all: what goes row by row is then done once for all of
them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from care_sim.base.errors import InvalidInput
from care_sim.core.allocation import halves_up
from care_sim.core.arrays import ONE_WORLD, Floats, Integers, Mask
from care_sim.core.belief import (
    HIGHEST,
    OBSERVED,
    Belief,
    Observation,
    array_of,
    lie_between,
    rows_of,
)
from care_sim.core.cells.sets import WorldSets
from care_sim.core.rig import Rig
from care_sim.core.types import ImageDetections, Tracks


@dataclass(eq=False)
class Beliefs:
    """The beliefs of W worlds of one `rig` (`care_sim.core.belief.Belief`).

    `egos` (W, 3) are speed, yaw rate and acceleration, `budgets` (W,) cells, `scans` (W, E, A) the
    images of the last scans. `detections` and `tracks` are those of all worlds, those of one world
    after those of another: so many of each are `detected` and `tracked` (W,). Worlds that are not
    `live` (W,) have no rows, and their numbers are 0 or mean nothing.
    """

    rig: Rig
    live: Mask
    egos: Floats
    budgets: Integers
    scans: NDArray[np.float32]
    detections: ImageDetections
    tracks: Tracks
    detected: Integers
    tracked: Integers

    @classmethod
    def of(cls, belief: Belief, rig: Rig) -> "Beliefs":
        """Return the belief of one world in this form."""
        ego, detections, tracks = belief.ego, belief.detections, belief.tracks
        counts = np.array([len(detections), len(tracks), belief.budget])
        egos = np.array([[ego.speed, ego.yaw_rate, ego.acceleration]])
        rows = detections, tracks, counts[:1], counts[1:2]
        return cls(rig, ONE_WORLD, egos, counts[2:], belief.ranges[None], *rows)

    @classmethod
    def from_observation(
        cls, observation: Observation, rig: Rig, live: Mask | None = None
    ) -> "Beliefs":
        """Read an observation of a vector environment, of worlds that are not `live` (W,) nothing.
        It keeps nothing of the arrays but the images.

        Raises InvalidInput as `care_sim.core.rig.Rig.read` does for the observation of one; for an
        image that no sensor gives, `ranges` does.
        """
        if live is None:
            _check_names(observation)
            live = np.ones(len(array_of(observation, "budget", 2, 1)), np.bool_)
        check_observed(observation, rig, len(live))
        scans = array_of(observation, "ranges", 3, None).astype(np.float32, copy=False)
        egos, budgets = (array_of(observation, name, 2, None)[live] for name in ("ego", "budget"))
        if not (lie_between(egos, -HIGHEST, HIGHEST) and lie_between(budgets, 0.0, 1.0)):
            raise InvalidInput(
                f"ego of an observation must hold numbers up to {HIGHEST:g}, its budget lie in "
                "[0, 1]"
            )
        found, detected = _table(observation, "detections", ImageDetections.COLUMNS, live)
        known, tracked = _table(observation, "tracks", Tracks.COLUMNS, live)
        detections = ImageDetections.from_checked_rows(found)
        rig.check_cameras(detections)
        own = np.zeros((len(live), 3))
        own[live] = egos
        cells = np.zeros(len(live), np.int64)
        cells[live] = halves_up(budgets[:, 0].astype(np.float64) * rig.grid.size)
        rows = detections, Tracks.from_checked_rows(known), detected, tracked
        return cls(rig, live, own, cells, scans, *rows)

    def __len__(self) -> int:
        return len(self.budgets)

    @cached_property
    def ranges(self) -> NDArray[np.float32]:
        """(W, N) the last scans in metres. Raises InvalidInput for numbers that no sensor measures.
        Checked lazily, because the check takes longer than all the others.
        """
        ranges = np.ascontiguousarray(self.scans).reshape(len(self), -1)
        if not lie_between(ranges if self.live.all() else ranges[self.live], 0.0, HIGHEST):
            raise InvalidInput("ranges of an observation must be numbers of 0 or more")
        return ranges

    @cached_property
    def hulls(self) -> WorldSets:
        """The hulls of all forecasts. Tracks come nearest first in every world, and their hulls
        keep that order.
        """
        return WorldSets(self.rig.hulls(self.tracks.boxes), self.tracked)

    def unturned(self) -> "Beliefs":
        """The same as if no car had turned since its pictures."""
        return replace(self, detections=self.detections.unturned())


def check_observed(observation: Observation, rig: Rig, worlds: int) -> None:
    """Raise InvalidInput for what is no observation of so many worlds with a rig."""
    _check_names(observation)
    wanted = {
        "ego": (worlds, 3),
        "budget": (worlds, 1),
        "ranges": (worlds, *rig.grid.shape),
    }
    for name, shape in wanted.items():
        if (got := np.shape(observation[name])) != shape:
            raise InvalidInput(f"{name} of an observation must be {shape}, got {got}")
    for name in ("detections", "tracks"):
        if (got := np.shape(observation[name]))[:1] != (worlds,):
            raise InvalidInput(f"{name} of an observation must be of {worlds} worlds, got {got}")


def _check_names(observation: Observation) -> None:
    if not (isinstance(observation, Mapping) and observation.keys() >= {*OBSERVED}):
        raise InvalidInput(
            "an observation of CARE-Sim's environments is needed, as they give it without wrappers"
        )


def _table(
    observation: Observation, key: str, columns: tuple[str, ...], live: Mask
) -> tuple[Floats, Integers]:
    tables: NDArray[np.floating] = array_of(observation, key, 3, len(columns))
    return rows_of(tables, live, key, columns)
