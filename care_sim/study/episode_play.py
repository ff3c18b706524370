"""Episodes of the closed loop: a configuration in, one tidy row out."""

import hashlib
import random
import resource
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, cast

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

import care_sim
from care_sim.base.digests import Content, portable_bytes
from care_sim.base.errors import InvalidInput, failure_line
from care_sim.base.limits import is_interrupt
from care_sim.base.times import LAST_BITS_S
from care_sim.core.arrays import Floats
from care_sim.core.conditions import DriverSettings
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.sensing import as_scores
from care_sim.envs.worlds import Stepped, Worlds
from care_sim.loops.one_world import OneWorld
from care_sim.loops.records import Keyframe
from care_sim.policies import tags_of
from care_sim.policies.base import Policy
from care_sim.policies.vector import vector_policy
from care_sim.scenarios import SCENARIOS
from care_sim.study.episode_config import EpisodeConfig, closed_loop
from care_sim.study.run_config import Row, flat
from care_sim.world.world import World


def world_hash(env: ClosedLoopEnv, seed: int) -> str:
    """Return a hash of the bodies in a seed's world and their motions, once while the ego keeps its
    speed and once while it brakes. Measured numbers are rounded (`care_sim.base.digests`). The
    world is built anew.
    """
    content = hashlib.sha256()
    # An actor may react only to a brake.
    for acceleration in (0.0, -DriverSettings().brake_mps2):
        with closing(env.setting.episode(seed).world) as world:
            content.update(portable_bytes(*_world_content(world)))
            bodies = np.array([world.ego_body, *(actor.body for actor in world.actors)])
            while world.time < env.scenario.duration_s - LAST_BITS_S and not world.is_over():
                content.update(portable_bytes(world.boxes_of(bodies)[:, [0, 1, 6]]))
                world.step(acceleration)
    return content.hexdigest()[:16]


def _world_content(world: World) -> Iterator[tuple[Content, ...]]:
    """Yield the content of a world before anything moves: bodies with their parts, the
    first-sighting actor, and the drawn parameters.
    """
    for actor in world.actors:
        kind = actor.kind
        yield actor.name, str(kind.label), actor.reported, kind.size
        yield from ((part.shape, part.material, part.size, part.centre) for part in kind.parts)
    yield (world.first_sighting.name if world.first_sighting else "",)
    yield from sorted(world.drawn.items())


_Result = TypeVar("_Result")
Watcher = Callable[[OneWorld, Keyframe], None]
GymEnv = gymnasium.Env[Any, Any]
_KIB_MB = 1024 / 1e6


def result_or_reason(play: Callable[..., _Result], *arguments: object) -> _Result | str:
    """Return the result of `play`, or the reason of its failure in one line. No exception leaves
    the worker, since only the worker may have its class.
    """
    try:
        return play(*arguments)
    # A policy that calls sys.exit ends its episode, not the worker.
    except BaseException as error:
        if is_interrupt(error):
            raise KeyboardInterrupt from error
        return failure_line(error)


def run_episode(config: EpisodeConfig) -> Row:
    """Play an episode and return its row.

    Columns:

    - every parameter of `EpisodeConfig.row`, `version` and `digest` of the configuration
    - the scenario's drawn parameters as `drawn.NAME`
    - the fields of `care_sim.loops.records.Outcome`
    - `keyframes`, `wall_s`, and `peak_rss_mb` of the process so far
    - `episode_hash` over fired cells, ranges and poses (`care_sim.base.digests`)
    - `world_hash`, for a scenario that is not built in
    """
    return trace(config)[0]


