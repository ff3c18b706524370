"""Options of `care-sim train NAME`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import tyro

from care_sim.base.errors import InvalidInput
from care_sim.commands.options.shared import SourceOptions
from care_sim.training.config import AgentConfig, PpoConfig, RecurrentPpoConfig, SacConfig
from care_sim.training.supervised.options import DetectorConfig, ScorerConfig, SetsConfig


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """Options that decide the defaults of a learner."""

    env: tuple[str, ...] = AgentConfig.env
    drawn: bool = AgentConfig.drawn
    hyperparameters: Path | None = None


@dataclass(frozen=True, kw_only=True)
class Learner(AgentConfig):
    """Options of the commands that train learners, beside the configuration."""

    kind: ClassVar[type[AgentConfig]]

    hyperparameters: Path | None = None
    """TOML file of hyperparameters by environment, instead of the one that comes with the package.
    Options win over both."""


@dataclass(frozen=True, kw_only=True)
class TrainPpo(PpoConfig, Learner):
    """Train an allocator by proximal policy optimisation; its weights become the policy `ppo`."""

    kind = PpoConfig


@dataclass(frozen=True, kw_only=True)
class TrainSac(SacConfig, Learner):
    """Train an allocator by soft actor-critic."""

    kind = SacConfig


@dataclass(frozen=True, kw_only=True)
class TrainRecurrentPpo(RecurrentPpoConfig, Learner):
    """Train an allocator with a memory (an LSTM) by proximal policy optimisation."""

    kind = RecurrentPpoConfig


@dataclass(frozen=True, kw_only=True)
class LessonOptions(SourceOptions):
    """Scenes of a source to learn from, instead of generated worlds."""

    source: str | None = None
    """Learn from the scenes of nuscenes:FOLDER, argoverse2:FOLDER, kitti:FOLDER, sweeps:FOLDER,
    streets, or a source of your own, instead of from generated worlds."""
    scenes: tuple[str, ...] = ()
    """With --source. One number: that many scenes, from the first. Otherwise names of scenes.
    Without this option, all scenes of the split."""
    validation_split: str | None = None
    """With --source: the split that is held out and says what was reached. Without this option,
    whole logs of --split are held out, one scene in five."""

    def check_source(self) -> None:
        """Raise InvalidInput for an option of sources where none is named."""
        given = self.source_options()
        given += [name for name in ("scenes", "validation_split") if getattr(self, name)]
        if self.source is None and given:
            option = given[0].replace("_", "-")
            raise InvalidInput(f"--{option} has no meaning without --source")


@dataclass(frozen=True, kw_only=True)
class TrainScorer(ScorerConfig, LessonOptions):
    """Train `learned-scorer` on the 20 calibration streets, in worlds that differ, or on scenes.

    It writes a file of weights; needs the extra `rl`.
    """


@dataclass(frozen=True, kw_only=True)
class TrainSets(SetsConfig, LessonOptions):
    """Train `learned-sets` on drives, Euro NCAP tests and streets of training seeds, or on scenes.

    It writes a file of weights, also at the end of the first round; needs the extra `rl`.
    """


@dataclass(frozen=True, kw_only=True)
class TrainDetector(DetectorConfig, LessonOptions):
    """Train the detector `pillars` on generated streets and drives, or on scenes of a source.

    It writes a file of weights; needs the extra `rl`.
    """


@dataclass(frozen=True)
class Curves:
    """Draw the learning curves of training runs.

    One panel per task and one line per training seed; PNG and SVG.
    """

    folders: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER...")]
    """The --out of training runs."""
    out: Path = Path("runs/curves.png")
    """File to draw; one of the same name with .svg is beside it."""
