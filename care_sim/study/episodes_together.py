"""Episodes that differ in nothing but the seed, played together. Each has the row that it has
alone.
"""

import random
import sys
import time
from collections.abc import Sequence
from contextlib import closing
from functools import partial
from typing import Any, cast

import numpy as np
from gymnasium.vector.utils import create_empty_array
from numpy.typing import NDArray

from care_sim.base.errors import InvalidInput
from care_sim.envs.sensing import Observed, checked_scores
from care_sim.envs.vector.arguments import why_separate
from care_sim.envs.vector.worlds import CompiledWorlds, Stepped
from care_sim.policies.vector import vector_policy
from care_sim.study.episode_config import EpisodeConfig, closed_loop
from care_sim.study.episode_play import EpisodeHash, Played, result_or_reason, run_episode
from care_sim.study.run_config import Row

MOST_TOGETHER = 16
"""Episodes that are played together: more save no time worth telling, and an interrupted study
would leave fewer whole pairs of policies.
"""


def play_episodes(batch: Sequence[EpisodeConfig]) -> list[Row | str]:
    """What a worker does: play episodes, and give for each its row, or in one line why there is
    none. Those of an `EpisodeConfig.batch` are played together.
    """
    if len(batch) > 1 and not batch[0].alone and len({config.batch for config in batch}) == 1:
        rows = result_or_reason(play_together, batch)
        if not isinstance(rows, str):
            return [*rows]
    # What is raised among many is not told: whose it is shows where each is played alone.
    return [result_or_reason(run_episode, config) for config in batch]


def play_together(configs: Sequence[EpisodeConfig]) -> list[Row]:
    """The rows of episodes of one `EpisodeConfig.batch`, of whose time each has an even share.
    Raises what any of them raises, and InvalidInput where they would not be what each is alone.
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
        if reason := why_separate(model):
            raise InvalidInput(f"{reason} is not played as arrays")
        observed = cast(Observed, create_empty_array(model.observation_space, count))
        policy = vector_policy(partial(configs[0].make_policy, env), count)
        with closing(CompiledWorlds([model] * count, observed, exact=False)) as worlds:
            infos = worlds.begin({world: config.seed for world, config in enumerate(configs)})
            policy.reset()
            drawn = _common_draws()
            live = np.ones(count, np.bool_)
            # Worlds that are over rest until the last one is.
            while live.any():
                # In copies, since a policy may keep what it is shown, and write into it.
                shown = {name: tables.copy() for name, tables in observed.items()}
                actions = checked_scores(policy(shown, live), observed["ranges"].shape)
                stepped = worlds.step(actions, live)
                for world in np.flatnonzero(live).tolist():
                    fired = _fired(stepped, world)
                    hashes[world].add(fired, observed["ranges"][world], worlds.boxes(world))
                over = stepped.terminated | stepped.truncated
                outcomes |= {w: stepped.single[w]["outcome"] for w in np.flatnonzero(over).tolist()}
                keyframes += live
                live &= ~over
    # Who seeds a generator of the whole process in `reset`, and draws from it at keyframes, gets
    # other numbers where others draw from it, too.
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
    """Where the generators are that everything in a process shares."""
    _, words, *rest = cast(tuple[Any, ...], np.random.get_state())  # noqa: NPY002 (whose it may be)
    states: list[Any] = [random.getstate(), words.tobytes(), *rest]
    # Whoever draws from it has imported it; nobody else waits for it.
    if torch := sys.modules.get("torch"):
        states.append(torch.get_rng_state().numpy().tobytes())
    return states


def _fired(stepped: Stepped, world: int) -> NDArray[np.int64] | list[int]:
    """The cells that a world fired: a list of its own where numbers differ."""
    column: NDArray[np.int64] | None = stepped.columns.get("fired")
    cells: NDArray[np.int64] | list[int] = (
        column[world] if column is not None else stepped.single[world]["fired"]
    )
    return cells
