"""The episodes of the list in batches, which worker processes play."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, as_completed
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory

from care_sim.measure.certify.design import CLOSED, HASH_SEED, STREET, SUBPROCESS, Drawn, drawn
from care_sim.measure.certify.drive import write_drive
from care_sim.measure.certify.modes import Left, play, together
from care_sim.study.episode_play import answer
from care_sim.study.executors import ExecutorFactory, Processes, processes

Trails = dict[int, Left]
"""The trail of every episode by number, or in one line why there is none."""

A_BATCH = 24
A_LONG_BATCH = 120
"""Episodes of a batch; more where it takes a while to begin: another interpreter, PyTorch."""


def trails_of(
    numbers: Sequence[int],
    workers: int,
    show: Callable[[int], None] = lambda _done: None,
    make_executor: ExecutorFactory = processes,
) -> Trails:
    """Play episodes; `show` is told how many are done. An interrupt waits for none of them."""
    found: Trails = {}
    with TemporaryDirectory(prefix="care-sim-certify-") as folder:
        source = write_drive(Path(folder))
        waiting = batches([drawn(number) for number in numbers])
        executor = make_executor(min(workers, max(len(waiting), 1)))
        try:
            futures = {executor.submit(attempt, batch, source): batch for batch in waiting}
            for future in as_completed(futures):
                try:
                    found |= future.result()
                except BrokenExecutor:
                    found |= {
                        episode.number: "the process that played it died"
                        for episode in futures[future]
                    }
                show(len(found))
        except KeyboardInterrupt:
            if isinstance(executor, Processes):
                executor.end_at_once()
            raise
        finally:
            executor.shutdown(cancel_futures=True)
    return found


def batches(episodes: Sequence[Drawn]) -> list[list[Drawn]]:
    """Episodes that are played one after the other: those of a street together, since it takes
    seconds to make; the others by mode. The longest to begin come first.
    """
    ordered = sorted(episodes, key=lambda episode: (*_world(episode), episode.mode, episode.number))
    made: list[list[Drawn]] = []
    for (world, mode), group in groupby(
        ordered, lambda one: (_world(one), one.mode * (one.environment != STREET))
    ):
        most = (
            len(episodes)
            if world[0] == STREET
            else A_LONG_BATCH
            if mode in (HASH_SEED, SUBPROCESS)
            else A_BATCH
        )
        made += [list(batch) for batch in together(list(group), most)]
    return sorted(
        made,
        key=lambda batch: (
            batch[0].environment != STREET,
            batch[0].mode not in (HASH_SEED, SUBPROCESS),
        ),
    )


def attempt(batch: Sequence[Drawn], source: str) -> Trails:
    """What a worker does: play a batch. Where one of several that are played together fails, each
    is played alone, so that the others have their trails.
    """
    found: Trails = {}
    for group in _alike(batch):
        trails = answer(play, group[0].mode, group, source)
        if isinstance(trails, str):
            trails = [_alone(episode, source) for episode in group]
        found |= {episode.number: trail for episode, trail in zip(group, trails, strict=True)}
    return found


def _alone(episode: Drawn, source: str) -> Left:
    trails = answer(play, episode.mode, [episode], source)
    return trails if isinstance(trails, str) else trails[0]


def _alike(batch: Sequence[Drawn]) -> Iterator[list[Drawn]]:
    """Those of one mode."""
    for _, group in groupby(batch, lambda episode: episode.mode):
        yield list(group)


def _world(episode: Drawn) -> tuple[str, int]:
    """What episodes of one vector share: their spaces, and the street that is made for them."""
    if episode.environment in CLOSED:
        return "", 0
    return episode.environment, episode.seed * (episode.environment == STREET)