def trace(
    config: EpisodeConfig,
    *watchers: Watcher,
    begin: Callable[[OneWorld], None] = lambda _loop: None,
    wrap: Callable[[GymEnv, Policy], GymEnv] = lambda env, _policy: env,
) -> tuple[Row, list[Keyframe]]:
    """Play an episode and return its row and the record of every keyframe (for scoring only: it
    holds truth).

    `begin` is called before the first keyframe, `watchers` after each; `wrap` puts wrappers that
    watch around the environment.
    """
    started = time.perf_counter()
    # The file of a set-up may be written anew while the episode runs.
    told = config.row()
    digest = EpisodeHash()
    inner = config.make_env()
    # Made for the environment inside the wrappers: the policy takes nothing from them.
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
            digest.add(info["fired"], observation["ranges"], played.loop.boxes)
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
    """Data of a played episode: its parameters at the beginning, and the other columns of
    `run_episode`.
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
    """A hash over all events of an episode."""

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


MOST_TOGETHER = 16
"""Episodes played together. More save hardly any time, and an interrupted study would leave fewer
whole pairs of policies.
"""


def play_episodes(batch: Sequence[EpisodeConfig]) -> list[Row | str]:
    """Play episodes in a worker, and return for each its row, or the reason of its failure in one
    line. Episodes of an `EpisodeConfig.batch` are played together.
    """
    if len(batch) > 1 and len({config.batch for config in batch}) == 1:
        rows = result_or_reason(play_together, batch)
        if not isinstance(rows, str):
            return [*rows]
    # An error of many episodes is not reported: playing each alone shows whose error it is.
    return [result_or_reason(run_episode, config) for config in batch]


def play_together(configs: Sequence[EpisodeConfig]) -> list[Row]:
    """Return the rows of episodes of one `EpisodeConfig.batch`, each with an even share of the
    time. Raises any episode's error, and InvalidInput if results would differ from playing alone.
    """
    started = time.perf_counter()
    # The file of a set-up may be written anew while the episodes run.
    told = [config.row() for config in configs]
    count = len(configs)
    hashes = [EpisodeHash() for _ in configs]
    keyframes = np.zeros(count, np.int64)
    outcomes = dict[int, Row]()
    with configs[0].make_env() as env:
        model = closed_loop(env)
        if "privileged" in tags_of(configs[0].policy):
            raise InvalidInput("a privileged policy asks its own world for the truth")
        policy = vector_policy(partial(configs[0].make_policy, env), count)
        # A detector may remember something of its world.
        settings = [model.setting] * count
        if model.setting.detector is not None:
            settings = [closed_loop(config.make_env()).setting for config in configs]
        with closing(Worlds(settings, exact=False)) as worlds:
            observed = worlds.observed
            infos = worlds.begin({world: config.seed for world, config in enumerate(configs)})
            policy.reset()
            drawn = _common_draws()
            live = np.ones(count, np.bool_)
            # Worlds that are over rest until the last one is.
            while live.any():
                # In copies, since a policy may keep observations, and write into them.
                shown = {name: tables.copy() for name, tables in observed.items()}
                actions = as_scores(policy(shown, live), observed["ranges"].shape)
                stepped = worlds.step(worlds.fired(actions, live), live)
                for world in np.flatnonzero(live).tolist():
                    fired = _fired(stepped, world)
                    hashes[world].add(fired, observed["ranges"][world], worlds.loop.boxes(world))
                over = stepped.terminated | stepped.truncated
                outcomes |= {w: stepped.single[w]["outcome"] for w in np.flatnonzero(over).tolist()}
                keyframes += live
                live &= ~over
    # A policy that seeds a process-wide generator in `reset`, and draws from it at keyframes, gets
    # other numbers if others also draw from it.
    if _common_draws() != drawn:
        raise InvalidInput(f"policy {configs[0].policy} draws from a generator of the process")
    wall_s = (time.perf_counter() - started) / count
    return [
        Played(
            told[world],
            infos[world].get("drawn", {}),
            outcomes[world],
            int(keyframes[world]),
            wall_s,
            hashes[world].hexdigest(),
        ).row(config)
        for world, config in enumerate(configs)
    ]


def _common_draws() -> list[Any]:
    """Return the states of the generators that a process shares."""
    _, words, *rest = cast(tuple[Any, ...], np.random.get_state())  # noqa: NPY002 (whose it may be)
    states: list[Any] = [random.getstate(), words.tobytes(), *rest]
    # Code that draws from PyTorch has imported it; others need not wait for the import.
    if torch := sys.modules.get("torch"):
        states.append(torch.get_rng_state().numpy().tobytes())
    return states


def _fired(stepped: Stepped, world: int) -> NDArray[np.int64] | list[int]:
    """Return the cells that a world fired, as a list if numbers differ between worlds."""
    column: NDArray[np.int64] | None = stepped.columns.get("fired")
    cells: NDArray[np.int64] | list[int] = (
        column[world] if column is not None else stepped.single[world]["fired"]
    )
    return cells
