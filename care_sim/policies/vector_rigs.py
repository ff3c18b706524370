"""One policy for all worlds of a vector environment whose rigs differ, as in their budgets: worlds
of equal rigs are asked together.
"""

from collections.abc import Callable, Sequence

import numpy as np

from care_sim.core.arrays import Integers, Mask
from care_sim.core.belief import Observation
from care_sim.core.rig import Rig
from care_sim.policies.base import Policy
from care_sim.policies.vector import Actions, VectorPolicy, vector_policy


def policy_of_rigs(makers: Sequence[Callable[[], Policy]], rigs: Sequence[Rig]) -> VectorPolicy:
    """What plays W worlds, each as the policy that its one of the `makers` (W,) makes for its one
    of the `rigs` (W,) would play it alone.
    """
    groups: list[list[int]] = []
    for world, rig in enumerate(rigs):
        group = next((group for group in groups if rigs[group[0]] == rig), None)
        if group is None:
            groups.append([world])
        else:
            group.append(world)
    made = [vector_policy(makers[group[0]], len(group)) for group in groups]
    return made[0] if len(made) == 1 else _ByRig(made, list(map(np.array, groups)))


class _ByRig(VectorPolicy):
    """Of the worlds at each of the `places` one of the `policies`; `rig` is that of the first."""

    def __init__(self, policies: Sequence[VectorPolicy], places: Sequence[Integers]):
        super().__init__(policies[0].rig, sum(map(len, places)))
        self._groups = list(zip(policies, places, strict=True))
        self._table = np.zeros((self.worlds, *self.rig.grid.shape), np.float32)

    def _actions(self, observation: Observation, live: Mask) -> Actions:
        for policy, places in self._groups:
            if live[places].any():
                rows = {name: np.asarray(table)[places] for name, table in observation.items()}
                self._table[places] = policy(rows, live[places])
        return self._table.view()

    def _forget(self, mask: Mask) -> None:
        for policy, places in self._groups:
            policy.reset(mask[places])
