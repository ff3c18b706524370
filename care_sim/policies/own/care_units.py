"""CARE that knows what its hardware fires as a whole, and spends its budget on the best of it."""

import numpy as np

from care_sim.core.allocation import allocate
from care_sim.core.arrays import Integers
from care_sim.core.belief import Belief
from care_sim.core.grid import Cells
from care_sim.core.types import Demand
from care_sim.policies.own.care_sightlines import CareSightlines
from care_sim.policies.own.target_shots import TargetShots


class CareUnits(CareSightlines):
    """`care-sightlines`, whose cells vote for the units of the hardware (`care_sim.core.firing`).

    Projected in its own order, a demand spends a unit on every first cell, however few others share
    it. Here a unit is worth the cells that it holds of those that the allocator takes. The first of
    B cells counts B, the next B - 1, down to the last, which counts 1. Of the units that can fire
    together those are demanded that are worth the most. All hold as many cells, so that they are
    worth the most per cell paid, too. With free cells that is `care-sightlines`, cell for cell.

    Where cells may be fired several times, each has the shots that what is known to stand there
    takes to return (`care_sim.policies.own.target_shots`), as far as the budget goes.
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
