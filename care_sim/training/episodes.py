"""The table of the validation's episodes, one by one: `episodes.csv` of a training run.

A row is an episode of a rule, or of the learner after so many steps. Means hide in which episodes
a learner is good; performance profiles need each.
"""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from care_sim.base.checks import LARGEST_INTEGER, is_number
from care_sim.base.files import replacing
from care_sim.training.csv_tables import read_table

EPISODES = "episodes.csv"
LEARNER = "learner"
"""In the place of a rule's name."""
_LARGEST_DRAWN = 1e30


class Played(NamedTuple):
    """How an episode was played: the return, and the metres at which the first-sighting actor was
    detected, 0 where it never was; None in the open loop.
    """

    seed: int
    env: str
    total: float
    distance_m: float | None


class EpisodeRow(NamedTuple):
    """An episode of the policy of that name; of the learner after so many environment steps."""

    policy: str
    steps: int
    played: Played


COLUMNS = ("policy", "steps", "seed", "env", "return", "distance_m")


def write_episodes(folder: Path, rows: Iterable[EpisodeRow]) -> None:
    """Write the table anew."""
    with replacing(folder / EPISODES) as unfinished, unfinished.open("w", newline="") as file:
        csv.writer(file).writerows(
            [COLUMNS, *((policy, steps, *played) for policy, steps, played in rows)]
        )


def read_episodes(folder: Path) -> list[EpisodeRow]:
    """The table of a run; of a run before there was one it is empty. Raises InvalidInput for a
    damaged file.
    """
    return read_table(folder / EPISODES, COLUMNS, _row)


def _row(row: Sequence[str]) -> EpisodeRow:
    """A row of the table. Raises ValueError for what is no number that can be drawn."""
    policy, steps, seed, env, total, metres = row
    distance = float(metres) if metres else None
    numbers = [float(total), *([] if distance is None else [distance])]
    whole = int(steps), int(seed)
    if not (
        all(0 <= number <= LARGEST_INTEGER for number in whole)
        and all(is_number(number) and abs(number) <= _LARGEST_DRAWN for number in numbers)
    ):
        raise ValueError(f"{', '.join(row)} are no numbers of an episode")
    return EpisodeRow(policy, whole[0], Played(whole[1], env, numbers[0], distance))
