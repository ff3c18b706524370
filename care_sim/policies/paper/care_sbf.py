"""CARE with safety-bounded forgetting."""

from inspect import Parameter, Signature, signature

from care_sim.core.belief import Belief
from care_sim.core.forgetting import Forgetting, ForgettingRules
from care_sim.core.residual import camera_layers
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy


class CareSbf(Policy):
    """CARE+SBF of the paper (Sec. 4.3, Algorithm 3): hulls of harmless tracks shrink and are served
    after the full ones; the reserve layers are (U, M).

    Parameters are the fields of `ForgettingRules`, for example `k_safe=0` for unguarded forgetting.
    """

    name = "care-sbf"
    source = "CARE paper, Sec. 4.3, Algorithm 3"

    def __init__(self, rig: Rig, **rules: float):
        super().__init__(rig)
        self._rules = ForgettingRules(**rules)
        self.reset()

    # The listing and the check of parameters read the rules and their defaults here.
    __init__.__signature__ = Signature(  # type: ignore[attr-defined]
        [Parameter(name, Parameter.POSITIONAL_OR_KEYWORD) for name in ("self", "rig")]
        + [
            rule.replace(kind=Parameter.KEYWORD_ONLY)
            for rule in signature(ForgettingRules).parameters.values()
        ]
    )

    def reset(self) -> None:
        """Forget the streaks."""
        self._forgetting = Forgetting(self._rules, self.rig)

    def demand(self, belief: Belief) -> Demand:
        """Full hulls, shrunk hulls, then the layers (U, M)."""
        hulls = self._forgetting.exploitation(belief.tracks, belief.ego)
        return Demand(hulls, camera_layers(belief, self.rig))
