"""The paper's policies with a reserve for camera detections: all-camera, CARE, CARE with a second
reserve layer, and CARE with safety-bounded forgetting.
"""

from care_sim.base.checks import check_flag
from care_sim.core.belief import Belief
from care_sim.core.beliefs import Beliefs
from care_sim.core.cells.sets import WorldSets
from care_sim.core.forgetting import Forgetting, ForgettingRules
from care_sim.core.residual import camera_layers, camera_layers_of, unexplained_layer_of, wedges_of
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy, RowPolicy


class AllCamera(RowPolicy):
    """The all-camera control of the paper (Sec. 5.1).

    It is history plus one reserve layer with the wedges of every camera detection. It lacks only
    the residual filter of CARE.

    With `unexplained_first` the reserve has the layers (U, M), as in `CarePriority`: the other
    reading of a reserve for every detection. Its cells then differ from those of CARE only where
    the unexplained wedges do not fill the reserve.
    """

    name = "all-camera"
    source = "CARE paper, Sec. 5.1"

    def __init__(self, rig: Rig, *, unexplained_first: bool = False):
        super().__init__(rig)
        check_flag("unexplained_first", unexplained_first)
        self._unexplained_first = unexplained_first

    def stages(self, beliefs: Beliefs) -> list[WorldSets]:
        """Return the hulls, then the wedges of all detections, in one layer or in two."""
        if self._unexplained_first:
            return [beliefs.hulls, *camera_layers_of(beliefs)]
        return [beliefs.hulls, wedges_of(beliefs)]


class Care(RowPolicy):
    """The camera-residual reserve of the paper (Sec. 4.2, Algorithm 2).

    It is history plus the layer U of unexplained wedges. Without a camera detection it is the
    history policy, cell for cell.

    With `yaw_compensation`, wedges and the match with forecasts are turned by the car's change of
    yaw since the picture (Sec. 5.5). Otherwise a late box is treated as new.
    """

    name = "care"
    source = "CARE paper, Sec. 4.2, Algorithm 2"

    def __init__(self, rig: Rig, *, yaw_compensation: bool = True):
        super().__init__(rig)
        check_flag("yaw_compensation", yaw_compensation)
        self._yaw_compensation = yaw_compensation

    def stages(self, beliefs: Beliefs) -> list[WorldSets]:
        """Return the hulls, then the wedges of the residual."""
        if not self._yaw_compensation:
            beliefs = beliefs.unturned()
        return [beliefs.hulls, unexplained_layer_of(beliefs)]


class CarePriority(RowPolicy):
    """The priority-ordering variant of the paper (Sec. 4.2): CARE with the layers (U, M).

    The wedges of unexplained detections fill first, then those of explained ones. Nothing is
    forgotten.
    """

    name = "care-priority"
    source = "CARE paper, Sec. 4.2"

    def stages(self, beliefs: Beliefs) -> list[WorldSets]:
        """Return the hulls, then the layers (U, M)."""
        return [beliefs.hulls, *camera_layers_of(beliefs)]


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
        """Return full hulls, shrunk hulls, then the layers (U, M)."""
        hulls = self._forgetting.exploitation(belief.tracks)
        return Demand(hulls, camera_layers(belief, self.rig))
