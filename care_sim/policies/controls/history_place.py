"""A control: history with its reserve on the map of `place`, without a camera."""

from os import PathLike

from care_sim.core.belief import Belief
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy
from care_sim.policies.controls.place import likeliest_cells


class HistoryPlace(Policy):
    """The hulls of the history policy; the reserve goes to the map of `place`."""

    name = "history-place"
    tags = ("causal", "learned", "control")
    source = "own: history, and a map that never changes"
    keeps_order = True

    def __init__(self, rig: Rig, path: str | PathLike[str] | None = None):
        super().__init__(rig)
        self._pattern = likeliest_cells(rig, path)

    def demand(self, belief: Belief) -> Demand:
        """Hulls, then the map."""
        hulls = self.rig.listed(self.rig.hulls(belief.tracks.boxes))
        return Demand(hulls, [[self._pattern[: belief.budget]]])
