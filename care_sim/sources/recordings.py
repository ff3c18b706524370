"""Recorded drives in a folder: the interface of a kind of recordings."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from care_sim.core.sensor_setup import SensorSetup
from care_sim.loops.film import Film
from care_sim.sensors.setups import DEFAULT_SETUP


@dataclass(frozen=True)
class Recordings(ABC):
    """The recorded scenes in a folder. Raises InvalidInput, with file and token, for what cannot be
    read.
    """

    kind: ClassVar[str] = ""
    """Name of a built-in kind; a foreign one is named by its entry or place."""
    shipped: ClassVar[Path | None] = None
    """The folder of shipped recordings, which are named by their kind only."""
    suffixes: ClassVar[tuple[str, ...]] = ()
    """Ends of files that may stand for the folder."""
    licence: ClassVar[str] = ""
    """The licence of the recordings, for cards of weights."""
    folder: Path

    @abstractmethod
    def scenes(self) -> list[str]:
        """The names of all scenes, in order."""

    @abstractmethod
    def film(self, scene: str) -> Film:
        """The film of a scene by name."""

    def files(self, scene: str) -> list[Path]:
        """Return all files and folders that `film` reads, missing ones included, by default the
        whole folder. A play is repeated after one of them has changed.
        """
        return [self.folder]

    def log(self, scene: str) -> str:
        """Name the drive that a scene was cut from, by default the scene itself. Training holds out
        whole drives.
        """
        return scene

    @property
    def setup(self) -> str | SensorSetup:
        """The set-up, its name or its file, whose grid the films hold: that of a field `sensor`."""
        sensor: str | SensorSetup = getattr(self, "sensor", DEFAULT_SETUP)
        return sensor

    def columns(self) -> dict[str, Any]:
        """Return the columns of a row for unusual options of reading."""
        return {}

    def scene_columns(self, scene: str) -> dict[str, Any]:
        """Return the columns of a row for unusual options of reading a scene."""
        return {}
