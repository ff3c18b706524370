"""One episode: a configuration in, one tidy row out."""

import hashlib
import resource
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, cast

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

import care_sim
from care_sim.base.digests import portable_bytes
from care_sim.base.errors import failure_line
from care_sim.core.arrays import Floats
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.records import Keyframe
from care_sim.policies.base import Policy
from care_sim.scenarios import SCENARIOS
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.run_config import Row, flat
from care_sim.study.world_hash import world_hash

_Result = TypeVar("_Result")
Watcher = Callable[[ClosedLoop, Keyframe], None]
GymEnv = gymnasium.Env[Any, Any]
_KIB_MB = 1024 / 1e6


def result_or_reason(play: Callable[..., _Result], *arguments: object) -> _Result | str:
    """What `play` returns, or in one line why it returns nothing. No exception leaves the worker,
    which alone may know its class.
    """
    try:
        return play(*arguments)
    except KeyboardInterrupt:
        raise
    # A policy that calls sys.exit ends its episode, not the worker.
    except BaseException as error:
        return failure_line(error)


def run_episode(config: EpisodeConfig) -> Row:
    """Play an episode and return its row.

    Every parameter of `EpisodeConfig.row`; `version` and `digest` of the configuration; as
    `drawn.NAME` the parameters of the scenario that the seed drew; the fields of
    `care_sim.loops.records.Outcome`; `keyframes`; `wall_s`; `peak_rss_mb` of the process so far;
    `episode_hash` over cells fired, ranges returned and poses (`care_sim.base.digests`); and
    of a scenario that is not built in `world_hash` (`care_sim.study.world_hash`).
    """
    return trace(config)[0]


def trace(
    config: EpisodeConfig,
    *watchers: Watcher,
    begin: Callable[[ClosedLoop], None] = lambda _loop: None,
    wrap: Callable[[GymEnv, Policy], GymEnv] = lambda env, _policy: env,
) -> tuple[Row, list[Keyframe]]:
    """Play an episode; gives its row and the record of every keyframe (for scoring only: it holds
    truth).

    `begin` is called before the first keyframe, `watchers` after each; `wrap` puts wrappers that
    watch around the environment.
    """
    started = time.perf_counter()
    # The file of a set-up may be written anew while the episode runs.
    told = config.row()
    digest = EpisodeHash()
    inner = config.make_env()
    # Made for the environment within the wrappers: the policy takes nothing from them.
    policy = config.make_policy(inner)
    with wrap(inner, policy) as env:
        # The environment itself, which the wrappers that watch leave as it is.
        played = cast(ClosedLoopEnv, env.unwrapped)
        observation, info = env.reset(seed=config.seed)
        policy.reset()
        begin(played.loop)
        ended = False
        while not ended:
            observation, _, terminated, truncated, info = env.step(policy(observation))
            digest.add(info["fired"], observation["ranges"], _boxes(played.loop))
            for watch in watchers:
                watch(played.loop, played.keyframes[-1])
            ended = terminated or truncated
        keyframes = played.keyframes
        drawn = played.loop.world.drawn
    wall_s = time.perf_counter() - started
    found = Played(told, drawn, info["outcome"], len(keyframes), wall_s, digest.hexdigest())
    row = found.row(config)
    # The built-in scenarios are known to draw from the seed alone.
    if config.scenario not in SCENARIOS:
        row["world_hash"] = world_hash(played, config.seed)
    return row, keyframes


class Played(NamedTuple):
    """What an episode leaves behind: its parameters as they were `told` when it began, and the rest
    of what `run_episode` names.
    """

    told: Row
    drawn: Mapping[str, float | str]
    outcome: Row
    keyframes: int
    wall_s: float
    episode_hash: str

    def row(self, config: EpisodeConfig) -> Row:
        """The row, with the digest as it is now."""
        return {
            **self.told,
            "version": care_sim.__version__,
            "digest": config.digest(),
            **flat("drawn", tuple(self.drawn.items())),
            **self.outcome,
            "keyframes": self.keyframes,
            "wall_s": self.wall_s,
            "peak_rss_mb": peak_rss_mb(),
            "episode_hash": self.episode_hash,
        }


class EpisodeHash:
    """A hash over all that happens in an episode."""

    def __init__(self) -> None:
        self._content = hashlib.sha256()

    def add(self, fired: ArrayLike, ranges: NDArray[np.float32], boxes: Floats) -> None:
        """Include one keyframe: cells, returned ranges (E, A), and the poses in the boxes (n, 7) of
        the ego and then every actor.
        """
        poses = boxes[:, [0, 1, 6]]
        self._content.update(portable_bytes(np.asarray(fired, np.int64), ranges, poses))

    def hexdigest(self) -> str:
        """The hash so far."""
        return self._content.hexdigest()[:16]


def _boxes(loop: ClosedLoop) -> Floats:
    """(n, 7) of the ego and then every actor."""
    world = loop.world
    return world.boxes_of(np.array([world.ego_body, *(actor.body for actor in world.actors)]))


def peak_rss_mb() -> float:
    """The most memory this process has held, in MB."""
    # getrusage would count what the parent held when it started this process.
    status = Path("/proc/self/status")
    lines = status.read_text().splitlines() if status.exists() else []
    peaks = [int(line.split()[1]) for line in lines if line.startswith("VmHWM:")]
    if peaks:
        return peaks[0] * _KIB_MB
    # In bytes on macOS, in KiB elsewhere.
    held = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return held / (1e6 if sys.platform == "darwin" else 1e3)
