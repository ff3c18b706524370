"""Base classes of policies: a Belief in, a Demand out; the shared allocator does the rest. A
privileged policy also gets the truth, as a separate argument.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np

from care_sim.base.checks import as_array
from care_sim.base.errors import InvalidInput
from care_sim.core.allocation import allocate
from care_sim.core.arrays import Integers
from care_sim.core.belief import Belief, Observation
from care_sim.core.beliefs import Beliefs
from care_sim.core.cells.sets import WorldSets
from care_sim.core.firing.actions import scores_of
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.core.types import Action, Demand
from care_sim.loops.truth import Truth

TAGS = ("causal", "privileged", "non-causal", "learned", "generator", "control")
"""Tags of policies. "causal": it knows what a car knows. "privileged": it gets truth. "non-causal":
it chooses from a full scan. "learned": it has trained weights. "generator": it uses the generator
of the scenes. "control": it is no contender, and `all` leaves it out.
"""
TOLD = ("min_returns", "scenario")
"""Settings of an environment that `Policy.told` may name. They are public, and none reveals the
running episode.
"""


class Policy(ABC):
    """A scripted policy. Subclasses state the idea and its source, and implement `demand`. Policies
    with a memory also implement `remember` and `reset`. A call of the policy runs both, once per
    keyframe.

    `rig` holds the fixed parts of the sensing task: grid, cameras, budget, reserve fraction,
    keyframe. `tags` are some of `TAGS`, `source` is the citation in one line. `told` maps
    parameters to the settings in `TOLD` from which `make_policy` fills them by default.

    Two flags keep the demand as it is under every `cell_order` of the rig. `keeps_order`: the
    policy itself calls `Rig.listed` for its hulls and wedges. `is_pattern`: the policy uses neither
    and fires the same under every order.

    `files` are files outside its package that decide what it does, such as weights: when one
    changes, episodes are played again. Relative names count from the module. `demanded` is the last
    result of `demand`, in the order of serving, for viewers.
    """

    name: ClassVar[str] = ""
    tags: ClassVar[tuple[str, ...]] = ("causal",)
    source: ClassVar[str] = ""
    told: ClassVar[Mapping[str, str]] = {}
    keeps_order: ClassVar[bool] = False
    is_pattern: ClassVar[bool] = False
    files: ClassVar[Sequence[str | Path]] = ()
    demanded: Demand | None = None

    def __init__(self, rig: Rig):
        self.rig = rig

    def reset(self) -> None:
        """Forget the episode; called before each one."""

    def remember(self, belief: Belief) -> None:
        """Store the belief of the next keyframe; called once per keyframe, before `demand`. A
        policy's memory changes only here and in `reset`.
        """

    @abstractmethod
    def demand(self, belief: Belief) -> Demand:
        """Return the demand on the allocator at this keyframe: the sets and layers of Algorithm 1.
        It depends only on the belief and the memory: another call returns the same.
        """

    def __call__(self, observation: Observation) -> Action:
        """Return the action (E, A) for an observation.

        Raises InvalidInput for an observation that does not fit the rig. Also raises it if `demand`
        returns no Demand, or a cell outside the grid.
        """
        belief = self.rig.read(observation)
        try:
            cells = self._cells(belief)
            return scores_of(cells, self.rig.grid.shape, self._asked_shots(cells))
        except InvalidInput as error:
            raise InvalidInput(f"policy {self.name or type(self).__name__}: {error}") from error

    def _cells(self, belief: Belief) -> Cells:
        self.remember(belief)
        demand = self.demand(belief)
        if not isinstance(demand, Demand):
            raise InvalidInput(f"demand must return a Demand, got {type(demand).__name__}")
        if not (self.keeps_order or self.is_pattern):
            demand = self.rig.in_cell_order(demand)
        self.demanded = demand
        cells = allocate(demand, belief.budget, self.rig.reserve_fraction)
        if cells.min(initial=0) < 0 or cells.max(initial=0) >= self.rig.grid.size:
            raise InvalidInput(f"cells must lie in 0..{self.rig.grid.size - 1}")
        return cells

    def _asked_shots(self, cells: Cells) -> Integers | int:
        """Return (n,) how often to fire each of the demanded `cells`, within the hardware's
        limits.
        """
        asked = self.demanded.shots if self.demanded is not None else None
        if asked is None:
            return 1
        shots = as_array("shots of a demand", asked)
        if shots.shape != (self.rig.grid.size,) or shots.dtype.kind not in "iu" or shots.min() < 1:
            raise InvalidInput(
                f"shots of a demand must be {self.rig.grid.size} whole numbers of 1 or more"
            )
        possible: Integers = np.minimum(shots[cells], self.rig.hardware.most_shots)
        return possible


class RowPolicy(Policy):
    """A policy without a memory that reads only the rows of a belief, so one implementation serves
    any number of worlds. `care_sim.policies.vector` calls it for all worlds of a vector
    environment.
    """

    @abstractmethod
    def stages(self, beliefs: Beliefs) -> list[WorldSets]:
        """Return the exploitation sets, then those of each reserve layer, of all worlds."""

    def demand(self, belief: Belief) -> Demand:
        """Return the demand of one world."""
        beliefs = Beliefs.of(belief, self.rig)
        exploitation, *layers = [stage.sets for stage in self.stages(beliefs)]
        return Demand(exploitation, layers)


class FixedPolicy(Policy):
    """A policy with the same demand at every keyframe, for any belief."""

    @abstractmethod
    def fixed(self, budget: int) -> Demand:
        """Return the demand for a budget in cells."""

    def demand(self, belief: Belief) -> Demand:
        """Return the same demand at every keyframe."""
        return self.fixed(belief.budget)


class PrivilegedPolicy(Policy):
    """A policy that may read the truth about the next keyframe. It is a bound or a reference: no
    car can have it.

    `make_policy` passes `truth` only to subclasses of this class. Their tags never include causal,
    and always privileged or non-causal, whatever they claim.
    """

    tags: ClassVar[tuple[str, ...]] = ("privileged",)

    def __init_subclass__(cls, **options: object) -> None:
        super().__init_subclass__(**options)
        cls.tags = honest_tags(cls.tags)

    def __init__(self, rig: Rig, truth: Truth):
        super().__init__(rig)
        self.truth = truth


def honest_tags(tags: tuple[str, ...]) -> tuple[str, ...]:
    """Return the tags of a privileged policy: never causal, always privileged or non-causal."""
    # A foreign subclass may claim to be causal; with truth it is not.
    honest = tuple(tag for tag in tags if tag != "causal")
    return honest if {"privileged", "non-causal"} & {*honest} else ("privileged", *honest)
