"""What plays some of the worlds of a vector environment, in one thread."""

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from care_sim.core.arrays import Floats, Mask
from care_sim.envs.sensing import Observed


class Stepped(NamedTuple):
    """What n worlds give at a step: rewards, terminations and truncations (n,), 0 and False of
    those that did not play; what `info` says of all in `columns` (n, ...), by name, which the next
    step may write over; and what it says of one alone in `single`, by world.
    """

    rewards: Floats
    terminated: Mask
    truncated: Mask
    columns: dict[str, Any]
    single: dict[int, dict[str, Any]]

    @classmethod
    def nothing(cls, worlds: int) -> "Stepped":
        """Of worlds of which none has played."""
        flags = np.zeros((2, worlds), np.bool_)
        return cls(np.zeros(worlds), flags[0], flags[1], {}, {})


class Worlds(Protocol):
    """Some of the worlds of a vector environment. Each writes the observation of its coming
    keyframe into its row of `observed`.
    """

    observed: Observed

    def begin(self, seeds: Mapping[int, int | None]) -> dict[int, dict[str, Any]]:
        """Begin an episode in those that have a seed or None here, as `reset` of the single
        environment does with it; their infos.
        """
        ...

    def step(self, actions: NDArray[np.float32], who: Mask) -> Stepped:
        """Let those play that are True in `who` (n,), with their rows of `actions` (n, E, A)."""
        ...

    def close(self) -> None:
        """Free what they hold."""
        ...
