"""Options of the trainings on truth. Help loads them without a simulator."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from care_sim.base.checks import LARGEST_INTEGER, bounded, check_fields, check_known

Part = Literal["attention", "inputs", "place", "faults"]
"""Parts that the training of `learned-sets` can leave out."""


@dataclass(frozen=True)
class FitConfig:
    """Options of every training on truth."""

    out: Path
    """File to write."""
    seed: int = bounded(0, 0, LARGEST_INTEGER)
    """Seed of the first weights and the order of the examples."""

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class PlaceConfig:
    """Make the map of `place` from the 20 calibration streets and write it."""

    out: Path
    """File to write."""


@dataclass(frozen=True)
class TunedPlaceConfig:
    """Make the map of `tuned-place` from streets of training seeds and write it."""

    out: Path
    """File to write."""
    streets: int = bounded(60, 1, 10_000)
    """Streets to tune it to."""


@dataclass(frozen=True)
class ScorerConfig(FitConfig):
    """Train `learned-scorer` on the 20 calibration streets, or in worlds that differ.

    It writes a file of weights; needs the extra `rl`.
    """

    steps: int = bounded(4000, 1, LARGEST_INTEGER)
    """Training batches."""
    drawn: bool = False
    """Learn from drives, tests of Euro NCAP and streets of training seeds, instead of the
    calibration streets. Budgets and camera faults are drawn for every play. With --source, draw
    them for its scenes.
    """


@dataclass(frozen=True)
class SetsConfig(FitConfig):
    """Train `learned-sets` on drives, Euro NCAP tests and streets of training seeds.

    It writes a file of weights, also at the end of the first round; needs the extra `rl`.
    """

    steps: int = bounded(3000, 1, LARGEST_INTEGER)
    """Training batches per round."""
    without: tuple[Part, ...] = ()
    """Parts to leave out, to measure their worth: attention between items; all inputs but the kind;
    the map of places; faults of the camera.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        for part in self.without:
            check_known("part to be without", part, get_args(Part))


@dataclass(frozen=True)
class DetectorConfig(FitConfig):
    """Train the detector `pillars` on generated streets and drives.

    It writes a file of weights; needs the extra `rl`.
    """

    steps: int = bounded(10_000, 1, 1_000_000)
    """Training batches of four scans."""
    clutter: bool = False
    """Learn only from cluttered streets, seen by several set-ups, instead of clean streets and
    drives.
    """
    start: Path | None = None
    """File of weights to start from; by default they are drawn."""
