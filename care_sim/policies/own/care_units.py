"""CARE that knows the units of its hardware, and spends its budget on the best units."""

import numpy as np

from care_sim.core.allocation import allocate
from care_sim.core.arrays import Floats, Integers
from care_sim.core.belief import Belief
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.grid import Cells
from care_sim.core.residual import wedges
from care_sim.core.rig import Rig
from care_sim.core.types import Demand, ImageDetections, Tracks
from care_sim.policies.own.box_places import ON_FOOT, box_places
from care_sim.policies.own.care import CareSightlines
from care_sim.sensors.signal import Signal

PERSON_REFLECTANCE = 0.4
"""Least reflectance of pedestrian targets at 850 to 910 nm (ISO 19206-2: 40 to 60%)."""


class TargetShots:
    """Shots per cell for a rig that models its pulses.

    A target is assumed to face the LiDAR, and a person to have the least reflectance. Paint varies,
    so a vehicle is assumed to reflect like the data sheet's target. The range of a forecast is that
    of its centre. The range of an image box follows from the typical height of its class. Both are
    from each LiDAR.
    """

    def __init__(self, rig: Rig):
        self._rig = rig
        self._most = rig.hardware.most_shots
        self._signal = Signal(rig.returns)
        vehicle = rig.returns.lidar_stated_reflectance
        self._brightness = np.where(ON_FOOT, PERSON_REFLECTANCE, vehicle)

    def of(self, belief: Belief) -> Integers:
        """Return (N,) the shots of every cell: the maximum over the hulls and wedges that hold it.
        A target that even the most shots would not show gets one shot, since it may be brighter or
        nearer. So does a cell outside all sets.
        """
        shots = np.ones(self._rig.grid.size, np.int64)
        detections, tracks = belief.detections, belief.tracks
        for sets, classes, apart in (
            (self._rig.hulls(tracks.boxes), tracks.classes, self._to_tracks(tracks)),
            (wedges(detections, self._rig), detections.classes, self._to_pictured(detections)),
        ):
            brightness = self._brightness[classes]
            useful = np.stack([self._useful(brightness, ranges) for ranges in apart])
            of_set = np.repeat(np.arange(len(sets)), sets.sizes)
            lidars = self._rig.grid.lidars_of(sets.cells)
            np.maximum.at(shots, sets.cells, useful[lidars, of_set])
        return shots

    def _useful(self, brightness: Floats, ranges: Floats) -> Integers:
        """Return (n,) the shots of one LiDAR for targets of `brightness` (n,) at `ranges` (n,)."""
        needed = self._signal.shots_needed(self._signal.intensities(brightness, ranges), ranges)
        return np.where(needed <= self._most, needed, 1).astype(np.int64)

    def _to_tracks(self, tracks: Tracks) -> list[Floats]:
        """Return (n,) metres to forecasts, from each LiDAR."""
        return [planar_ranges(head.boxes(tracks.boxes)) for head in self._rig.grid.heads]

    def _to_pictured(self, detections: ImageDetections) -> list[Floats]:
        """Return (n,) metres to the objects of image boxes, by their heights, from each LiDAR."""
        places = box_places(detections, self._rig)
        return [np.linalg.norm(head.points(places), axis=1) for head in self._rig.grid.heads]


class CareUnits(CareSightlines):
    """`care-sightlines`, whose cells vote for the units of the hardware.

    The usual projection spends a unit on every first cell, however few other cells share it. Here a
    unit's worth is the sum over its cells that the allocator takes. The first of B cells counts B,
    the next B - 1, down to 1 for the last. The demand holds the most valuable units that can fire
    together. All units hold equally many cells, so these also have the most worth per cell. With
    free cells the result is `care-sightlines`, cell for cell.

    If cells may be fired several times, each gets the shots that its known target needs to return
    (`TargetShots`), within the budget.
    """

    name = "care-units"
    source = "own: care-sightlines, its cells summed over the units that the hardware fires"

    def demand(self, belief: Belief) -> Demand:
        """Return the cells of the most valuable units, unit after unit."""
        hardware = self.rig.hardware
        cells = allocate(super().demand(belief), belief.budget, self.rig.reserve_fraction)
        counts = np.arange(len(cells), 0, -1)
        worth = np.bincount(hardware.unit_of[cells], counts, hardware.units).astype(np.float64)

        # Observations hold 0 for cells that were not fired.
        last = np.flatnonzero(belief.ranges.ravel() > 0)
        best = self._cells_of(hardware.best(worth, belief.budget, last))
        if hardware.most_shots == 1:
            return Demand(layers=[[best]])
        # The allocator counts cells, but the budget pays for shots, so they are counted here.
        shots = TargetShots(self.rig).of(belief)
        paid = np.cumsum(shots[best]) <= belief.budget
        return Demand(layers=[[best[paid]]], shots=shots)

    def _cells_of(self, units: Integers) -> Cells:
        """Return all cells of some units (k,), unit after unit, each ascending."""
        hardware = self.rig.hardware
        place = np.full(hardware.units, len(units))
        place[units] = np.arange(len(units))
        cells = np.flatnonzero(place[hardware.unit_of] < len(units))
        return cells[np.argsort(place[hardware.unit_of[cells]], kind="stable")]
