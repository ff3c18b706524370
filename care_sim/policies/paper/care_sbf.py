"""CARE with safety-bounded forgetting."""

from care_sim.core.belief import Belief
from care_sim.core.forgetting import Forgetting, ForgettingRules
from care_sim.core.residual import camera_layers
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy


class CareSbf(Policy):
    """CARE+SBF of the paper (Sec. 4.3, Algorithm 3).

    Hulls of harmless tracks shrink and are served after the full ones; the reserve layers are
    (U, M).

    Parameters are the fields of `ForgettingRules`, with their units and bounds, for example
    `k_safe=0` for unguarded forgetting. Raises InvalidInput for a value out of its bounds.
    """

    name = "care-sbf"
    source = "CARE paper, Sec. 4.3, Algorithm 3"

    def __init__(
        self,
        rig: Rig,
        *,
        k_safe: float = ForgettingRules.k_safe,
        standstill_m: float = ForgettingRules.standstill_m,
        headway_s: float = ForgettingRules.headway_s,
        static_mps: float = ForgettingRules.static_mps,
        receding_mps: float = ForgettingRules.receding_mps,
        position_sigma_m: float = ForgettingRules.position_sigma_m,
        decay_per_keyframe: float = ForgettingRules.decay_per_keyframe,
    ):
        super().__init__(rig)
        self._rules = ForgettingRules(
            k_safe=k_safe,
            standstill_m=standstill_m,
            headway_s=headway_s,
            static_mps=static_mps,
            receding_mps=receding_mps,
            position_sigma_m=position_sigma_m,
            decay_per_keyframe=decay_per_keyframe,
        )
        self.reset()

    def reset(self) -> None:
        """Forget the streaks."""
        self._forgetting = Forgetting(self._rules, self.rig)

    def remember(self, belief: Belief) -> None:
        """Advance the streaks."""
        self._forgetting.advance(belief.tracks, belief.ego)

    def demand(self, belief: Belief) -> Demand:
        """Full hulls, shrunk hulls, then the layers (U, M)."""
        hulls = self._forgetting.exploitation(belief.tracks)
        return Demand(hulls, camera_layers(belief, self.rig))
