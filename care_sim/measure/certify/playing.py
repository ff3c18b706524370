"""Episodes of the list in batches, which worker processes play; and which can be played here."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, as_completed
from importlib.util import find_spec
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory

from care_sim.base.errors import MissingExtra
from care_sim.base.extras import import_open3d, missing_extra
from care_sim.measure.certify.design import (
    CLOSED,
    DRIVE,
    HASH_SEED,
    STREET,
    SUBPROCESS,
    Drawn,
    drawn,
)
from care_sim.measure.certify.drive import write_drive
from care_sim.measure.certify.modes import Played, play_in_mode, together
from care_sim.study.episode_play import result_or_reason
from care_sim.study.executors import ExecutorFactory, Processes, processes

Trails = dict[int, Played]
"""The trail of every episode by number, or in one line why there is none."""

FARTHEST = "farthest-points"
"""The policy that needs Open3D."""

_BATCH = 24
_LONG_BATCH = 120
"""Episodes of a batch; more of them where a mode takes a while to begin: another interpreter,
PyTorch.
"""


def _need_stable_baselines3() -> None:
    """Raise MissingExtra where it is not installed."""
    # It is looked for and not imported, which would take seconds.
    if find_spec("stable_baselines3") is None:
        raise missing_extra("Stable-Baselines3", "rl")


_NEEDS: tuple[tuple[Callable[[Drawn], bool], Callable[[], object]], ...] = (
    (lambda episode: episode.policy == FARTHEST, import_open3d),
    (lambda episode: episode.mode == SUBPROCESS, _need_stable_baselines3),
)
"""Which episodes need an extra, and what raises MissingExtra without it."""


def playable_here(episodes: Sequence[Drawn]) -> tuple[list[Drawn], list[str]]:
    """The episodes that can be played with what is installed, and a line for each extra that is
    missing.
    """
    left = list(episodes)
    lines = []
    for needed, load in _NEEDS:
        lacking = [episode for episode in left if needed(episode)]
        try:
            if lacking:
                load()
        except MissingExtra as error:
            left = [episode for episode in left if not needed(episode)]
            lines.append(f"{len(lacking):,} of {len(episodes):,} not played: {error}")
    return left, lines


def trails_of(
    numbers: Sequence[int],
    workers: int,
    show: Callable[[int], None] = lambda _done: None,
    make_executor: ExecutorFactory = processes,
) -> Trails:
    """Play episodes; `show` is called with the number of those done. An interrupt waits for none of
    them.
    """
    found: Trails = {}
    with TemporaryDirectory(prefix="care-sim-certify-") as folder:
        source = write_drive(Path(folder))
        waiting = episode_batches([drawn(number) for number in numbers])
        executor = make_executor(min(workers, max(len(waiting), 1)))
        try:
            futures = {executor.submit(attempt, batch, source): batch for batch in waiting}
            for future in as_completed(futures):
                # A worker that died takes its batch with it, and the others with theirs: the reason
                # stands in the place of the trails.
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


def episode_batches(episodes: Sequence[Drawn]) -> list[list[Drawn]]:
    """Episodes in lists that are played one after the other: those of a street together, since it
    takes seconds to make, and the others by mode.
    """
    # `groupby` needs its groups side by side. Episodes of a street make one group whatever their
    # mode, which `attempt` takes apart again.
    ordered = sorted(episodes, key=lambda episode: (*_world(episode), episode.mode, episode.number))
    made: list[list[Drawn]] = []
    for (world, mode), group in groupby(
        ordered, lambda one: (_world(one), one.mode * (one.environment != STREET))
    ):
        most = _BATCH
        if world[0] == STREET:
            most = len(episodes)
        elif mode in (HASH_SEED, SUBPROCESS):
            most = _LONG_BATCH
        made += [list(batch) for batch in together(list(group), most)]
    # What takes longest to begin comes first, so that no worker ends long after the others.
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
        trails = result_or_reason(play_in_mode, group[0].mode, group, source)
        # One text instead of trails: an exception that ended the whole group.
        if isinstance(trails, str):
            trails = [_alone(episode, source) for episode in group]
        found |= {episode.number: trail for episode, trail in zip(group, trails, strict=True)}
    return found


def _alone(episode: Drawn, source: str) -> Played:
    trails = result_or_reason(play_in_mode, episode.mode, [episode], source)
    return trails if isinstance(trails, str) else trails[0]


def _alike(batch: Sequence[Drawn]) -> Iterator[list[Drawn]]:
    """Groups of one mode."""
    for _, group in groupby(batch, lambda episode: episode.mode):
        yield list(group)


def _world(episode: Drawn) -> tuple[str, int]:
    """What episodes of one vector share: their spaces, and the street that is made for them."""
    # All other worlds of the closed loop have one camera, the same; a drive has six.
    if episode.environment in CLOSED and episode.environment != DRIVE:
        return "", 0
    return episode.environment, episode.seed * (episode.environment == STREET)
