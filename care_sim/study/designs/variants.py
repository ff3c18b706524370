"""Variants of a study: places, levels, and the keys of their rows. A design is a table of them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, NamedTuple, TypeVar

from care_sim.base.errors import InvalidInput, percent
from care_sim.perception.detectors import PROXY
from care_sim.sources.scenes import Scene, Source
from care_sim.study.episode_config import EpisodeConfig, grid
from care_sim.study.play_config import PlayConfig, play_grid
from care_sim.study.rows.parameters import Parameters
from care_sim.study.rows.reading import Key, key_of
from care_sim.study.run_config import FULL, Row, RunConfig, flat

_Thing = TypeVar("_Thing")


class Place(NamedTuple):
    """A scenario with optional parameters, and a budget, in which every level is played."""

    scenario: str
    budget: float
    parameters: Parameters = ()

    def row(self) -> Row:
        """As columns of an episode."""
        given = flat("scenario", self.parameters)
        return {"scenario": self.scenario, "budget": self.budget} | given

    def __str__(self) -> str:
        return f"{self.scenario}, {percent(self.budget)}"


@dataclass(frozen=True)
class Group:
    """Places whose episodes are pooled."""

    name: str
    places: tuple[Place, ...]


class FilmPlace(NamedTuple):
    """A kind of source and a budget, in which every level is played in the open loop. `shared` are
    further columns of all its plays, such as those of a sensor set-up.
    """

    source: str
    budget: float
    shared: tuple[tuple[str, Any], ...] = ()

    def row(self) -> Row:
        """As columns of a play."""
        own = {"source": self.source, "detector": PROXY, "budget": self.budget}
        return dict(self.shared) | own

    def __str__(self) -> str:
        return f"{self.source}, {percent(self.budget)}"


@dataclass(frozen=True)
class Variant:
    """One level of a factor: conditions that differ from the defaults, or parameters of the policy.
    If the level is another policy, `policy` plays instead of the study's own.
    """

    label: str
    changes: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, Any] = field(default_factory=dict)
    policy: str | None = None

    def configurations(
        self, place: Place, policies: Iterable[str], seeds: Sequence[int]
    ) -> list[EpisodeConfig]:
        """Return the episodes of this level; `full` runs once for all conditions that do not affect
        it.
        """
        played = [self.policy or policy for policy in policies]
        given = self._given() | {"scenario_parameters": place.parameters}
        return grid([place.scenario], played, [place.budget], seeds, **given)

    def plays(
        self,
        source: Source,
        scenes: Sequence[Scene],
        budgets: Sequence[float],
        policies: Iterable[str],
        floor_seeds: Sequence[int] = (0,),
    ) -> list[PlayConfig]:
        """Return the plays of this level in the open loop; `full` also plays once."""
        played = [self.policy or policy for policy in policies]
        return play_grid(source, scenes, played, budgets, floor_seeds, **self._given())

    def for_others(self) -> "Variant":
        """The same conditions for policies that lack the parameters."""
        return Variant(self.label, self.changes)

    def key(self, place: Place | FilmPlace, policy: str) -> Key:
        """The cell of the rows of a policy at this level."""
        row = place.row() | {"policy": self.policy or policy} | dict(self.changes)
        # The key of a row with these values, made as for rows.
        setting, played, budget = key_of(row | flat("policy", tuple(self.parameters.items())))
        # The full scan was run once for all levels that it does not feel.
        return (setting.for_full(), FULL, 1.0) if policy == FULL else (setting, played, budget)

    def _given(self) -> dict[str, Any]:
        return {**self.changes, "policy_parameters": tuple(self.parameters.items())}


USUAL_VARIANT = Variant("usual")


class TriedOut(NamedTuple, Generic[_Thing]):
    """Things that can be played, and a line for each of the others."""

    sound: list[_Thing]
    left_out: list[str]


def keep_playable(
    things: Iterable[_Thing],
    tasks: Callable[[_Thing], Iterable[RunConfig]],
    where: str,
    label: Callable[[_Thing], str] = str,
) -> TriedOut[_Thing]:
    """Return the `things` whose `tasks` can begin. Reasons against it: a budget below one unit of
    the hardware, a set-up that units do not divide, a recording without returns.
    """
    found = TriedOut[_Thing]([], [])
    for thing in things:
        try:
            for config in tasks(thing):
                config.try_out()
            found.sound.append(thing)
        except InvalidInput as error:
            found.left_out.append(f"left out {where}: {label(thing)} ({error})")
    return found
