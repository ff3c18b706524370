"""`care-sim train`: the learners, each a command of its own, and the figure of learning curves."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from care_sim.base.errors import InvalidInput
from care_sim.reports.figures.files import check_figure, save
from care_sim.training.config import PpoConfig, RecurrentPpoConfig, SacConfig
from care_sim.training.curves import grouped_runs, read_run
from care_sim.training.curves_figure import curves_figure
from care_sim.training.detector import TrainDetector
from care_sim.training.place_map import TrainPlace
from care_sim.training.run import train_agent
from care_sim.training.scorer import TrainScorer
from care_sim.training.sets import TrainSets


@dataclass(frozen=True, kw_only=True)
class TrainPpo(PpoConfig):
    """Train an allocator by proximal policy optimisation; its weights become the policy `ppo`."""

    def __call__(self) -> int:
        """Train it."""
        return train_agent(self)


@dataclass(frozen=True, kw_only=True)
class TrainSac(SacConfig):
    """Train an allocator by soft actor-critic."""

    def __call__(self) -> int:
        """Train it."""
        return train_agent(self)


@dataclass(frozen=True, kw_only=True)
class TrainRecurrentPpo(RecurrentPpoConfig):
    """Train an allocator with a memory (an LSTM) by proximal policy optimisation."""

    def __call__(self) -> int:
        """Train it."""
        return train_agent(self)


@dataclass(frozen=True)
class DrawCurves:
    """Draw the learning curves of training runs, one panel per task and one line per training seed;
    PNG and SVG.
    """

    folders: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FOLDERS")]
    """The --out of training runs."""
    out: Path = Path("runs/curves.png")
    """File to draw; one of the same name with .svg lies beside it."""

    def __call__(self) -> int:
        """Draw them."""
        if not self.folders:
            raise InvalidInput(
                "curves needs the folder of a training run, the --out of `care-sim train`"
            )
        groups = grouped_runs(map(read_run, self.folders))
        check_figure(self.out)
        save(curves_figure(groups), self.out)
        print(self.out.with_suffix(".png"))
        return 0


LEARNERS: dict[str, Callable[..., Any]] = {
    "ppo": TrainPpo,
    "sac": TrainSac,
    "recurrent-ppo": TrainRecurrentPpo,
    "learned-scorer": TrainScorer,
    "learned-sets": TrainSets,
    "place": TrainPlace,
    "detector": TrainDetector,
    "curves": DrawCurves,
}
"""Commands of `care-sim train`, by name."""
