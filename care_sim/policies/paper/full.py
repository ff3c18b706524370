"""The full scan: every cell, the bound that no budgeted policy can exceed."""

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import FixedPolicy


class Full(FixedPolicy):
    """Fires every cell. Belongs in an environment made with `budget=1.0` and refuses another."""

    name = "full"
    source = "CARE paper, Sec. 5.2 (full-scan bound)"

    def __init__(self, rig: Rig):
        super().__init__(rig)
        if rig.budget != rig.grid.size:
            raise InvalidInput(
                f"policy full needs budget=1.0, this environment fires {rig.budget} of "
                f"{rig.grid.size} cells"
            )

    def fixed(self, budget: int) -> Demand:
        """All cells, as one reserve layer: exploitation alone would stop at (1 - rho) B."""
        return Demand(layers=[[np.arange(self.rig.grid.size)]])
