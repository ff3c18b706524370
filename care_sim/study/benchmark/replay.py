"""Replay of results: whether a file is what its policy does, by a tenth of its worlds."""

from collections.abc import Sequence
from dataclasses import dataclass
from random import Random
from typing import Any

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.evaluation.smallest_budget import LEAST_WORLDS
from care_sim.policies import tags_of
from care_sim.study.benchmark.budgets import BudgetResult, budget_tasks, play_budgets
from care_sim.study.benchmark.maker import made_by
from care_sim.study.benchmark.play import Player
from care_sim.study.benchmark.recorded import RECORDED_PARTS, RecordedDrive
from care_sim.study.benchmark.suite import FIRST_SEED, STREETS, Salt

ONE_IN = 10
"""One world in so many of every part is played again, and at least `LEAST_WORLDS`: a single
recorded drive may have one newcomer."""
ROUNDING = 0.01
"""The sum of a count may move by this share of the full scan's on another machine or library. Other
rounding of the last bit of a direction fires other cells."""


@dataclass(frozen=True)
class Replay:
    """Result of playing worlds again: the number of worlds `played` and the worlds with `differing`
    counts. `moved` is the largest move of the sum of a count, as a share of the full scan's.
    `false` lists what else is false in the file.
    """

    played: int
    differing: tuple[tuple[str, int | str], ...]
    moved: float
    false: tuple[str, ...]


def replayed(
    result: BudgetResult,
    player: Player,
    rng: Random,
    salt: Salt | None = None,
    drives: Sequence[RecordedDrive] = (),
) -> Replay:
    """Play a random tenth of the worlds of every part of a result again, at least `LEAST_WORLDS`;
    recorded ones are among the `drives`.

    A world differs where any count differs. By the code, libraries and machine that the file names
    every difference is false; by others, differences that move a sum by more than `ROUNDING` are.

    Raises InvalidInput for a sealed result without its salt, for a recorded drive that is not
    given, and where a play fails.
    """
    if result.sealed != (salt.digest if salt else None):
        of = f"sealed by the salt {result.sealed[:12]}" if result.sealed else "published or fresh"
        raise InvalidInput(f"its worlds are {of}: give --sealed the file of that salt, or none")
    at_hand = {drive.name: drive for drive in drives}
    for part, world in result.worlds:
        if part in RECORDED_PARTS and world not in at_hand:
            raise InvalidInput(f"it plays {world}: give --recorded the sources of its drives")
    # A policy that cannot be loaded here has its line before anything is played.
    looking = result.detector, result.detector_parameters
    budget_tasks(result.entry, STREETS, [FIRST_SEED], *looking)[0][-1].try_out()
    worlds: dict[str, list[Any]] = {}
    for part in result.parts:
        own = [world for of, world in result.worlds if of == part]
        count = min(max(-(-len(own) // ONE_IN), LEAST_WORLDS), len(own))
        drawn = sorted(rng.sample(own, count), key=own.index)
        worlds[part] = [at_hand.get(str(world), world) for world in drawn]
    found = play_budgets(
        [result.entry],
        player,
        result.detector,
        worlds,
        salt=salt,
        detector_parameters=result.detector_parameters,
    )
    if player.failures:
        raise InvalidInput(str(player.failures[0]))
    (again,) = found
    told = result.cut_to(again.worlds)
    assert told is not None
    pairs = zip(told.rows, again.rows, strict=True)
    differing = tuple((one.part, one.world) for one, other in pairs if one != other)
    moved = _moved(told, again)
    here = made_by(result.entry, result.detector_parameters)
    is_false = moved > ROUNDING or (differing and result.made_by == here)
    false = [f"{len(differing)} of {len(told.rows)} worlds have other counts"] if is_false else []
    return Replay(len(told.rows), differing, moved, (*_false_tags(result), *false))


def _moved(told: BudgetResult, again: BudgetResult) -> float:
    moves = [0.0]
    for one, other in zip(told.counts, again.counts, strict=True):
        full = np.maximum(one.full.sum(axis=0), 1.0)
        for mine, theirs in ((one.full, other.full), (one.got, other.got)):
            moves.append(float(np.max(np.abs(mine.sum(axis=0) - theirs.sum(axis=0)) / full)))
    return max(moves)


def _false_tags(result: BudgetResult) -> Sequence[str]:
    tags = tags_of(result.entry.policy)
    if {*tags} == {*result.tags}:
        return []
    return [f"it says that the policy is {', '.join(result.tags)}, and it is {', '.join(tags)}"]
