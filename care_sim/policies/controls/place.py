"""A control: where first sightings were in other streets, without camera, tracks or memory."""

from os import PathLike

import numpy as np
from numpy.typing import NDArray

from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import FixedPolicy
from care_sim.policies.controls.rows import cells_by_row
from care_sim.policies.learned.weights import load_weights, shipped_weights


class Place(FixedPolicy):
    """Fires the cells in which most first sightings were detected in the calibration's streets. It
    knows a place and sees nothing: what a policy with a camera must beat.

    `path` is a map that `care-sim train place` wrote; the shipped one, unless given. Raises
    InvalidInput for a file of something else or made for another grid.
    """

    name = "place"
    tags = ("causal", "learned", "control")
    source = "own: a map that never changes"
    is_pattern = True

    def __init__(self, rig: Rig, path: str | PathLike[str] | None = None):
        super().__init__(rig)
        self._pattern = likeliest_cells(rig, path)

    def fixed(self, budget: int) -> Demand:
        """The same cells at every keyframe."""
        return Demand(layers=[[self._pattern[:budget]]])


def likeliest_cells(rig: Rig, path: str | PathLike[str] | None) -> Cells:
    """(N,) all cells, those with most first sightings first; of equals, as `rows` has them."""
    weights = load_weights(shipped_weights("place") if path is None else path)
    weights.check("place", rig)
    return likeliest_first(rig, weights.array("sightings", *rig.grid.shape).ravel())


def likeliest_first(rig: Rig, sightings: NDArray[np.floating]) -> Cells:
    """(N,) all cells, those with the highest `sightings` (N,) first; of equals, as `rows` has
    them.
    """
    # Most cells of a map have none: without the rows, larger budgets would go to the sky.
    rows = cells_by_row(rig)
    return rows[np.argsort(-sightings[rows], kind="stable")]
