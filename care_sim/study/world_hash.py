"""A hash of the world that a scenario builds of a seed: it differs between policies where the
scenario draws from more than the seed.
"""

import hashlib
from collections.abc import Iterable, Iterator
from contextlib import closing

import numpy as np

from care_sim.base.digests import Content, portable_bytes
from care_sim.base.errors import InvalidInput
from care_sim.base.times import LAST_BITS_S
from care_sim.core.conditions import DriverSettings
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.study.run_config import Row
from care_sim.world.world import World


def world_hash(env: ClosedLoopEnv, seed: int) -> str:
    """Return a hash of what stands in the world of a seed, and how it moves while the ego keeps its
    speed, and while it brakes; measured numbers rounded (`care_sim.base.digests`). The world
    is built anew.
    """
    content = hashlib.sha256()
    # Somebody may react to a brake alone.
    for acceleration in (0.0, -DriverSettings().brake_mps2):
        with closing(env.episode(seed).world) as world:
            content.update(portable_bytes(*_told(world)))
            bodies = np.array([world.ego_body, *(actor.body for actor in world.actors)])
            while world.time < env.scenario.duration_s - LAST_BITS_S and not world.is_over():
                content.update(portable_bytes(world.boxes_of(bodies)[:, [0, 1, 6]]))
                world.step(acceleration)
    return content.hexdigest()[:16]


def _told(world: World) -> Iterator[tuple[Content, ...]]:
    """What is in a world before anything moves: the bodies with their parts, whom it is about, and
    what its scenario says that it has drawn.
    """
    for actor in world.actors:
        kind = actor.kind
        yield actor.name, str(kind.label), actor.reported, kind.size
        yield from ((part.shape, part.material, part.size, part.centre) for part in kind.parts)
    yield (world.first_sighting.name if world.first_sighting else "",)
    yield from sorted(world.drawn.items())


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
