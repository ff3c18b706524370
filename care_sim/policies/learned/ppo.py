"""A learned allocator: a small network, trained by proximal policy optimisation, scores sectors.

What it reads is in `care_sim.policies.learned.grid_features`, the network in `score_map`, the file
of weights in `weights`, and the training in `care_sim.training`.
"""

from os import PathLike
from typing import ClassVar

from care_sim.base.errors import InvalidInput
from care_sim.core.cells.sets import WorldSets
from care_sim.core.observation.beliefs import Beliefs
from care_sim.core.rig import Rig
from care_sim.policies.base import RowPolicy
from care_sim.policies.learned.grid_features import GridFeatures
from care_sim.policies.learned.score_map import ScoreMap
from care_sim.policies.learned.sector_choice import SectorChoice
from care_sim.policies.learned.tiling import Tiling
from care_sim.policies.learned.weights import load_weights, shipped_weights


class PpoPolicy(RowPolicy):
    """Acts as the learner does behind its wrappers, without exploration. Scores and allocator are
    the same.

    `path` is a file of weights that `care-sim train ppo` wrote. Without it those act that come with
    the package, learned on the dense street at all budgets of its tables. Raises InvalidInput for
    weights that are missing, damaged, of another kind, or made for another grid or budget.
    """

    name = "ppo"
    tags = ("causal", "learned")
    source = (
        "Schulman et al. 2017 (proximal policy optimisation), with Stable-Baselines3; learned on "
        "the dense street"
    )
    keeps_order = True
    weights: ClassVar[str] = "ppo-dense"

    def __init__(self, rig: Rig, path: str | PathLike[str] | None = None):
        super().__init__(rig)
        file = load_weights(shipped_weights(self.weights) if path is None else path)
        # Not `self.name`: weights of both streets are of the kind 'ppo'.
        file.check(PpoPolicy.name, rig)
        wrapping = file.card.wrapper
        if wrapping is None:
            raise InvalidInput(f"weights {file.path}: the card names no wrapper")
        self._reserve_alone = wrapping.action == "SectorReserve"
        self._features = GridFeatures(rig, wrapping.columns, wrapping.rows)
        sectors = Tiling(rig.grid, wrapping.azimuths, wrapping.elevations)
        self._choice = SectorChoice(rig, sectors)
        self._score_map = ScoreMap(file, wrapping, rig.grid.goes_round)

    def stages(self, beliefs: Beliefs) -> list[WorldSets]:
        """Hulls and the sectors scored above 0, best first; or, learned with `SectorScores`, the
        sectors alone.
        """
        scores = self._score_map.of_all(self._features.of_all(beliefs))
        if self._reserve_alone:
            return self._choice.reserve(beliefs, scores)
        return self._choice.alone(scores)


class PpoDartoutPolicy(PpoPolicy):
    """The same, learned on the dart-out."""

    name = "ppo-dartout"
    source = (
        "Schulman et al. 2017 (proximal policy optimisation), with Stable-Baselines3; learned on "
        "the dart-out"
    )
    weights = "ppo-dartout"
