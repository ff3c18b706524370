"""How episodes of the list are played: alone, in turns, in vectors, or in an interpreter with
another hash seed.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

from care_sim.base.processes import end_with_starter, following, starting
from care_sim.measure.certify.design import (
    AS_LISTED,
    ASYNC,
    HASH_SEED,
    INTERLEAVED,
    REPLAY,
    SINGLE,
    STREET,
    SUBPROCESS,
    SYNC,
    Drawn,
    drawn,
)
from care_sim.measure.certify.trail import Trail
from care_sim.policies import make_policy
from care_sim.policies.base import Policy

Played = bytes | str
"""The trail of an episode, or in one line why there is none."""

_TOGETHER = 4
"""Episodes of a vector, and episodes that take turns."""
_HASH_SEEDS = "0123456789"


def play_in_mode(mode: str, episodes: Sequence[Drawn], source: str) -> list[Played]:
    """The trails of episodes played in a mode; `source` names the recordings of the replay.

    In a vector all have the same spaces, those of one environment or of the worlds with one camera.
    """
    if mode == HASH_SEED:
        return _under_another_hash_seed(episodes, source)
    groups = together(episodes, 1 if mode == SINGLE else _TOGETHER)
    return [trail for group in groups for trail in _PLAYERS[mode](group, source)]


def together(episodes: Sequence[Drawn], most: int) -> list[Sequence[Drawn]]:
    """Episodes in groups of at most so many."""
    return [episodes[start : start + most] for start in range(0, len(episodes), most)]


def in_turns(episodes: Sequence[Drawn], source: str) -> list[Played]:
    """The episodes in one process, one keyframe of each in turn, until all are over."""
    with ExitStack() as stack:
        envs = [
            stack.enter_context(closing(_certified_env(episode, source))) for episode in episodes
        ]
        policies = [_begun(episode, env) for episode, env in zip(episodes, envs, strict=True)]
        observations = [env.reset()[0] for env in envs]
        while not all(env.over for env in envs):
            for n, env in enumerate(envs):
                if not env.over:
                    observations[n] = env.step(policies[n](observations[n]))[0]
        return [env.played for env in envs]


def _in_vector(episodes: Sequence[Drawn], source: str, context: str | None = None) -> list[Played]:
    """In a vector of Gymnasium: of this process, or of processes of a `context` of
    multiprocessing.
    """
    makers = [partial(_certified_env, episode, source) for episode in episodes]
    with ExitStack() as stack:
        # Policies ask environments of this process for their rigs. Those of another process are out
        # of reach, so that each has a twin here.
        twins = _twins(stack, episodes, source) if context else []
        vector = stack.enter_context(
            closing(SyncVectorEnv(makers) if context is None else _forked(makers, context))
        )
        envs = vector.envs if isinstance(vector, SyncVectorEnv) else twins
        return _stepped(episodes, envs, vector, vector.reset()[0])


def _forked(makers: Sequence[Callable[[], Trail]], context: str) -> AsyncVectorEnv:
    # Each ends when this process ends, however that happens.
    with starting():
        return AsyncVectorEnv([partial(following, maker) for maker in makers], context=context)


def _in_subprocesses(episodes: Sequence[Drawn], source: str) -> list[Played]:
    """In the subprocesses of Stable-Baselines3 (extra 'rl')."""
    # Imported here: it brings PyTorch, and only this mode needs the extra.
    from stable_baselines3.common.vec_env import SubprocVecEnv

    makers: list[Any] = [
        partial(following, partial(_certified_env, episode, source)) for episode in episodes
    ]
    with ExitStack() as stack:
        twins = _twins(stack, episodes, source)
        with starting():
            vector = stack.enter_context(closing(SubprocVecEnv(makers, start_method="fork")))
        return _stepped(episodes, twins, vector, vector.reset())


def _under_another_hash_seed(episodes: Sequence[Drawn], source: str) -> list[Played]:
    """In an interpreter with another hash seed than that of this one."""
    # Python takes a hash seed only when it starts. It reads what to play from its input, and prints
    # trails as hexadecimal text and reasons as lists of one text.
    seed = next(seed for seed in _HASH_SEEDS if seed != os.environ.get("PYTHONHASHSEED"))
    asked = json.dumps([os.getpid(), [episode.number for episode in episodes], source])
    command = [
        sys.executable,
        "-c",
        "from care_sim.measure.certify.modes import answer_parent; answer_parent()",
    ]
    done = subprocess.run(
        command,
        env=os.environ | {"PYTHONHASHSEED": seed},
        input=asked,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(
            f"the interpreter of another hash seed ended: {done.stderr.strip().splitlines()[-1:]}"
        )
    return [
        bytes.fromhex(trail) if isinstance(trail, str) else trail[0]
        for trail in json.loads(done.stdout)
    ]


def answer_parent() -> None:
    """What the interpreter of another hash seed does: play what it is told on stdin, and print the
    trails.
    """
    starter, numbers, source = json.load(sys.stdin)
    end_with_starter(starter)
    trails = [in_turns([drawn(number)], source)[0] for number in numbers]
    print(json.dumps([trail.hex() if isinstance(trail, bytes) else [trail] for trail in trails]))


def _certified_env(episode: Drawn, source: str) -> Trail:
    """The environment of an episode, which keeps its trail."""
    recorded = {"source": source} if episode.environment == REPLAY else {}
    arguments = dict(episode.arguments) | recorded
    return Trail(
        gymnasium.make(f"care_sim:{episode.environment}", disable_env_checker=True, **arguments),
        episode,
    )


def _twins(stack: ExitStack, episodes: Sequence[Drawn], source: str) -> list[Trail]:
    """Environments of this process beside those of other processes, for whose rigs policies are
    made.
    """
    twins = [stack.enter_context(closing(_certified_env(episode, source))) for episode in episodes]
    for twin, episode in zip(twins, episodes, strict=True):
        if episode.environment == STREET:
            # Made in this process, a street is there in all that are forked from now on.
            twin.reset()
    return twins


def _begun(episode: Drawn, env: gymnasium.Env[Any, Any]) -> Policy:
    policy = make_policy(episode.policy, env, **AS_LISTED.get(episode.policy, {}))
    policy.reset()
    return policy


def _stepped(
    episodes: Sequence[Drawn], envs: Sequence[Any], vector: Any, observations: Any
) -> list[Played]:
    """Play a vector until the longest episode is over; the policies choose in this process."""
    # An episode that is over is given its last action again, which has no effect. Its policy is not
    # asked, since a privileged one needs an episode that goes on.
    policies = [_begun(episode, env) for episode, env in zip(episodes, envs, strict=True)]
    actions: list[Any] = [None] * len(episodes)
    for _ in range(max(episode.keyframes for episode in episodes)):
        for n, env in enumerate(envs):
            if not env.over:
                actions[n] = policies[n]({name: column[n] for name, column in observations.items()})
        observations = vector.step(np.stack(actions))[0]
    return list(vector.get_attr("played"))


_PLAYERS: dict[str, Callable[[Sequence[Drawn], str], list[Played]]] = {
    SINGLE: in_turns,
    INTERLEAVED: in_turns,
    SYNC: _in_vector,
    ASYNC: partial(_in_vector, context="fork"),
    SUBPROCESS: _in_subprocesses,
}
