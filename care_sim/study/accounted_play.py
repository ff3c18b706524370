"""A play with the account of its rays: who fired those that hit a new object, and why others were
missed.
"""

from dataclasses import dataclass

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Integers
from care_sim.evaluation.miss_reasons import miss_reason
from care_sim.evaluation.ray_shares import RAY_SHARES, ServedDemand, rays_by_share
from care_sim.evaluation.sightings import Sightings
from care_sim.loops.film import Film
from care_sim.study.appearances import new_objects
from care_sim.study.play_config import PlayConfig

FOUND = ""
"""Stands for a reason where nothing was missed."""


@dataclass(frozen=True)
class Account:
    """Event by event, e of them in the order of `Sightings.events`: the censored times to first
    detection `delays` in keyframes, the `reasons` why they were missed at their first keyframe,
    `FOUND` where they were not, the marks 1 or 0 of those that had a track already (`tracked`), and
    `rays` (e, 5) by share of those that hit them at that keyframe.
    """

    keyframes: int
    delays: list[int]
    reasons: list[str]
    tracked: list[int]
    rays: Integers


def account_play(config: PlayConfig, film: Film, sightings: Sightings) -> Account:
    """Play a policy through the film of its scene, and account for its rays.

    Raises InvalidInput for a policy that answers without a demand.
    """
    reasons: list[str] = []
    tracked: list[int] = []
    rays = [np.empty((0, len(RAY_SHARES)), np.int64)]
    with config.make_env(film) as env:
        policy = config.make_policy(env)
        observation, _ = env.reset(seed=config.scene.seed)
        policy.reset()
        rig = env.rig
        while not env.loop.over:
            entries = new_objects(env.loop, rig.read(observation), sightings)
            observation, *_ = env.step(policy(observation))
            if not entries:
                continue
            if policy.demanded is None:
                raise InvalidInput(
                    f"policy {config.policy} states no demand, without which its rays cannot be "
                    "accounted for"
                )
            fired = env.keyframes[-1].fired
            served = ServedDemand.of(policy.demanded, fired, rig)
            for new in entries:
                seen = new.appearance
                reasons.append(miss_reason(seen, served, config.min_returns))
                tracked.append(int(seen.tracked))
                rays.append(rays_by_share(seen.returns, served)[None])
        delays = env.score.delays.tolist()
        keyframes = len(env.keyframes)
    # A reason was worked out for every event; only those of misses stand.
    told = [reason if delay else FOUND for reason, delay in zip(reasons, delays, strict=True)]
    return Account(keyframes, delays, told, tracked, np.concatenate(rays))
