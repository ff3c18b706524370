"""`care-sim certify`: whether episodes go on this machine as published."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import tyro

from care_sim.base.bounds import bounded, check_fields
from care_sim.base.checks import check_whole
from care_sim.base.cores import MOST_WORKERS, WORKERS
from care_sim.base.errors import InvalidInput, MissingExtra, report_problems
from care_sim.certify import ALL_EPISODES, CERTIFIED_EPISODES


@dataclass(frozen=True, kw_only=True)
class Certify:
    """Play published episodes and say whether they go as published.

    Play a published list of episodes and say whether they go as published, or where one does
    not.

    The list holds every environment, built-in policy and fault, alone and in vectors.
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
            check_whole("episode", self.episode, 0, ALL_EPISODES - 1)
            if self.every or self.write:
                raise InvalidInput("episode plays one alone: give neither all nor write with it")
        elif self.write and not self.every:
            raise InvalidInput("write publishes the whole list: give all with it")

    def __call__(self) -> int:
        """Play the list and print how it goes; 0 where every episode that can be played here goes
        as published, else 1.

        Raises MissingExtra where none can be played, or not all that are to be published.
        """
        # Imported here because the help of the command needs no simulator.
        from care_sim.certify.design import drawn
        from care_sim.certify.playing import playable_here, trails_of
        from care_sim.certify.published import read
        from care_sim.certify.verdict import verdict_of
        from care_sim.study.progress import shown_progress

        published = [] if self.write else read()
        if self.numbers[-1] >= len(published) and not self.write:
            raise InvalidInput(f"the published list has {len(published):,} episodes")
        episodes, lacking = playable_here([drawn(number) for number in self.numbers])
        if lacking and (self.write or not episodes):
            raise MissingExtra(lacking)
        report_problems([lacking] if lacking else [])
        with shown_progress(len(episodes), "episodes") as show:
            found = trails_of(
                [episode.number for episode in episodes], self.workers, lambda done: show(done, "")
            )
        if self.write:
            return _publish(found)
        verdict = verdict_of(found, published, len(self.numbers))
        print(*verdict.lines(), sep="\n")
        return 0 if verdict.as_published else 1

    @property
    def numbers(self) -> list[int]:
        """The episodes by number."""
        if self.episode is not None:
            return [self.episode]
        return list(range(ALL_EPISODES if self.every else CERTIFIED_EPISODES))


def _publish(found: Mapping[int, bytes | str]) -> int:
    """Publish what was played, unless some of it was not."""
    from care_sim.certify.published import combined, write

    failures = {number: trail for number, trail in found.items() if isinstance(trail, str)}
    if failures:
        first = min(failures)
        print(f"nothing is written: episode {first} was not played: {failures[first]}")
        return 1
    trails = [trail for _, trail in sorted(found.items()) if isinstance(trail, bytes)]
    write(trails)
    print(f"{len(trails):,} episodes: {combined(trails)}, published")
    return 0
