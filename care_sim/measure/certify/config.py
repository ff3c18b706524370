"""How much is certified."""

import os
from dataclasses import dataclass
from typing import Annotated

import tyro

from care_sim.base.bounds import bounded, check_fields
from care_sim.base.checks import check_whole
from care_sim.base.errors import InvalidInput
from care_sim.study.executors import MOST_WORKERS

EPISODES, ALL_EPISODES = 1_000, 10_000


@dataclass(frozen=True, kw_only=True)
class CertifyConfig:
    """Play a published list of episodes, of every environment, built-in policy and fault, alone and
    in every kind of vector, and say whether they go as published, or which one does not and where.
    """

    every: Annotated[bool, tyro.conf.arg(name="all"), tyro.conf.FlagCreatePairsOff] = False
    """All 10,000 episodes; the first 1,000 without."""
    episode: int | None = None
    """This one alone, by its number in the list."""
    workers: int = bounded(os.cpu_count() or 1, 1, MOST_WORKERS)
    """Processes that play at the same time."""
    write: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """For maintainers, with all: make what is played now the published list."""

    def __post_init__(self) -> None:
        check_fields(self)
        if self.episode is not None:
            check_whole("episode", self.episode, 0, ALL_EPISODES - 1)
            if self.every or self.write:
                raise InvalidInput(
                    "episode plays one alone: it goes neither with all nor with write"
                )
        elif self.write and not self.every:
            raise InvalidInput("write publishes the whole list: give all too")

    @property
    def numbers(self) -> list[int]:
        """The episodes by number."""
        if self.episode is not None:
            return [self.episode]
        return list(range(ALL_EPISODES if self.every else EPISODES))
