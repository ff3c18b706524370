"""The realism study: the worlds of the headline tables under conditions of a real car, one at a
time and together, in both loops.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from care_sim.base.seeds import split_of
from care_sim.core.conditions import YOLOX_CAMERA
from care_sim.core.defaults import CELLS
from care_sim.core.firing.listing import HARDWARE, settled
from care_sim.scenarios.ncap.table import TESTS
from care_sim.sources.scenes import Scene, Source
from care_sim.study.designs.defaults import NCAP_STEP_KPH
from care_sim.study.designs.standards import NcapCase, ncap_cases
from care_sim.study.designs.variants import (
    FilmPlace,
    Group,
    Place,
    TriedOut,
    Variant,
    keep_playable,
)
from care_sim.study.episode_config import EpisodeConfig, of_cases
from care_sim.study.play_config import PlayConfig
from care_sim.study.run_config import FULL, RunConfig

IDEAL = Variant("ideal")
"""The conditions of the headline tables, with which every other one is compared."""
_YOLOX = {"camera_profile": YOLOX_CAMERA}
# The age is the mean of the paper's vehicle, 0.11 to 0.14 s. The closed loop has a picture of that
# instant. A film has pictures only at its keyframes, 0.5 s apart: it uses the newest or the one
# before.
LATE_CAMERA = Variant("yolox camera, 0.12 s late", _YOLOX | {"camera_latency_s": 0.12})
FILM_CAMERA = Variant("yolox camera", _YOLOX)
LATE_FILM_CAMERA = Variant("yolox camera, 0.5 s late", _YOLOX | {"camera_latency": 1})

# A spinning sensor that turns once a keyframe, with the range of the early data sheet of Ouster's
# OS1: a target of 10% returns up to 40 m (docs/returns.md).
_TURN = {"lidar_sweep_s": 0.1}
_RANGE = {"lidar_stated_range_m": 40.0}
_FIRINGS = tuple(
    Variant(f"fires {firing}", {"firing": firing})
    for firing in map(settled, HARDWARE)
    if firing != CELLS
)
_RETURNS = (
    Variant("sweep of 0.1 s", _TURN),
    Variant("range 40 m", _RANGE),
    # The formula does not distinguish fog and rain: this is also the rain with 50 m of sight.
    Variant("range 40 m, visibility 50 m", _RANGE | {"visibility_m": 50.0}),
    # The Met Office calls a shower violent from 50 mm/h on: cars rarely meet more rain.
    Variant("range 40 m, rain 50 mm/h", _RANGE | {"rain_mm_h": 50.0}),
)
CORE_FIRST = Variant("core of every set first", {"cell_order": "core-spread"})
"""A convention that the paper leaves open, and no property of a car."""


def _cars(camera: Variant) -> tuple[Variant, ...]:
    """Return camera, sweep and range together, in clear air: with free cells, and with the units of
    a spinning sensor.
    """
    together = {**camera.changes, **_TURN, **_RANGE}
    segments = {"firing": settled("segments")}
    return (
        Variant("realistic car", together),
        Variant("realistic car, fires segments", together | segments),
    )


CONDITIONS = (IDEAL, LATE_CAMERA, *_FIRINGS, *_RETURNS, CORE_FIRST, *_cars(LATE_CAMERA))
"""Levels of the closed loop."""
FILM_CONDITIONS = (
    IDEAL,
    FILM_CAMERA,
    LATE_FILM_CAMERA,
    *_FIRINGS,
    *_RETURNS,
    CORE_FIRST,
    *_cars(FILM_CAMERA),
)
"""Levels of the open loop."""

Pair = tuple[str, str]
"""Two policies that a headline compares."""
_MOST_KPH = 40.0
"""Up to this speed the full scan avoids all Euro NCAP tests but `CPNCO-50`. Above it, braking is
the limit, not sensing (`results/camera.md`).
"""


@dataclass(frozen=True)
class Headline(Group):
    """A headline table: its worlds, which share scenario and budget, its policies, and the pairs
    that it compares. With `by_collisions` it counts collisions.

    It plays at most `most_seeds` of the requested seeds, shifted by `first_seed`.
    """

    policies: tuple[str, ...]
    pairs: tuple[Pair, ...]
    by_collisions: bool = False
    first_seed: int = 0
    most_seeds: int | None = None

    @property
    def option(self) -> str:
        """Its name on a command line: `dense-3`."""
        return self.name.removesuffix("%").replace(", ", "-")

    def seeds(self, asked: Sequence[int]) -> list[int]:
        """Return the seeds that it plays. Raises InvalidInput if they are of another split."""
        played = [seed + self.first_seed for seed in asked[: self.most_seeds]]
        split_of([*asked, *played])
        return played


def _street(scenario: str, budget: float, *pairs: Pair) -> Headline:
    place = Place(scenario, budget)
    return Headline(f"{place}", (place,), ("history", "all-camera", "care", "fan", FULL), pairs)


def _hardest_cases() -> Iterator[NcapCase]:
    """Return each test at its highest speed up to `_MOST_KPH`, with reported occluders. Tests with
    only higher speeds are left out.
    """
    cases = ncap_cases(tuple(TESTS), NCAP_STEP_KPH)
    for name in TESTS:
        own = [case for case in cases if case.test == name and case.reported is not False]
        if slow := [case for case in own if case.ego_kph <= _MOST_KPH]:
            yield max(slow, key=lambda case: case.ego_kph)


def _ncap(budget: float) -> Headline:
    places = tuple(Place("ncap", budget, case.parameters) for case in _hardest_cases())
    policies = ("history", "all-camera", "care", "history-place", FULL)
    return Headline(
        f"{places[0]}",
        places,
        policies,
        (("care", "history"), ("care", "history-place")),
        by_collisions=True,
        # The seeds of a test are nearly copies of it, so tests are paired.
        most_seeds=1,
    )


HEADLINES = (
    _street("dartout", 0.10, ("care", "history"), ("care", "fan")),
    _street("dense", 0.03, ("care", "history"), ("care", "all-camera"), ("care", "fan")),
    _street("dense", 0.05, ("care", "history"), ("care", "all-camera")),
    _street("cutin", 0.10, ("care", "history")),
    _ncap(0.01),
    _ncap(0.03),
    Headline(
        "drive, 1%",
        (Place("drive", 0.01),),
        ("history", "all-camera", "care", "care-sightlines", "place", FULL),
        (("care-sightlines", "place"), ("care-sightlines", "history"), ("care", "history")),
        by_collisions=True,
        # The seeds of the published drives.
        first_seed=100,
    ),
)
"""The headline tables of the closed loop."""

FILM_PAIRS: tuple[Pair, ...] = (
    ("care", "history"),
    ("care", "all-camera"),
    ("care", "rows"),
    ("care", "place"),
    ("care-sightlines", "care"),
    ("care-sightlines", "place"),
)
"""The orders of the headline table of the open loop, at each of its budgets."""


def headline_conditions(headline: Headline) -> TriedOut[Variant]:
    """The conditions that a headline table can be played under."""
    place = headline.places[0]
    return _fitting(CONDITIONS, place, lambda level: level.configurations(place, ["history"], [0]))


def film_conditions(source: Source, scenes: Sequence[Scene], budget: float) -> TriedOut[Variant]:
    """The conditions that a source can be played under at a budget."""
    place = FilmPlace(source.kind, budget)
    return _fitting(
        FILM_CONDITIONS,
        place,
        lambda level: level.plays(source, scenes[:1], [budget], ["history"]),
    )


def _fitting(
    levels: Sequence[Variant],
    place: Place | FilmPlace,
    tasks: Callable[[Variant], Sequence[RunConfig]],
) -> TriedOut[Variant]:
    """Return the `levels` whose `tasks` can begin. Raises InvalidInput where the ideal conditions
    cannot be played.
    """
    for config in tasks(IDEAL):
        config.try_out()
    return keep_playable(levels, tasks, f"in {place}", lambda level: level.label)


def realism_study(
    seeds: Sequence[int], also: Sequence[str] = (), headlines: Sequence[Headline] = HEADLINES
) -> list[EpisodeConfig]:
    """Return headline tables of the closed loop under every condition; `also` are further policies
    of all.
    """
    made: list[EpisodeConfig] = []
    # All seeds are looked at before the first configuration is made.
    for headline, worlds in [(each, each.seeds(seeds)) for each in headlines]:
        policies = dict.fromkeys([*headline.policies, *also])
        place = headline.places[0]._replace(parameters=())
        for level in headline_conditions(headline).sound:
            # One world of a scenario checks the configurations for all.
            configs = level.configurations(place, policies, worlds)
            made += of_cases(configs, [each.parameters for each in headline.places])
    return [*dict.fromkeys(made)]


def realism_plays(
    source: Source,
    scenes: Sequence[Scene],
    policies: Sequence[str],
    budgets: Sequence[float],
    floor_seeds: Sequence[int] = (0,),
) -> list[PlayConfig]:
    """The first-sighting protocol under every condition."""
    made = [
        config
        for budget in budgets
        for level in film_conditions(source, scenes, budget).sound
        for config in level.plays(source, scenes, [budget], policies, floor_seeds)
    ]
    return [*dict.fromkeys(made)]
