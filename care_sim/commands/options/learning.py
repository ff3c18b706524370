"""Options of `care-sim train NAME`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import tyro

from care_sim.training.config import AgentConfig, PpoConfig, RecurrentPpoConfig, SacConfig


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """What decides the defaults of a learner."""

    env: tuple[str, ...] = AgentConfig.env
    drawn: bool = AgentConfig.drawn
    hyperparameters: Path | None = None


@dataclass(frozen=True, kw_only=True)
class Learner(AgentConfig):
    """What the commands of learners take beside the configuration."""

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


@dataclass(frozen=True)
class Curves:
    """Draw the learning curves of training runs.

    One panel per task and one line per training seed; PNG and SVG.
    """

    folders: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER...")]
    """The --out of training runs."""
    out: Path = Path("runs/curves.png")
    """File to draw; one of the same name with .svg is beside it."""
