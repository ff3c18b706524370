"""`care-sim train`: the learners, each a command of its own, and the figure of learning curves."""

import shlex
from argparse import ArgumentError, ArgumentParser, BooleanOptionalAction
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, ClassVar

import tyro

from care_sim.base.bounds import bounded
from care_sim.base.errors import InvalidInput, print_lines
from care_sim.base.files import told_if_replaced
from care_sim.commands.shared.end_of_training import end_of_training
from care_sim.commands.shared.study_command import console
from care_sim.reports.figures.files import check_figure, save
from care_sim.training.config import AgentConfig, PpoConfig, RecurrentPpoConfig, SacConfig
from care_sim.training.curves import grouped_runs, read_run
from care_sim.training.curves_figure import curves_figure
from care_sim.training.curves_table import curves_table
from care_sim.training.detector import TrainDetector
from care_sim.training.hyperparameters import read_hyperparameters
from care_sim.training.place_map import TrainPlace
from care_sim.training.run import train_agent
from care_sim.training.scorer import TrainScorer
from care_sim.training.sets import TrainSets
from care_sim.training.tuning import tune


@dataclass(frozen=True, kw_only=True)
class Learner(AgentConfig):
    """What the commands of learners take beside the configuration."""

    kind: ClassVar[type[AgentConfig]]

    hyperparameters: Path | None = None
    """TOML file of hyperparameters by environment, in the place of the one that comes with the
    package. Options win over both."""
    tune: int = bounded(0, 0, 10_000)
    """Try so many sets of hyperparameters instead, each in a training run of --steps (extra
    'tune'), and write the best as a file for --hyperparameters."""

    @classmethod
    def own_defaults(cls, arguments: Sequence[str]) -> Mapping[str, Any]:
        """Those of the environment that the arguments name."""
        asked = ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
        asked.add_argument("--env", nargs="+", default=cls.env)
        asked.add_argument("--drawn", action=BooleanOptionalAction, default=cls.drawn)
        asked.add_argument("--hyperparameters", type=Path)
        try:
            told, _ = asked.parse_known_args([*arguments])
        except ArgumentError:
            # An option without its value, which is told where all of them are read.
            return {}
        # A file that is not there is told when the command runs, as that of any other option.
        if told.hyperparameters is not None and not told.hyperparameters.exists():
            return {}
        return read_hyperparameters(cls.kind, told.env, told.hyperparameters, told.drawn).values

    def __call__(self) -> int:
        """Train it."""
        table = read_hyperparameters(self.kind, self.env, self.hyperparameters, self.drawn)
        config = self.kind(**{one.name: getattr(self, one.name) for one in fields(self.kind)})
        print_lines(*table.told(config))
        if self.tune:
            best = tune(config, self.tune, train_agent)
            print(best.read_text(encoding="utf-8"), end="")
            line = ["care-sim", "train", config.algorithm, "--env", *config.env]
            line += ["--drawn"] if config.drawn else []
            line += ["--without", *config.without] if config.without else []
            print_lines(f"train with them: {shlex.join([*line, '--hyperparameters', str(best)])}")
            return 0
        train_agent(config)
        print_lines(*end_of_training(config))
        return 0


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
        table = curves_table(groups)
        told = told_if_replaced(self.out.with_suffix(".png"))
        save(curves_figure(groups), self.out)
        console().print(table.rich())
        print_lines(f"Figure: {told}")
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
