"""The scenes of the open loop: generated streets, or recordings in a folder."""

import os
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Protocol

from care_sim.base.checks import check_known
from care_sim.base.digests import Stamp, data_digest, file_stamp, files_below
from care_sim.base.errors import InvalidInput, shortened
from care_sim.core.conditions import RAYS, FilmedReturns, changed_settings
from care_sim.core.sensor_setup import SensorSetup
from care_sim.loops.film import Film
from care_sim.sensors.setups import DEFAULT_SETUP, sensor_columns, sensor_setup
from care_sim.sources.film_checks import check_film
from care_sim.sources.recordings import Recordings
from care_sim.sources.street_films import check_filmed, record
from care_sim.streets.street import (
    CALIBRATION_SEEDS,
    EVALUATION_SEEDS,
    Street,
    make_street,
    street_name,
)


class Scene(NamedTuple):
    """A scene by name, and the seed that its environment is reset with."""

    name: str
    seed: int


class Source(Protocol):
    """A source of scenes."""

    def __hash__(self) -> int: ...

    def scenes(self) -> list[Scene]:
        """All of them, in order. Raises InvalidInput where they cannot be listed."""

    @property
    def kind(self) -> str:
        """Return the name of the source."""

    @property
    def sensor(self) -> str | SensorSetup:
        """The set-up, its name or its file, whose grid its films hold."""

    def film(self, scene: Scene, returns: FilmedReturns = RAYS) -> Film:
        """The film of a scene whose pulses return by `returns`. Raises InvalidInput where it cannot
        be made.
        """

    def check_returns(self, returns: FilmedReturns) -> None:
        """Raise InvalidInput where no film can be made with `returns`."""

    def files(self, scene: Scene) -> list[Path]:
        """Return the files and folders that a scene is read from."""

    def log(self, scene: Scene) -> str:
        """Name the drive that a scene was cut from."""

    def row(self, scene: Scene) -> dict[str, Any]:
        """Return the columns of a scene's origin: the kind of the source, and for recordings a hash
        of their files, at any place.
        """


@dataclass(frozen=True)
class Generated(ABC):
    """Generated streets, filmed by the `sensor`, a set-up, its name or its file. A subclass says
    their seeds and makes them.
    """

    kind: ClassVar[str] = ""
    sensor: str | SensorSetup = field(default=DEFAULT_SETUP, kw_only=True)

    def __post_init__(self) -> None:
        sensor_setup(self.sensor)

    @abstractmethod
    def seeds(self) -> Sequence[int]:
        """Return the seeds of all scenes, in order."""

    @abstractmethod
    def street(self, seed: int) -> Street:
        """The street of a seed, whatever its name."""

    def cluttered(self, seed: int) -> Street:
        """The street of a seed with clutter. Raises InvalidInput where a source has none."""
        source = type(self).__name__
        raise InvalidInput(f"clutter cannot be switched on: source {source} has no `cluttered`")

    def name(self, seed: int) -> str:
        """Return the name of the scene of a seed."""
        return f"{type(self).__name__.lower()}-{seed:04d}"

    def scenes(self) -> list[Scene]:
        """One per seed."""
        return [Scene(self.name(seed), int(seed)) for seed in self.seeds()]

    def film(self, scene: Scene, returns: FilmedReturns = RAYS) -> Film:
        """The street of the seed, under the name of the scene."""
        street = self.cluttered(scene.seed) if returns.clutter else self.street(scene.seed)
        if not isinstance(street, Street):
            raise InvalidInput(f"street must return a Street, got {type(street).__name__}")
        film = record(replace(street, name=scene.name), sensor_setup(self.sensor), returns)
        check_film(film)
        return film

    def check_returns(self, returns: FilmedReturns) -> None:
        """A street is filmed with all but one; see `care_sim.sources.street_films`."""
        check_filmed(returns)

    def files(self, scene: Scene) -> list[Path]:
        """Return none: code makes a street."""
        return []

    def log(self, scene: Scene) -> str:
        """Return the scene itself: every street is a place of its own."""
        return scene.name

    def row(self, scene: Scene) -> dict[str, Any]:
        """The name of a street says all but the sensor."""
        return {"source": self.kind} | sensor_columns(self.sensor)


