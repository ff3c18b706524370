"""Recorded drives in a folder: what a kind of recordings must tell."""

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
    """What a built-in one is called; one of another package is called by its entry or place."""
    shipped: ClassVar[Path | None] = None
    """The folder of recordings that come with the package, which are called by their kind alone."""
    suffixes: ClassVar[tuple[str, ...]] = ()
    """Ends of files that may stand for the folder."""
    licence: ClassVar[str] = ""
    """The licence of the recordings, as a card of weights tells it."""
    folder: Path

    @abstractmethod
    def scenes(self) -> list[str]:
        """The names of all scenes, in order."""

    @abstractmethod
    def film(self, scene: str) -> Film:
        """The film of a scene by name."""

    def files(self, scene: str) -> list[Path]:
        """Return all files and folders that `film` reads, missing ones included: a play is played
        again after one of them has changed. By default that is the whole folder.
        """
        return [self.folder]

    def log(self, scene: str) -> str:
        """Name the drive that a scene was cut from, by default the scene itself. Training holds out
        whole drives.
        """
        return scene

    @property
    def setup(self) -> str | SensorSetup:
        """The set-up, its name or its file, whose grid the films hold."""
        return DEFAULT_SETUP

    def columns(self) -> dict[str, Any]:
        """Columns of a row that tell how the recordings are read, where it is not the usual way."""
        return {}

    def scene_columns(self, scene: str) -> dict[str, Any]:
        """Columns that tell how a scene is read, where it is not the usual way."""
        return {}
