"""How much is certified."""

import os
from dataclasses import dataclass, field
from typing import Annotated

import tyro

from care_sim.errors import InvalidInput, check_whole

EPISODES, ALL_EPISODES = 1_000, 10_000


@dataclass(frozen=True, kw_only=True)
class CertifyConfig:
    """Play a published list of episodes, of every environment, policy and fault, alone and in every kind of vector, and
    say whether they go as published, or which one does not and where.
    """

    every: Annotated[bool, tyro.conf.arg(name="all"), tyro.conf.FlagCreatePairsOff] = False
    """All 10,000 episodes; the first 1,000 without."""
    episode: int | None = None
    """This one alone, by its number in the list."""
    workers: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Processes that play at the same time."""
    write: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """For maintainers: make what is played now the published list."""

    def __post_init__(self) -> None:
        check_whole("workers", self.workers, 1)
        if self.episode is None:
            return
        check_whole("episode", self.episode, 0, ALL_EPISODES - 1)
        if self.every or self.write:
            raise InvalidInput("episode plays one alone: it goes neither with all nor with write")

    @property
    def numbers(self) -> list[int]:
        """The episodes by number."""
        if self.episode is not None:
            return [self.episode]
        return list(range(ALL_EPISODES if self.every else EPISODES))
