"""What learned agents see of the beliefs of several worlds, whose rows lie one after the other."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats
from care_sim.core.belief import HIGHEST, OBSERVED, Belief, Observation, array_of
from care_sim.core.belief_kernels import lie_between
from care_sim.core.beliefs import Beliefs
from care_sim.core.cell_sets import CellSets
from care_sim.core.residual import camera_layers_of
from care_sim.core.rig import Rig
from care_sim.core.world_sets import WorldSets


class Seen:
    """The `beliefs` of W worlds of a rig, their motion `egos` (W, 3: speed, yaw rate, acceleration)
    and their last scans `ranges` (W, N) in metres.
    """

    def __init__(self, rig: Rig, beliefs: Beliefs, egos: Floats, ranges: NDArray[np.float32]):
        self.beliefs = beliefs
        self.egos = egos
        self.ranges = ranges
        self._rig = rig
        # Along the axes of a tilted grid boxes and rays are told by a product of matrices, whose
        # last bits hang on how many rows there are. There every world is asked alone.
        self._is_tilted = any(head.grid.is_tilted for head in rig.grid.heads)

    @classmethod
    def of(cls, belief: Belief, rig: Rig) -> "Seen":
        """What one world shows."""
        ego = belief.ego
        egos = np.array([[ego.speed, ego.yaw_rate, ego.acceleration]])
        return cls(rig, Beliefs.of(belief), egos, belief.ranges.reshape(1, -1))

    @classmethod
    def read(cls, observation: Observation, rig: Rig) -> "Seen":
        """What W worlds show, as a vector environment gives their observations.

        Raises InvalidInput as `care_sim.core.rig.Rig.read` does for the observation of one.
        """
        if not (hasattr(observation, "keys") and observation.keys() >= {*OBSERVED}):
            raise InvalidInput(
                "an observation of CARE-Sim's environments is needed,"
                " as they give it without wrappers"
            )
        worlds = len(array_of(observation, "budget", 2, 1))
        beliefs = Beliefs.from_observation(observation, rig, np.ones(worlds, np.bool_))
        ranges = array_of(observation, "ranges", 3, None).astype(np.float32, copy=False)
        flat = np.ascontiguousarray(ranges).reshape(worlds, -1)
        if not lie_between(flat, 0.0, HIGHEST):
            raise InvalidInput("an observation's ranges must be numbers of 0 or more")
        egos = array_of(observation, "ego", 2, 3).astype(np.float64)
        return cls(rig, beliefs, egos, flat)

    def __len__(self) -> int:
        return len(self.egos)

    @cached_property
    def hulls(self) -> WorldSets:
        """The dilated hull of every forecast."""
        if self._is_tilted and len(self) > 1:
            return _joined([one.hulls for one in self._each])
        return WorldSets(self._rig.hulls(self.beliefs.tracks.boxes), self.beliefs.tracked)

    @cached_property
    def camera_layers(self) -> tuple[WorldSets, WorldSets]:
        """The wedges of unexplained and of explained detections."""
        if self._is_tilted and len(self) > 1:
            unexplained, known = zip(*(one.camera_layers for one in self._each), strict=True)
            return _joined(unexplained), _joined(known)
        return camera_layers_of(self.beliefs, self._rig)

    @cached_property
    def _each(self) -> "list[Seen]":
        """What each world shows, alone."""
        beliefs = self.beliefs
        detections = np.split(np.arange(len(beliefs.detections)), np.cumsum(beliefs.detected)[:-1])
        tracks = np.split(np.arange(len(beliefs.tracks)), np.cumsum(beliefs.tracked)[:-1])
        alone = []
        for world, (found, known) in enumerate(zip(detections, tracks, strict=True)):
            own = slice(world, world + 1)
            counts = beliefs.detected[own], beliefs.tracked[own], beliefs.budgets[own]
            rows = beliefs.detections.take(found), beliefs.tracks.take(known)
            alone.append(Seen(self._rig, Beliefs(*rows, *counts), self.egos[own], self.ranges[own]))
        return alone


def _joined(parts: "list[WorldSets] | tuple[WorldSets, ...]") -> WorldSets:
    sets = CellSets.joined([part.sets for part in parts])
    return WorldSets(sets, np.concatenate([part.counts for part in parts]))
