"""A hash of the world that a scenario builds of a seed: it differs between policies where the
scenario draws from more than the seed.
"""

import hashlib
from collections.abc import Iterable
from contextlib import closing

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.base.portable_hash import portable_bytes
from care_sim.base.times import LAST_BITS_S
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.study.run_config import Row


def world_hash(env: ClosedLoopEnv, seed: int) -> str:
    """Return a hash of what stands in the world of a seed, and how it moves while the ego keeps its
    speed, measured numbers rounded (`care_sim.base.portable_hash`). The world is built anew.
    """
    with closing(env.episode(seed).world) as world:
        actors = [(actor.name, actor.kind.size, actor.reported) for actor in world.actors]
        bodies = np.array([world.ego_body, *(actor.body for actor in world.actors)])
        content = hashlib.sha256(portable_bytes(*actors))
        while world.time < env.scenario.duration_s - LAST_BITS_S and not world.is_over():
            content.update(portable_bytes(world.boxes_of(bodies)[:, [0, 1, 6]]))
            world.step(0.0)
    return content.hexdigest()[:16]


def check_worlds(rows: Iterable[Row]) -> None:
    """Raise InvalidInput where two rows of one scenario and seed met different worlds. Rows without
    a `world_hash` are not checked: the built-in scenarios draw everything from the seed.
    """
    first: dict[object, Row] = {}
    for row in rows:
        if not row.get("world_hash"):
            continue
        given = sorted((name, repr(row[name])) for name in row if name.startswith("scenario."))
        other = first.setdefault((row["scenario"], row["seed"], *given), row)
        if other["world_hash"] != row["world_hash"]:
            raise InvalidInput(
                f"scenario {row['scenario']} builds one world for {other['policy']} and another "
                f"for {row['policy']} of the seed {row['seed']}: it draws outside its rng, or its "
                "code has changed; draw everything from the rng that build receives"
            )
