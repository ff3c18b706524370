"""Tight tests: Euro NCAP tests in which the full scan only just avoids the collision. `python -m
tests.helpers.tight_tests` prints the list in `care_sim/study/benchmark/worlds.json`.

In ordinary tests, policies with a camera avoid nearly all collisions at 1% of the cells. In a tight
test the brake reacts as late as the full scan can afford. A reaction one keyframe longer makes even
the full scan collide. Tests in which the full scan could react after `LATEST_S` are left out.

Only the full scan decides, with the main detector. Policies played on seeds 2,000 to 2,059 alone
before `LATEST_S` was fixed.
"""

import json
from collections.abc import Callable, Sequence
from functools import partial
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import cast

from care_sim.base.errors import InvalidInput
from care_sim.study.benchmark.budgets import EPISODES_PLAYED, MAIN_DETECTOR
from care_sim.study.benchmark.play import Player, player_in
from care_sim.study.benchmark.suite import FIRST_SEED, TESTS, TIGHT_TESTS, configurations
from care_sim.study.rows.reading import is_avoided
from care_sim.study.run_config import FULL, Row

USUAL_S, LATEST_S = 0.3, 2.0
"""The usual reaction of the brake, and the reaction of a slow driver, seconds."""
_TENTHS = 10
"""Reactions are whole tenths of a second, so that two of them are a keyframe apart."""

_AT_ONCE = 60
"""Seeds that are tried together."""

Case = tuple[int, float]
"""Seed of a test, and reaction of the brake in seconds."""


def tight_reactions_of(
    seeds: Sequence[int], play: Callable[[Sequence[Case]], Sequence[Row]]
) -> dict[int, float]:
    """Return the brake's reaction by seed, in seconds, for the seeds that make a tight test.

    `play` returns the full scan's rows. The full scan avoids the collision with this reaction, and
    collides with one that is a keyframe longer.
    """
    first, last = round(USUAL_S * _TENTHS), round(LATEST_S * _TENTHS)
    usual, latest = (play([(seed, tenths / _TENTHS) for seed in seeds]) for tenths in (first, last))
    # The lower bound never collides and the upper one does, so halving ends at such a pair.
    bounds = {
        seed: (first, last)
        for seed, quick, slow in zip(seeds, usual, latest, strict=True)
        if slow["collision"] and not quick["collision"]
    }
    while middles := {seed: sum(own) // 2 for seed, own in bounds.items() if own[1] - own[0] > 1}:
        rows = play([(seed, tenths / _TENTHS) for seed, tenths in middles.items()])
        for (seed, tenths), row in zip(middles.items(), rows, strict=True):
            low, high = bounds[seed]
            bounds[seed] = (low, tenths) if row["collision"] else (tenths, high)
    found = [(seed, low / _TENTHS) for seed, (low, _) in bounds.items()]
    # A needless stop avoids nothing.
    return {
        case[0]: case[1] for case, row in zip(found, play(found), strict=True) if is_avoided(row)
    }


def full_scans(player: Player, cases: Sequence[Case]) -> list[Row]:
    """Play the full scan in tests. Raises InvalidInput where a play fails."""
    configs = [
        configurations(TESTS, [seed], FULL, detector=MAIN_DETECTOR, brake_reaction_s=reaction_s)[0]
        for seed, reaction_s in cases
    ]
    rows = player.rows(configs)
    if player.failures:
        raise InvalidInput(str(player.failures[0]))
    return cast(list[Row], rows)


def main() -> None:
    """Print the first tight tests as JSON: the brake's reaction by seed."""
    found: dict[int, float] = {}
    number = EPISODES_PLAYED[TIGHT_TESTS]
    with TemporaryDirectory() as folder, player_in(Path(folder), 2) as player:
        for first in count(FIRST_SEED, _AT_ONCE):
            if len(found) >= number:
                break
            found |= tight_reactions_of(range(first, first + _AT_ONCE), partial(full_scans, player))
    print(json.dumps(dict(list(found.items())[:number])))


if __name__ == "__main__":
    main()
