"""One policy for all worlds of a vector environment: the same actions as one policy per world, in
one call.

A row policy computes the rows of all worlds at once, a fixed policy all keyframes at once. Any
other policy has an instance per world. Worlds are grouped by rig.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.base.errors import InvalidInput, shown
from care_sim.base.threads import ALONE, Threads
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
    """A policy of `worlds` worlds with the same `rig`. A call returns an action per world, once per
    keyframe.
    """

    def __init__(self, rig: Rig, worlds: int):
        self.rig = rig
        self.worlds = worlds

    def reset(self, mask: Mask | None = None) -> None:
        """Forget the episodes of the worlds in the mask (W,), by default of all; called before each
        begins. Raises InvalidInput for another mask.
        """
        self._forget(self._mask("mask", mask))

    def __call__(self, observation: Observation, live: Mask | None = None) -> Actions:
        """Return the actions (W, E, A) for the observation of a vector environment, for each world
        those of its policy alone. They are read-only, and the next call overwrites them. Worlds
        that are not `live` (W,) are neither read nor remembered, and their actions are undefined.

        Raises InvalidInput for an observation that does not fit its rig and worlds, and for another
        mask.
        """
        wanted = self._mask("live", live)
        check_observed(observation, self.rig, self.worlds)
        actions = self._actions(observation, wanted)
        actions.flags.writeable = False
        return actions

    @abstractmethod
    def _actions(self, observation: Observation, live: Mask) -> Actions:
        """Return the actions; the caller makes the array read-only."""

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


def vector_policy(
    make: Callable[[], Policy], worlds: int, threads: Threads = ALONE
) -> VectorPolicy:
    """Return the vector policy of this many worlds, each played as by a single policy of `make`.
    The `threads` share the compiled work.
    """
    first = make()
    if isinstance(first, RowPolicy) and _asks_as(first, RowPolicy):
        return _ByRows(first, worlds, threads)
    if isinstance(first, FixedPolicy) and _asks_as(first, FixedPolicy):
        return _Fixed(first, worlds)
    return _OneEach([first, *(make() for _ in range(worlds - 1))])


def _asks_as(policy: Policy, kind: Any) -> bool:
    """Return True if a policy overrides only its kind's own method and has no memory: foreign code
    may override others.
    """
    asked = ("__call__", "_cells", "demand", "remember", "reset")
    return all(
        getattr(type(policy), name) is getattr(kind, name) and name not in vars(policy)
        for name in asked
    )


class _ByRows(VectorPolicy):
    """All worlds at once, by the rows of all."""

    def __init__(self, policy: RowPolicy, worlds: int, threads: Threads):
        super().__init__(policy.rig, worlds)
        self._policy = policy
        self._allocator = Allocator(policy.rig, worlds, threads)

    def _actions(self, observation: Observation, live: Mask) -> Actions:
        beliefs = Beliefs.from_observation(observation, self.rig, live)
        stages = self._policy.stages(beliefs)
        for stage in stages:
            self._check(stage)
        if not self._policy.keeps_order:
            stages = [WorldSets(self.rig.listed(sets), counts) for sets, counts in stages]
        return self._allocator.scores(stages, beliefs.budgets)

    def _check(self, stage: WorldSets) -> None:
        """Raise InvalidInput for sets with cells outside the tables of compiled code."""
        sets, counts = stage
        name, cells = self._policy.name or type(self._policy).__name__, self.rig.grid.size
        # One comparison covers both bounds: as unsigned numbers, those below 0 are the largest.
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
    """The same action in all worlds at all keyframes, made once per budget."""

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
    """One policy per world."""

    def __init__(self, policies: Sequence[Policy]):
        super().__init__(policies[0].rig, len(policies))
        self._policies = policies
        self._table = np.zeros((self.worlds, *self.rig.grid.shape), np.float32)

    def _actions(self, observation: Observation, live: Mask) -> Actions:
        for world in np.flatnonzero(live).tolist():
            action: Action = self._policies[world](_world(observation, world))
            # An action of another shape would be broadcast over all cells.
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
    """Return the observation of one world."""
    return {name: tables[world] for name, tables in observation.items()}


def policy_of_rigs(
    makers: Sequence[Callable[[], Policy]], rigs: Sequence[Rig], threads: Threads = ALONE
) -> VectorPolicy:
    """Return the vector policy of W worlds, each played as by the policy of its `makers` (W,) entry
    for its `rigs` (W,) entry. The `threads` share the compiled work.
    """
    groups: list[list[int]] = []
    for world, rig in enumerate(rigs):
        group = next((group for group in groups if rigs[group[0]] == rig), None)
        if group is None:
            groups.append([world])
        else:
            group.append(world)
    made = [vector_policy(makers[group[0]], len(group), threads) for group in groups]
    return made[0] if len(made) == 1 else _ByRig(made, list(map(np.array, groups)))


class _ByRig(VectorPolicy):
    """Worlds grouped by rig: the worlds at each of the `places` have one of the `policies`; `rig`
    is that of the first.
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
