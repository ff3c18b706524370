"""Episodes of validation seeds, without exploration, and the table of them: `episodes.csv` of a
run.

A row is an episode of a rule, or of the learner after so many steps. Means hide in which episodes
a learner is good; performance profiles need each.
"""

import csv
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

import gymnasium
import numpy as np
from numpy.typing import NDArray

import care_sim
from care_sim.base.checks import LARGEST_INTEGER, is_number
from care_sim.base.errors import InvalidInput
from care_sim.base.files import replacing
from care_sim.base.json_text import check_file_size

_Row = TypeVar("_Row")


def read_table(
    path: Path, columns: Sequence[str], row_of: Callable[[list[str]], _Row]
) -> list[_Row]:
    """The rows of a table, none of one that is not there; `row_of` raises ValueError for one that
    is damaged. Raises InvalidInput for a damaged file.
    """
    if not path.exists():
        return []
    try:
        check_file_size(path)
        with path.open(newline="", encoding="utf-8") as file:
            head, *rows = csv.reader(file)
        if head != [*columns]:
            raise ValueError(f"its columns are not {', '.join(columns)}")
        return [row_of(row) for row in rows]
    except (ValueError, csv.Error) as error:
        raise InvalidInput(f"{path} is damaged: {error}") from error


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


Choose = Callable[[Any, bool], NDArray[np.float32]]
"""The action for an observation. The flag tells that the episode begins with it."""


class Learner(Protocol):
    """What acts: any algorithm of Stable-Baselines3."""

    def predict(
        self, observation: Any, state: Any, episode_start: Any, deterministic: bool
    ) -> tuple[Any, Any]:
        """Action and memory."""
        ...


@dataclass(frozen=True)
class ValidationScore:
    """Means over episodes: the return, and the first-detection distance.

    That is the distance at which the first-sighting actor was detected, metres; 0 where it never
    was, None unless every episode has one: in the open loop there is none.
    """

    episodes: int
    mean_return: float
    distance_m: float | None

    @classmethod
    def of(cls, played: Sequence[Played]) -> "ValidationScore":
        """The means of one episode or more."""
        metres = [one.distance_m for one in played if one.distance_m is not None]
        mean_m = float(np.mean(metres)) if len(metres) == len(played) else None
        return cls(len(played), float(np.mean([one.total for one in played])), mean_m)

    def __str__(self) -> str:
        seen = (
            ""
            if self.distance_m is None
            else f", first detection at {self.distance_m:.2f} m (0 where never)"
        )
        return f"return {self.mean_return:.2f}{seen}"


def play(env: gymnasium.Env[Any, Any], choose: Choose, episodes: Mapping[int, str]) -> list[Played]:
    """Play the episodes of the seeds, whose environments are named."""
    return [_episode(env, choose, seed, name) for seed, name in episodes.items()]


def acting(learner: Learner) -> Choose:
    """The learner's choice, with its memory from keyframe to keyframe."""
    memory = None

    def choose(observation: Any, begins: bool) -> NDArray[np.float32]:
        nonlocal memory
        begin = np.array([begins])
        action, memory = learner.predict(
            observation, None if begins else memory, begin, deterministic=True
        )
        return np.asarray(action)

    return choose


def rule(name: str, env: gymnasium.Env[Any, Any]) -> Choose:
    """The choice of a policy by name, made anew for every episode: where episodes are drawn, each
    has a rig of its own.
    """
    policy: care_sim.Policy

    def choose(observation: Any, begins: bool) -> NDArray[np.float32]:
        nonlocal policy
        if begins:
            policy = care_sim.make_policy(name, env.unwrapped)
            policy.reset()
        return policy(observation)

    return choose


def _episode(env: gymnasium.Env[Any, Any], choose: Choose, seed: int, name: str) -> Played:
    observation, _ = env.reset(seed=seed)
    total = 0.0
    begins = True
    over = False
    while not over:
        observation, reward, terminated, truncated, info = env.step(choose(observation, begins))
        total = total + float(reward)
        begins = False
        over = terminated or truncated
    outcome: dict[str, Any] = info["outcome"]
    # An actor who is never detected counts as 0 m, the worst there is. The open loop has no such
    # distance.
    distance = outcome["detection_distance_m"] or 0.0 if "detection_distance_m" in outcome else None
    return Played(seed, name, total, distance)
