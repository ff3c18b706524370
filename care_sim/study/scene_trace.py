"""One play of the open loop, watched: a configuration in, its outcome and its keyframes out."""

import time
from collections.abc import Callable
from dataclasses import asdict
from typing import NamedTuple, cast

import care_sim
from care_sim.envs.open_loop import OpenLoopEnv
from care_sim.evaluation.recall import SceneScore
from care_sim.loops.film import Film
from care_sim.loops.open_loop import OpenLoop, SceneKeyframe
from care_sim.policies.base import Policy
from care_sim.study.episode_play import GymEnv
from care_sim.study.play_config import PlayConfig
from care_sim.study.run_config import Row
from care_sim.study.scene_play import play_hash

SceneWatcher = Callable[[OpenLoop, SceneKeyframe], None]


class PlayedScene(NamedTuple):
    """A play: its row, the record of every keyframe and what it found (both hold truth)."""

    row: Row
    keyframes: list[SceneKeyframe]
    score: SceneScore


def trace_scene(
    config: PlayConfig,
    film: Film,
    *watchers: SceneWatcher,
    begin: Callable[[OpenLoop], None] = lambda _loop: None,
    wrap: Callable[[GymEnv, Policy], GymEnv] = lambda env, _policy: env,
) -> PlayedScene:
    """Play a policy through the film of its scene.

    The row has every parameter of `PlayConfig.row`, the fields of
    `care_sim.evaluation.recall.SceneOutcome`, `version`, `keyframes`, `wall_s` and the
    `episode_hash` that `care_sim.study.scene_play` gives the same play. `begin` is called before
    the first keyframe, `watchers` after each; `wrap` puts wrappers that watch around the
    environment.
    """
    started = time.perf_counter()
    inner = config.make_env(film)
    policy = config.make_policy(inner)
    keyframes = []
    with wrap(inner, policy) as env:
        played = cast(OpenLoopEnv, env.unwrapped)
        observation, _ = env.reset(seed=config.scene.seed)
        policy.reset()
        begin(played.loop)
        while not played.loop.over:
            observation, *_ = env.step(policy(observation))
            keyframes.append(played.last)
            for watch in watchers:
                watch(played.loop, played.last)
        score, records = played.score, played.keyframes
    row = {
        **config.row(),
        "version": care_sim.__version__,
        **asdict(score.outcome()),
        "keyframes": len(keyframes),
        "wall_s": time.perf_counter() - started,
        "episode_hash": play_hash(records),
    }
    return PlayedScene(row, keyframes, score)
