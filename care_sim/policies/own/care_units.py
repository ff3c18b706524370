"""CARE that knows what its hardware fires as a whole, and spends its budget on the best of it."""

import numpy as np

from care_sim.core.allocation import allocate
from care_sim.core.arrays import Floats, Integers
from care_sim.core.belief import Belief
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.grid import Cells
from care_sim.core.residual import ray_starts, wedge_rays, wedges
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES, Demand, ImageDetections, Tracks
from care_sim.policies.own.care import CareSightlines
from care_sim.sensors.signal import Signal
from care_sim.world.bodies import CATALOGUE

_HEIGHTS_M = np.array([CATALOGUE[name].size[2] for name in CLASSES])
"""The typical body of every class; `CATALOGUE` has their sources."""
PERSON_REFLECTANCE = 0.4
"""The least that targets of pedestrians have at 850 to 910 nm (ISO 19206-2: 40 to 60%)."""
_SHOWS_PERSON = np.isin(CLASSES, ("pedestrian", "bicycle"))


class TargetShots:
    """The shots of a rig, which tells how its pulses return.

    A target is taken to face the LiDAR. A person is as dark as one may be. Paint can be anything,
    so that a vehicle is taken for the target at which the data sheet states its range. A forecast
    is as far as its centre, an image box as far as the typical height of its class makes it, from
    each LiDAR.
    """

    def __init__(self, rig: Rig):
        self._rig = rig
        self._most = rig.hardware.most_shots
        self._signal = Signal(rig.returns)
        vehicle = rig.returns.lidar_stated_reflectance
        self._brightness = np.where(_SHOWS_PERSON, PERSON_REFLECTANCE, vehicle)

    def of(self, belief: Belief) -> Integers:
        """(N,) the shots of every cell: of those hulls and wedges that hold it, as many as the one
        needs that needs most. What even the most shots would not show has one, for it may be
        brighter or nearer; so has a cell of which nothing is known.
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
        """(n,) the shots of one LiDAR for targets of this `brightness` (n,) at these `ranges` (n,)
        from it.
        """
        needed = self._signal.shots_needed(self._signal.intensities(brightness, ranges), ranges)
        return np.where(needed <= self._most, needed, 1).astype(np.int64)

    def _to_tracks(self, tracks: Tracks) -> list[Floats]:
        """From each LiDAR, (n,) metres to forecasts."""
        return [planar_ranges(head.boxes(tracks.boxes)) for head in self._rig.grid.heads]

    def _to_pictured(self, detections: ImageDetections) -> list[Floats]:
        """From each LiDAR, (n,) metres to what image boxes show, by their heights."""
        heads = self._rig.grid.heads
        if not len(detections):
            return [np.empty(0)] * len(heads)
        cameras = self._rig.camera_models
        pixels = detections.boxes[:, 3] - detections.boxes[:, 1]
        focal = cameras.focals[detections.cameras]
        depths = focal * _HEIGHTS_M[detections.classes] / np.maximum(pixels, 1.0)
        # A depth is along the optical axis; the ray through the middle of the box is longer.
        places = depths[:, None] * wedge_rays(detections, self._rig)[:, 0]
        starts = ray_starts(detections, self._rig)
        if starts is not None:
            places += starts
        return [np.linalg.norm(head.points(places), axis=1) for head in heads]


class CareUnits(CareSightlines):
    """`care-sightlines`, whose cells vote for the units of the hardware.

    Projected in its own order, a demand spends a unit on every first cell, however few others share
    it. Here a unit is worth the cells that it holds of those that the allocator takes. The first of
    B cells counts B, the next B - 1, down to the last, which counts 1. Of the units that can fire
    together those are demanded that are worth the most. All hold as many cells, so that they are
    worth the most per cell paid, too. With free cells that is `care-sightlines`, cell for cell.

    Where cells may be fired several times, each has the shots that what is known to stand there
    takes to return (`TargetShots`), as far as the budget goes.
    """

    name = "care-units"
    source = "own: care-sightlines, its cells summed over the units that the hardware fires"

    def demand(self, belief: Belief) -> Demand:
        """The cells of the units that are worth the most, unit after unit."""
        hardware = self.rig.hardware
        cells = allocate(super().demand(belief), belief.budget, self.rig.reserve_fraction)
        counts = np.arange(len(cells), 0, -1)
        worth = np.bincount(hardware.unit_of[cells], counts, hardware.units).astype(np.float64)

        # Of a cell that was not fired an observation says 0.
        last = np.flatnonzero(belief.ranges.ravel() > 0)
        best = self._cells_of(hardware.best(worth, belief.budget, last))
        if hardware.most_shots == 1:
            return Demand(layers=[[best]])
        # The allocator counts cells. Shots are what is paid, so they are counted here.
        shots = TargetShots(self.rig).of(belief)
        paid = np.cumsum(shots[best]) <= belief.budget
        return Demand(layers=[[best[paid]]], shots=shots)

    def _cells_of(self, units: Integers) -> Cells:
        """All cells of some units (k,), unit after unit, each ascending."""
        hardware = self.rig.hardware
        place = np.full(hardware.units, len(units))
        place[units] = np.arange(len(units))
        cells = np.flatnonzero(place[hardware.unit_of] < len(units))
        return cells[np.argsort(place[hardware.unit_of[cells]], kind="stable")]
