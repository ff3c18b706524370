"""Drawn worlds with their truth, for supervised learning of cells.

Truth is used only here, in training.

A play is one street, drive or test of Euro NCAP under a seed, or one scene of a source. Its budget
is drawn between 0.5 and 20%, uniformly by its logarithm. Then come camera faults: blind in 12% of
the plays, faultless in 40%, otherwise misses, false boxes or delays. Keyframes of a drive or a test
are 0.1 to 0.5 s apart. A film is played with all cameras and with only the front one, the closed
loop's only camera.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import fields, replace
from typing import Any, NamedTuple

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.belief import Belief
from care_sim.core.grid import Cells
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.open_loop import FilmEnv
from care_sim.envs.scenarios import DriveEnv, NcapEnv
from care_sim.loops.film import Film, Shot
from care_sim.loops.one_world import OneWorld
from care_sim.loops.open_loop import OpenLoop
from care_sim.policies.base import Policy
from care_sim.sources.street_films import record
from care_sim.streets.street import make_street

SCENARIOS = "CARE-Drive-v0, CARE-NCAP-v0 and CARE-Street-v0"
LEAST_BUDGET, MOST_BUDGET = 0.005, 0.2
PLAYS_OF_FILM = 8
"""Plays for which a film is made once."""
KEYFRAMES_S = (0.1, 0.1, 0.2, 0.5)
"""Between two keyframes of a drive or a test."""
KEPT_PER_S = 2
"""Keyframes that become examples: neighbours resemble each other."""
BLIND_SHARE, FAULTLESS_SHARE = 0.12, 0.4

AnyEnv = FilmEnv | ClosedLoopEnv


class Present(NamedTuple):
    """Objects at the coming keyframe. Truth."""

    objects: Integers
    """(n,) objects that perception reports; in the closed loop an object is a body."""
    boxes: Floats
    """(n, 7) their boxes, in the sensor frame."""
    cells: Cells
    """(m,) cells of a full scan's returns."""
    behind: Integers
    """(m,) the object of each return, below 0 for none."""


class World(NamedTuple):
    """A training world: the street, drive or test of a seed, or, with a `film`, a source's scene
    that the function makes. A `share` of its keyframes can become examples.
    """

    kind: str
    seed: int
    film: Callable[[], Film] | None = None
    share: float = 1.0


def generated_worlds(worlds: Mapping[str, int], first: int) -> list[World]:
    """Return this many worlds of each kind, with seeds from the first on."""
    return [
        World(kind, seed) for kind, count in worlds.items() for seed in range(first, first + count)
    ]


def plays(world: World, rng: np.random.Generator, faulty: bool = True) -> Iterator[AnyEnv]:
    """Yield the plays of a world, one open at a time, before `reset`. With `faulty=False` the
    camera has no fault.
    """
    if world.film:
        return _film(world.film(), rng, faulty)
    return _PLAYS[world.kind](world.seed, rng, faulty)


def keyframes(env: AnyEnv, policy: Policy, seed: int) -> Iterator[Belief]:
    """Yield the belief at every keyframe of a play, before its cells are chosen; `env` stays there
    until the next belief.
    """
    observation, _ = env.reset(seed=seed)
    policy.reset()
    over = False
    while not over:
        yield env.rig.read(observation)
        observation, _, terminated, truncated, _ = env.step(policy(observation))
        over = terminated or truncated


def kept(env: AnyEnv, rng: np.random.Generator, share: float = 1.0) -> bool:
    """Draw whether a keyframe becomes an example."""
    return bool(rng.random() < KEPT_PER_S * env.rig.keyframe_s * share)


def present(loop: OpenLoop | OneWorld) -> Present:
    """Return the objects at the coming keyframe. Truth."""
    if isinstance(loop, OpenLoop):
        annotations, cloud = loop.shot.annotations, loop.shot.cloud.to_shots()
        return Present(annotations.objects, annotations.boxes, cloud.cells, cloud.objects)
    bodies = np.array([*loop.world.labels()], np.int64)
    boxes = loop.sensor.boxes_to_local(loop.world.boxes_of(bodies))
    behind = loop.bodies_behind_cells()
    return Present(bodies, boxes, np.arange(len(behind)), behind)


def front_alone(film: Film) -> Film:
    """Return the film with only its first camera."""
    return replace(film, cameras=film.cameras[:1], shots=tuple(map(_first_camera, film.shots)))


def views_of(film: Film) -> tuple[Film, ...]:
    """Return the film and, if it has several cameras, the film with only the first."""
    return (film, front_alone(film)) if len(film.cameras) > 1 else (film,)


def _street(seed: int, rng: np.random.Generator, faulty: bool) -> Iterator[AnyEnv]:
    return _film(record(make_street(seed)), rng, faulty)


def _film(film: Film, rng: np.random.Generator, faulty: bool) -> Iterator[AnyEnv]:
    for shown in views_of(film):
        for _ in range(PLAYS_OF_FILM // 2):
            with closing(FilmEnv(shown, **_conditions(rng, faulty))) as env:
                yield env


def _drive(seed: int, rng: np.random.Generator, faulty: bool) -> Iterator[AnyEnv]:
    told: dict[str, Any] = {"keyframe_s": float(rng.choice(KEYFRAMES_S))}
    with closing(DriveEnv(**told, **_conditions(rng, faulty))) as env:
        yield env


def _ncap(seed: int, rng: np.random.Generator, faulty: bool) -> Iterator[AnyEnv]:
    told: dict[str, Any] = {"keyframe_s": float(rng.choice(KEYFRAMES_S))}
    with closing(NcapEnv(test="drawn", speed_kph=0, **told, **_conditions(rng, faulty))) as env:
        yield env


_PLAYS = {"street": _street, "drive": _drive, "ncap": _ncap}


def _conditions(rng: np.random.Generator, faulty: bool) -> dict[str, Any]:
    low, high = np.log([LEAST_BUDGET, MOST_BUDGET])
    drawn = {"budget": float(np.exp(rng.uniform(low, high)))}
    if not faulty:
        return drawn
    kind = rng.random()
    if kind < BLIND_SHARE:
        return {**drawn, "false_negative_rate": 1.0}
    if kind < BLIND_SHARE + FAULTLESS_SHARE:
        return drawn
    return {
        **drawn,
        "false_negative_rate": float(rng.choice([0.0, 0.1, 0.3, 0.6])),
        "false_negative_burst": int(rng.choice([1, 3, 10])),
        "false_positive_rate": float(rng.choice([0.0, 0.3, 1.0])),
        "camera_latency": int(rng.choice([0, 0, 1, 2])),
    }


def _first_camera(shot: Shot) -> Shot:
    seen = shot.seen
    rows = np.flatnonzero(seen.detections.cameras == 0)
    columns = {
        field.name: getattr(seen.detections, field.name)[rows] for field in fields(seen.detections)
    }
    front = replace(
        seen, detections=replace(seen.detections, **columns), objects=seen.objects[rows]
    )
    return replace(shot, seen=front)
