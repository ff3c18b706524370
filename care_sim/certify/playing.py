"""Episodes of the list played by worker processes, alone or in a vector; and which can be played
here.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, as_completed
from contextlib import closing
from functools import partial
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import SyncVectorEnv

from care_sim.base.errors import MissingExtra
from care_sim.base.extras import import_open3d
from care_sim.certify.design import AS_LISTED, CLOSED, DRIVE, REPLAY, STREET, VECTOR, Drawn, drawn
from care_sim.certify.drive import write_drive
from care_sim.certify.trail import Trail
from care_sim.policies import make_policy
from care_sim.policies.base import Policy
from care_sim.study.episode_play import result_or_reason
from care_sim.study.executors import ExecutorFactory, Processes, processes

Trails = dict[int, bytes | str]
"""The trail of every episode by number, or in one line why there is none."""

FARTHEST = "farthest-points"
"""The policy that needs Open3D."""

_BATCH = 24
_TOGETHER = 4
"""Episodes of a vector."""


def playable_here(episodes: Sequence[Drawn]) -> tuple[list[Drawn], str]:
    """The episodes that can be played with what is installed, and a line where that is not all."""
    able = [episode for episode in episodes if episode.policy != FARTHEST]
    lacking = len(episodes) - len(able)
    try:
        if lacking:
            import_open3d()
    except MissingExtra as error:
        return able, f"{lacking:,} of {len(episodes):,} not played: {error}"
    return [*episodes], ""


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
    """Episodes of one world in lists that are played one after the other: all of a street together,
    since it takes seconds to make.
    """
    made: list[list[Drawn]] = []
    # `groupby` needs its groups side by side.
    ordered = sorted(episodes, key=lambda episode: (_world(episode), episode.mode, episode.number))
    for (environment, _), group in groupby(ordered, _world):
        most = len(episodes) if environment == STREET else _BATCH
        made += _parts([*group], most)
    # Streets come first, so that no worker ends long after the others.
    return sorted(made, key=lambda batch: batch[0].environment != STREET)


def attempt(batch: Sequence[Drawn], source: str) -> Trails:
    """What a worker does: play a batch, of which episodes side by side have one mode; `source`
    names the recordings of the replay. Where one of several that are played together fails, each is
    played alone, so that the others have their trails.
    """
    found: Trails = {}
    for mode, alike in groupby(batch, lambda episode: episode.mode):
        play = play_in_vector if mode == VECTOR else play_alone
        for group in _parts([*alike], _TOGETHER):
            trails: Sequence[bytes | str] | str = result_or_reason(play, group, source)
            if isinstance(trails, str):
                each = (result_or_reason(play, [episode], source) for episode in group)
                trails = [trail if isinstance(trail, str) else trail[0] for trail in each]
            found |= {episode.number: trail for episode, trail in zip(group, trails, strict=True)}
    return found


def play_alone(episodes: Sequence[Drawn], source: str) -> list[bytes]:
    """The trails of episodes, one after the other."""
    trails = []
    for episode in episodes:
        with closing(certified_env(episode, source)) as env:
            policy = begun(episode, env)
            observation, _ = env.reset()
            while not env.over:
                observation = env.step(policy(observation))[0]
            trails.append(env.played)
    return trails


def play_in_vector(episodes: Sequence[Drawn], source: str) -> list[bytes]:
    """The trails of episodes of one world in a vector of Gymnasium, until the longest is over."""
    with closing(SyncVectorEnv([partial(certified_env, one, source) for one in episodes])) as many:
        envs: Sequence[Any] = many.envs
        policies = [begun(episode, env) for episode, env in zip(episodes, envs, strict=True)]
        # An episode that is over is given its last action again, which has no effect. Its policy is
        # not asked, since a privileged one needs an episode that goes on.
        actions: list[Any] = [None] * len(episodes)
        observations, _ = many.reset()
        while not all(env.over for env in envs):
            for n, env in enumerate(envs):
                if not env.over:
                    seen = {name: column[n] for name, column in observations.items()}
                    actions[n] = policies[n](seen)
            observations = many.step(np.stack(actions))[0]
        return [env.played for env in envs]


def certified_env(episode: Drawn, source: str) -> Trail:
    """The environment of an episode, which keeps its trail."""
    recorded = {"source": source} if episode.environment == REPLAY else {}
    arguments = dict(episode.arguments) | recorded
    return Trail(
        gymnasium.make(f"care_sim:{episode.environment}", disable_env_checker=True, **arguments),
        episode,
    )


def begun(episode: Drawn, env: gymnasium.Env[Any, Any]) -> Policy:
    """The policy of an episode, at its beginning."""
    policy = make_policy(episode.policy, env, **AS_LISTED.get(episode.policy, {}))
    policy.reset()
    return policy


def _parts(episodes: list[Drawn], most: int) -> Iterator[list[Drawn]]:
    """The episodes in lists of at most so many."""
    return (episodes[start : start + most] for start in range(0, len(episodes), most))


def _world(episode: Drawn) -> tuple[str, int]:
    """What episodes of one vector share: their spaces, and the street that is made for them."""
    # All other worlds of the closed loop have one camera, the same; a drive has six.
    if episode.environment in CLOSED and episode.environment != DRIVE:
        return "", 0
    return episode.environment, episode.seed * (episode.environment == STREET)
