"""What the sets learn from: keyframes of drives, of tests of Euro NCAP and of generated streets.

Truth is used here, at training, and nowhere else.

- A play is one street, drive or test under a training seed. Policies play it at budgets between
  0.5 and 20%, drawn evenly by their logarithm; faults of the camera are drawn for every play. What
  aims is drawn, too: somebody else's policy, or, in later rounds, this one with the weights of the
  round before, so that it learns from what its own choice leads to (DAgger: Ross, Gordon and
  Bagnell, A reduction of imitation learning, 2011).
- Of an item the label says after how many of its cells, in its order, an object in range has
  returned three times: of a track its own object, of a camera box an object that has no track. An
  object that shows in several boxes is that of the one which finds it with the fewest cells.
- Of a strip the label is the share of a detection that it brings of objects which no box and no
  track would find: 1 from three returns on. An object that lies in several strips is that of the
  one in which it has most returns, else near ones would count many times.
"""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.core.arrays import Floats, Integers
from care_sim.core.boxes import planar_ranges
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.open_loop import FilmEnv
from care_sim.envs.scenarios import DriveEnv, NcapEnv
from care_sim.evaluation.sightings import RANGE_M
from care_sim.policies import make_policy
from care_sim.policies.base import Policy
from care_sim.policies.learned.learned_sets import LearnedSets
from care_sim.policies.learned.set_items import ItemReader, Items
from care_sim.policies.learned.set_kernels import Numbers, needed_cells
from care_sim.policies.learned.set_network import LEARNED_RETURNS, STEPS
from care_sim.sources.street_films import record
from care_sim.streets.street import make_street
from care_sim.training.scorer_data import front_alone

OTHERS = ("care-spread", "care", "care-sightlines", "care-sector", "all-camera", "history-rows")
"""Policies that are played besides this one."""
OWN_SHARE = 0.6
"""Of the plays of later rounds that this policy plays itself."""
LEAST_BUDGET, MOST_BUDGET = 0.005, 0.2
PLAYS_OF_FILM = 8
"""Plays for which a film is made once."""
KEYFRAMES_S = (0.1, 0.1, 0.2, 0.5)
"""Between two keyframes of a drive or a test."""
KEPT_PER_S = 2
"""Keyframes that become examples: neighbours resemble each other."""
BLIND_SHARE, FAULTLESS_SHARE = 0.12, 0.4
OTHER_STRIPS = 40
"""Strips drawn per keyframe; those with something to be found are all kept."""


@dataclass(frozen=True)
class Example:
    """A keyframe: `inputs` (n, `ITEM_INPUTS`) of its items, the first `boxes` of them of camera
    boxes, and `answers` (n,), a place in `STEPS`, its length for never. Of some strips (s,) the
    `places`, `strips` (s, `STRIP_INPUTS`), `found` and how many strips each stands for, `weights`.
    """

    inputs: Numbers
    boxes: int
    answers: NDArray[np.int8]
    places: NDArray[np.int16]
    strips: Numbers
    found: Numbers
    weights: Numbers


def play(kind: str, seed: int, own: Path | None, faulty: bool = True) -> list[Example]:
    """The examples of the street, the drive or the test of a seed. `own` are this policy's weights,
    of the round before, None in the first. Without `faulty` the camera has no fault.
    """
    rng = np.random.default_rng([seed, len(kind), own is not None])
    return [*_PLAYS[kind](seed, rng, own, faulty)]