@dataclass(frozen=True)
class Streets(Generated):
    """The streets of CARE-Sim: the 150 of the evaluation, or the 20 of the calibration."""

    kind = "streets"
    split: str = "evaluation"

    def seeds(self) -> Sequence[int]:
        """Return the seeds of the split."""
        return SPLITS[self.split]

    def street(self, seed: int) -> Street:
        """See `care_sim.streets.street`."""
        return make_street(seed)

    def cluttered(self, seed: int) -> Street:
        """See `care_sim.streets.clutter`."""
        return make_street(seed, clutter=True)

    def name(self, seed: int) -> str:
        """With its layout."""
        return street_name(seed)


@dataclass(frozen=True)
class Recorded:
    """Scenes of recordings, whose cameras and mounts are their own."""

    recordings: Recordings

    @property
    def sensor(self) -> str | SensorSetup:
        """The set-up of the recordings."""
        return self.recordings.setup

    @property
    def kind(self) -> str:
        """The kind of the recordings."""
        return self.recordings.kind

    def scenes(self) -> list[Scene]:
        """By name. All have one seed, since the name of a scene is part of what draws its faults
        and floor.
        """
        return [Scene(name, 0) for name in self.recordings.scenes()]

    def film(self, scene: Scene, returns: FilmedReturns = RAYS) -> Film:
        """The recorded scene of the name."""
        self.check_returns(returns)
        film = self.recordings.film(scene.name)
        check_film(film, recorded=True)
        return film

    def check_returns(self, returns: FilmedReturns) -> None:
        """The switches of returns need the surfaces that pulses meet, which nobody recorded."""
        for name in changed_settings(returns, RAYS):
            raise InvalidInput(
                f"{name} cannot be changed on recordings: they hold points, and not what returned "
                "them"
            )

    def files(self, scene: Scene) -> list[Path]:
        """Return those of the recorded scene."""
        return self.recordings.files(scene.name)

    def log(self, scene: Scene) -> str:
        """Return that of the recorded scene."""
        return self.recordings.log(scene.name)

    def row(self, scene: Scene) -> dict[str, Any]:
        """The kind, the hash of the scene's files, and how they are read."""
        recording = data_digest(self.files(scene))
        own = {"source": self.kind, "recording": recording}
        told = self.recordings.columns() | self.recordings.scene_columns(scene.name)
        return own | sensor_columns(self.sensor) | told


LONGEST_NUMBER = 40
"""Most digits of a number of scenes. Python refuses to read thousands."""
SPLITS = {"evaluation": EVALUATION_SEEDS, "calibration": CALIBRATION_SEEDS}


def film_of(source: Source, scene: Scene) -> Film:
    """The film of a scene. The last one is kept, for policies that meet the same scene in turn,
    until one of its files changes.
    """
    parts = (files_below(path) if os.path.isdir(path) else [path] for path in source.files(scene))
    return _film_of(source, scene, tuple(file_stamp(file) for part in parts for file in part))


@lru_cache(maxsize=1)
def _film_of(source: Source, scene: Scene, _stamps: tuple[Stamp, ...]) -> Film:
    return source.film(scene)


def chosen_scenes(scenes: list[Scene], names: tuple[str, ...]) -> list[Scene]:
    """Return the chosen scenes. One whole number means that many, from the first, unless it is a
    scene's name. Otherwise texts are names; no text means all scenes. Raises InvalidInput for an
    unknown name or a number that is too large.
    """
    if not names:
        return scenes
    known = {scene.name: scene for scene in scenes}
    if len(names) == 1 and names[0] not in known and _is_number(names[0]):
        count = int(names[0][:LONGEST_NUMBER]) if names[0].isdecimal() else 0
        if not 1 <= count <= len(scenes):
            raise InvalidInput(
                f"scenes must be a number from 1 to {len(scenes)} or names, got "
                f"{shortened(names[0], LONGEST_NUMBER)}"
            )
        return scenes[:count]
    for name in names:
        check_known("scene", name, known)
    # Each once, in the order in which they were asked for.
    return [known[name] for name in dict.fromkeys(names)]


def _is_number(text: str) -> bool:
    """Return True if the text is meant as a number."""
    try:
        float(text[:LONGEST_NUMBER])
    except ValueError:
        return False
    return True
