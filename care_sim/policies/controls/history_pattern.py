"""What the controls share that follow their tracks and reserve for a pattern, without a camera."""

from care_sim.core.belief import Belief
from care_sim.core.types import Demand
from care_sim.policies.base import Policy


class HistoryPattern(Policy):
    """The hulls of the history policy; the reserve goes to what a `pattern` asks for."""

    keeps_order = True

    def __init__(self, pattern: Policy):
        super().__init__(pattern.rig)
        self._pattern = pattern

    def demand(self, belief: Belief) -> Demand:
        """Hulls, then the pattern."""
        hulls = self.rig.listed(self.rig.hulls(belief.tracks.boxes))
        return Demand(hulls, self._pattern.demand(belief).layers)
