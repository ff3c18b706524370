"""What policies would fire on one shared belief: one of them drives, the others are asked.

Two policies that play by themselves soon hold other tracks, and then differ for that reason too. On
one belief they differ by their rule alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from care_sim.core.grid import Cells
from care_sim.core.residual import camera_layers
from care_sim.evaluation.reserve_use import ReserveUse, reserve_use
from care_sim.evaluation.sightings import Sightings
from care_sim.loops.film import Film
from care_sim.study.appearances import NewObject, new_objects
from care_sim.study.play_config import PlayConfig


@dataclass
class SharedBelief:
    """What happened while one policy drove through a film.

    `fired` are the cells of every keyframe by the name of the policy, `received` how many of them
    lie in the hull of each new object; `entries` are those objects, and `reserve` what the camera's
    wedges made of the reserve.
    """

    fired: dict[str, list[Cells]]
    received: dict[str, list[int]]
    entries: list[NewObject] = field(default_factory=list)
    reserve: ReserveUse = field(default_factory=ReserveUse)


def share_belief(
    driver: PlayConfig, others: Sequence[PlayConfig], film: Film, sightings: Sightings
) -> SharedBelief:
    """Let the `driver` play its film, and ask the `others` at every keyframe what they would fire
    there. They have its budget and its conditions.
    """
    with driver.make_env(film) as env:
        policies = {config.policy: config.make_policy(env) for config in (*others, driver)}
        observation, _ = env.reset(seed=driver.scene.seed)
        for policy in policies.values():
            policy.reset()
        shared = SharedBelief({name: [] for name in policies}, {name: [] for name in policies})
        rig = env.rig
        while not env.loop.over:
            # What the policies make of the observation, in its precision.
            belief = rig.read(observation)
            entries = new_objects(env.loop, belief, sightings)
            layers = camera_layers(belief, rig)
            hulls = rig.hulls(belief.tracks.boxes)
            shared.reserve += reserve_use(hulls, *layers, rig.budget, rig.reserve_fraction)
            actions = {name: policy(observation) for name, policy in policies.items()}
            for name, action in actions.items():
                fired = env.would_fire(action)
                shared.fired[name].append(fired)
                shared.received[name] += [int(np.isin(new.hull, fired).sum()) for new in entries]
            shared.entries += entries
            observation, *_ = env.step(actions[driver.policy])
    return shared