def _street(
    seed: int, rng: np.random.Generator, own: Path | None, faulty: bool
) -> Iterator[Example]:
    film = record(make_street(seed))
    for shown in (film, front_alone(film)):
        for _ in range(PLAYS_OF_FILM // 2):
            with closing(FilmEnv(shown, **_conditions(rng, faulty))) as env:
                yield from _examples(env, seed, rng, own)


def _drive(
    seed: int, rng: np.random.Generator, own: Path | None, faulty: bool
) -> Iterator[Example]:
    told: dict[str, Any] = {"keyframe_s": float(rng.choice(KEYFRAMES_S))}
    with closing(DriveEnv(**told, **_conditions(rng, faulty))) as env:
        yield from _examples(env, seed, rng, own)


def _ncap(seed: int, rng: np.random.Generator, own: Path | None, faulty: bool) -> Iterator[Example]:
    told: dict[str, Any] = {"keyframe_s": float(rng.choice(KEYFRAMES_S))}
    with closing(NcapEnv(test="drawn", speed_kph=0, **told, **_conditions(rng, faulty))) as env:
        yield from _examples(env, seed, rng, own)


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


def _examples(
    env: FilmEnv | ClosedLoopEnv, seed: int, rng: np.random.Generator, own: Path | None
) -> Iterator[Example]:
    policy = _player(env, rng, own)
    reader = ItemReader(env.rig, STEPS[-1])
    observation, _ = env.reset(seed=seed)
    policy.reset()
    over = False
    while not over:
        if rng.random() < KEPT_PER_S * env.rig.keyframe_s:
            yield _example(env, reader, reader.of(env.rig.read(observation)), rng)
        observation, _, terminated, truncated, _ = env.step(policy(observation))
        over = terminated or truncated


def _player(env: FilmEnv | ClosedLoopEnv, rng: np.random.Generator, own: Path | None) -> Policy:
    if own is not None and rng.random() < OWN_SHARE:
        return make_policy(
            LearnedSets.name, env, path=own, refresh_per_s=float(rng.choice([0.1, 0.3, 1.0]))
        )
    return make_policy(str(rng.choice(OTHERS)), env)


def _example(
    env: FilmEnv | ClosedLoopEnv, reader: ItemReader, items: Items, rng: np.random.Generator
) -> Example:
    tracks = env.loop.belief.tracks
    objects, boxes, behind = _present(env)
    in_range = planar_ranges(boxes) <= RANGE_M
    numbers = _numbered(behind, objects[in_range])
    present = int(in_range.sum())
    sets = items.sets
    needed = needed_cells(sets.cells, sets.sizes, numbers, present, LEARNED_RETURNS)
    tracked = _numbered(env.loop.true_objects(tracks), objects[in_range])
    answers = np.zeros(len(sets), np.int64)

    # Of a track, its own object.
    rows = np.flatnonzero(tracked >= 0)
    answers[items.boxes + rows] = needed[items.boxes + rows, tracked[rows]]

    # Of a box, an object without a track that no other box finds with fewer cells.
    found = needed[: items.boxes]
    open_ = ~np.isin(np.arange(present), tracked)
    cost = np.where((found > 0) & open_, found, np.inf)
    shown = np.isfinite(cost).any(axis=0) if items.boxes else np.zeros(present, bool)
    for number in np.flatnonzero(shown).tolist():
        box = int(cost[:, number].argmin())
        answers[box] = min(answers[box] or STEPS[-1], int(cost[box, number]))

    # Of a strip, what is left.
    counts = np.bincount(numbers[numbers >= 0], minlength=present)
    left = open_ & ~shown & (counts >= LEARNED_RETURNS)
    strips = _strip_shares(reader, numbers, left)
    return Example(
        items.inputs,
        items.boxes,
        np.where(answers > 0, np.searchsorted(STEPS, answers), len(STEPS)).astype(np.int8),
        *_drawn_strips(strips, reader, items, rng),
    )


def _present(env: FilmEnv | ClosedLoopEnv) -> tuple[Integers, Floats, Integers]:
    """The objects (n,) that perception reports, their boxes (n, 7), and the object behind every
    cell (N,), below 0 for none; in the closed loop an object is a body.
    """
    if isinstance(env, FilmEnv):
        annotations, cloud = env.loop.shot.annotations, env.loop.shot.cloud.to_shots()
        behind = np.full(env.rig.grid.size, -1)
        behind[cloud.cells[::-1]] = cloud.objects[::-1]
        return annotations.objects, annotations.boxes, behind
    world, sensor = env.loop.world, env.loop.sensor
    bodies = np.array([*world.labels()], np.int64)
    return bodies, sensor.boxes_to_local(world.boxes_of(bodies)), env.loop.bodies_behind_cells()


def _numbered(objects: Integers, known: Integers) -> Integers:
    """(n,) the places of `objects` (n,) among the known ones (k,), -1 of others."""
    if not len(known):
        return np.full(len(objects), -1)
    order = np.argsort(known)
    places = order[np.searchsorted(known, objects, sorter=order).clip(0, len(known) - 1)]
    return np.where(known[places] == objects, places, -1)


def _strip_shares(reader: ItemReader, numbers: Integers, left: NDArray[np.bool_]) -> Floats:
    """(S,) the share of a detection that every strip brings of the objects that are left (k,)."""
    behind = numbers[reader.strips]
    shares = np.zeros(len(behind))
    for number in np.flatnonzero(left).tolist():
        returns = (behind == number).sum(axis=1)
        best = int(returns.argmax())
        shares[best] += min(returns[best] / LEARNED_RETURNS, 1)
    return np.minimum(shares, 1)


def _drawn_strips(
    shares: Floats, reader: ItemReader, items: Items, rng: np.random.Generator
) -> tuple[NDArray[np.int16], Numbers, Numbers, Numbers]:
    (full,) = np.nonzero(shares)
    (empty,) = np.nonzero(shares == 0)
    drawn = rng.choice(empty, min(OTHER_STRIPS, len(empty)), replace=False)
    kept = np.concatenate([full, drawn])
    each = np.concatenate([np.ones(len(full)), np.full(len(drawn), len(empty) / len(drawn))])
    return (
        reader.places[kept].astype(np.int16),
        items.strips[kept],
        shares[kept].astype(np.float32),
        each.astype(np.float32),
    )
