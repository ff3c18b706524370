"""One policy for all worlds of a vector environment: what each would ask for alone, in one call.

An idea that goes by rows is asked once for the rows of all worlds, and one that never changes once
for all keyframes. Of any other there is a policy for every world. Worlds whose rigs
differ, as in their budgets, are asked together with those of equal rigs.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Integers, Mask
from care_sim.core.belief import Observation
from care_sim.core.beliefs import Beliefs, check_observed
from care_sim.core.cells.sets import WorldSets
from care_sim.core.firing.actions import Allocator
from care_sim.core.rig import Rig
from care_sim.core.types import Action
from care_sim.policies.base import FixedPolicy, Policy, RowPolicy

Actions = NDArray[np.float32]
"""A score per world and cell, (W, E, A)."""


class VectorPolicy(ABC):
    """A policy of `worlds` worlds with the same `rig`. To call it is to ask for an action of each,
    once a keyframe.
    """

    def __init__(self, rig: Rig, worlds: int):
        self.rig = rig
        self.worlds = worlds

    def reset(self, mask: Mask | None = None) -> None:
        """Forget the episodes of the worlds in the mask (W,), of all without one; called before
        each begins. Raises InvalidInput for another mask.
        """
        self._forget(self._mask("mask", mask))

    def __call__(self, observation: Observation, live: Mask | None = None) -> Actions:
        """The actions (W, E, A) for the observation of a vector environment, of each world what
        its policy asks for alone. They are read-only, and the next call overwrites them. Of worlds
        that are not `live` (W,) nothing is read or remembered, and their actions mean nothing.

        Raises InvalidInput for what is no observation of its rig and worlds, and for another mask.
        """
        wanted = self._mask("live", live)
        check_observed(observation, self.rig, self.worlds)
        actions = self._actions(observation, wanted)
        actions.flags.writeable = False
        return actions

    @abstractmethod
    def _actions(self, observation: Observation, live: Mask) -> Actions:
        """The actions; what is made of the array is read-only."""

    @abstractmethod
    def _forget(self, mask: Mask) -> None:
        """See `reset`."""

    def _mask(self, name: str, mask: Mask | None) -> Mask:
        if mask is None:
            return np.ones(self.worlds, np.bool_)
        given = np.asarray(mask)
        if given.shape != (self.worlds,) or given.dtype != np.bool_:
            raise InvalidInput(f"{name} must be {self.worlds} truth values, got {shown(mask)}")
        return given


def vector_policy(make: Callable[[], Policy], worlds: int) -> VectorPolicy:
    """Return what plays so many worlds, each as a policy that `make` makes would play it alone."""
    first = make()
    if isinstance(first, RowPolicy) and _asks_as(first, RowPolicy):
        return _ByRows(first, worlds)
    if isinstance(first, FixedPolicy) and _asks_as(first, FixedPolicy):
        return _Fixed(first, worlds)
    return _OneEach([first, *(make() for _ in range(worlds - 1))])


def _asks_as(policy: Policy, kind: Any) -> bool:
    """Whether a policy of a kind has its idea where the kind has it alone, and no memory: somebody
    may have changed it elsewhere.
    """
    asked = ("__call__", "_cells", "demand", "remember", "reset")
    return all(
        getattr(type(policy), name) is getattr(kind, name) and name not in vars(policy)
        for name in asked
    )


class _ByRows(VectorPolicy):
    """All worlds by the rows of all."""

    def __init__(self, policy: RowPolicy, worlds: int):
        super().__init__(policy.rig, worlds)
        self._policy = policy
        self._allocator = Allocator(policy.rig, worlds)

    def _actions(self, observation: Observation, live: Mask) -> Actions:
        beliefs = Beliefs.from_observation(observation, self.rig, live)
        stages = self._policy.stages(beliefs)
        for stage in stages:
            self._check(stage)
        if not self._policy.keeps_order:
            stages = [WorldSets(self.rig.listed(sets), counts) for sets, counts in stages]
        return self._allocator.scores(stages, beliefs.budgets)

    def _check(self, stage: WorldSets) -> None:
        """Raise InvalidInput for sets that compiled code would follow out of its tables."""
        sets, counts = stage
        name, cells = self._policy.name or type(self._policy).__name__, self.rig.grid.size
        # One look at all: as numbers without a sign, those below 0 are the largest.
        if sets.cells.view(np.uint64).max(initial=0) >= cells:
            raise InvalidInput(f"policy {name}: cells must lie in 0..{cells - 1}")
        if counts.shape != (self.worlds,) or counts.sum() != len(sets):
            raise InvalidInput(
                f"policy {name}: counts must tell of {self.worlds} worlds how many of the "
                f"{len(sets)} sets are of each, got {shown(counts.tolist())}"
            )

    def _forget(self, mask: Mask) -> None:
        pass


class _Fixed(VectorPolicy):
    """The same action in all worlds at all keyframes, made once for every budget that is told."""

    def __init__(self, policy: FixedPolicy, worlds: int):
        super().__init__(policy.rig, worlds)
        self._policy = policy
        self._table = np.zeros((worlds, *policy.rig.grid.shape), np.float32)
        self._budgets = np.full(worlds, np.nan, np.float32)

    def _actions(self, observation: Observation, live: Mask) -> Actions:
        budgets = np.asarray(observation["budget"])[:, 0]
        for world in np.flatnonzero(live & (budgets != self._budgets)).tolist():
            self._table[world] = self._policy(_world(observation, world))
            self._budgets[world] = budgets[world]
        return self._table.view()

    def _forget(self, mask: Mask) -> None:
        pass


class _OneEach(VectorPolicy):
    """A policy of its own for every world."""

    def __init__(self, policies: Sequence[Policy]):
        super().__init__(policies[0].rig, len(policies))
        self._policies = policies
        self._table = np.zeros((self.worlds, *self.rig.grid.shape), np.float32)

    def _actions(self, observation: Observation, live: Mask) -> Actions:
        for world in np.flatnonzero(live).tolist():
            action: Action = self._policies[world](_world(observation, world))
            # One of another shape would be spread over all cells.
            if np.shape(action) != self.rig.grid.shape:
                raise InvalidInput(
                    f"action must have shape {self.rig.grid.shape} (rows, columns), "
                    f"got {np.shape(action)}"
                )
            self._table[world] = action
        return self._table.view()

    def _forget(self, mask: Mask) -> None:
        for world in np.flatnonzero(mask).tolist():
            self._policies[world].reset()


def _world(observation: Observation, world: int) -> Observation:
    """The observation of one world."""
    return {name: tables[world] for name, tables in observation.items()}


def policy_of_rigs(makers: Sequence[Callable[[], Policy]], rigs: Sequence[Rig]) -> VectorPolicy:
    """Return what plays W worlds, each as the policy that its one of the `makers` (W,) makes for
    its one of the `rigs` (W,) would play it alone.
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
    """Worlds by rig: the worlds at each of the `places` have one of the `policies`; `rig` is that
    of the first.
    """

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
