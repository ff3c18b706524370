"""CARE with safety-bounded forgetting."""

from dataclasses import fields

from care_sim.errors import unknown
from care_sim.forgetting import Forgetting, ForgettingRules
from care_sim.policies.base import Policy
from care_sim.residual import camera_layers
from care_sim.types import Belief, Demand, Rig


class CareSbf(Policy):
    """CARE+SBF of the paper (Sec. 4.3, Algorithm 3): hulls of harmless tracks shrink and are served
    after the full ones; the reserve layers are (U, M).

    Parameters are the fields of `ForgettingRules`, for example `k_safe=0` for unguarded forgetting.
    """

    name = "care-sbf"

    def __init__(self, rig: Rig, **rules: float):
        super().__init__(rig)
        known = [field.name for field in fields(ForgettingRules)]
        for rule in rules:
            if rule not in known:
                raise unknown("parameter of policy care-sbf", rule, known)
        self._rules = ForgettingRules(**rules)
        self.reset()

    def reset(self) -> None:
        """Forget the streaks."""
        self._forgetting = Forgetting(self._rules, self.rig.grid.column_width, self.rig.azimuth_margin)

    def demand(self, belief: Belief) -> Demand:
        """Full hulls, shrunk hulls, then the layers (U, M)."""
        margins, low = self._forgetting.margins(belief.tracks, belief.ego)
        hulls = self.rig.hulls(belief.tracks.boxes, margins)
        full = [hull for hull, is_low in zip(hulls, low, strict=True) if not is_low]
        shrunk = [hull for hull, is_low in zip(hulls, low, strict=True) if is_low]
        return Demand([*full, *shrunk], camera_layers(belief, self.rig))
