"""Options of the trainings on truth. Help loads them, and no simulator."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from care_sim.base.checks import LARGEST_INTEGER, bounded, check_fields, check_known

Part = Literal["attention", "inputs", "place", "faults"]
"""What `learned-sets` can be trained without."""


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
    """Batches that are learned from."""
    drawn: bool = False
    """Learn from drives, tests of Euro NCAP and streets of training seeds, with budgets and faults
    of the camera drawn for every play, instead of from the calibration streets. With --source, draw
    budgets and faults for its scenes."""


@dataclass(frozen=True)
class SetsConfig(FitConfig):
    """Train `learned-sets` on drives, Euro NCAP tests and streets of training seeds.

    It writes a file of weights, also at the end of the first round; needs the extra `rl`.
    """

    steps: int = bounded(3000, 1, LARGEST_INTEGER)
    """Batches that are learned from in each round."""
    without: tuple[Part, ...] = ()
    """What to leave out, to see what it is worth: what an item is told of the others; all that is
    told of it but its kind; the map of places; faults of the camera."""

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
    """Batches of four scans that are learned from."""
    clutter: bool = False
    """Learn from cluttered streets alone, seen by several set-ups, and not from clean streets and
    drives."""
    start: Path | None = None
    """File of weights to learn on from; without it the first ones are drawn."""
