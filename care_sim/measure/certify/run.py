"""`care-sim certify`: play the list, compare it with what is published, report."""

import sys
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Annotated

import tyro

from care_sim.base.bounds import bounded, check_fields
from care_sim.base.checks import check_whole
from care_sim.base.cores import MOST_WORKERS, WORKERS
from care_sim.base.errors import InvalidInput, MissingExtra, report_problems
from care_sim.measure.certify.design import CERTIFIED_EPISODES, drawn
from care_sim.measure.certify.playing import Trails, playable_here, trails_of
from care_sim.measure.certify.published import combined, read, write
from care_sim.measure.certify.verdict import verdict_of
from care_sim.study.progress import ProgressLines, progress_bar

_ALL_EPISODES = 10_000


@dataclass(frozen=True, kw_only=True)
class CertifyConfig:
    """Play a published list of episodes and say whether they go as published, or where one does
    not. It holds every environment, built-in policy and fault, alone and in every kind of vector.
    """

    every: Annotated[bool, tyro.conf.arg(name="all"), tyro.conf.FlagCreatePairsOff] = False
    """All 10,000 episodes, not only the first 3,050."""
    episode: int | None = None
    """This episode alone, by its number in the list."""
    workers: int = bounded(WORKERS, 1, MOST_WORKERS)
    """Processes that play at the same time."""
    write: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """For maintainers, with all: make what is played now the published list."""

    def __post_init__(self) -> None:
        check_fields(self)
        if self.episode is not None:
            check_whole("episode", self.episode, 0, _ALL_EPISODES - 1)
            if self.every or self.write:
                raise InvalidInput("episode plays one alone: give neither all nor write with it")
        elif self.write and not self.every:
            raise InvalidInput("write publishes the whole list: give all with it")

    @property
    def numbers(self) -> list[int]:
        """The episodes by number."""
        if self.episode is not None:
            return [self.episode]
        return list(range(_ALL_EPISODES if self.every else CERTIFIED_EPISODES))


def run_certify(config: CertifyConfig) -> int:
    """Play the list and print how it goes; 0 where every episode that can be played here goes as
    published, else 1.

    Raises MissingExtra where none can be played, or not all that are to be published.
    """
    published = [] if config.write else read()
    if config.numbers[-1] >= len(published) and not config.write:
        raise InvalidInput(f"the published list has {len(published):,} episodes")
    episodes, lacking = playable_here([drawn(number) for number in config.numbers])
    if lacking and (config.write or not episodes):
        raise MissingExtra("; ".join(lacking))
    report_problems(lacking)
    found = _played([episode.number for episode in episodes], config.workers)
    if config.write:
        return _published(found)
    verdict = verdict_of(found, published, len(config.numbers))
    print(*verdict.lines(), sep="\n")
    return 0 if verdict.as_published else 1


def _played(numbers: Sequence[int], workers: int) -> Trails:
    total = len(numbers)
    with (
        progress_bar(total, "episodes")
        if sys.stderr.isatty()
        else nullcontext(ProgressLines(total, "episodes")) as show
    ):
        return trails_of(numbers, workers, lambda done: show(done, ""))


def _published(found: Trails) -> int:
    """Publish what was played, unless some of it was not."""
    trails = [trail for _, trail in sorted(found.items()) if isinstance(trail, bytes)]
    if len(trails) < len(found):
        number, reason = next(
            (n, trail) for n, trail in sorted(found.items()) if isinstance(trail, str)
        )
        print(f"nothing is written: episode {number} was not played: {reason}")
        return 1
    write(trails)
    print(f"{len(trails):,} episodes: {combined(trails)}, published")
    return 0
