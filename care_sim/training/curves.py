"""Learning curves of training runs, read from their folders: runs that differ by their seed alone lie together."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from care_sim.base.errors import InvalidInput
from care_sim.training.config import HOW_LONG
from care_sim.training.folder import CONFIG, CURVE, RULES, Evaluation, read_config, read_curve, read_rules


@dataclass(frozen=True)
class Run:
    """A run: its configuration, what rules score on its validation seeds, and its evaluations."""

    config: Mapping[str, Any]
    rules: Mapping[str, Mapping[str, float]]
    curve: Sequence[Evaluation]

    @property
    def task(self) -> str:
        """What runs that lie together share."""
        return json.dumps({name: self.config[name] for name in self.config if name not in ("seed", *HOW_LONG)})

    @property
    def closed_loop(self) -> bool:
        """Whether a first detection has a distance; the return alone is measured otherwise."""
        return all(distance is not None for *_, distance in self.curve)

    @property
    def marks(self) -> dict[str, float]:
        """What the rules reach, measured as `values`."""
        scores = self.rules.items()
        return {name: s["mean_return"] if s["distance_m"] is None else s["distance_m"] for name, s in scores}

    @property
    def steps(self) -> list[int]:
        """Of the evaluations."""
        return [steps for steps, *_ in self.curve]

    @property
    def values(self) -> list[float]:
        """What is drawn of the evaluations: metres of the first detection, or the return."""
        return [value if distance is None else distance for _, _, value, distance in self.curve]


@dataclass(frozen=True)
class Curves:
    """Draw the learning curves of training runs, a panel a task, a line a training seed; PNG and SVG."""

    folders: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FOLDERS")]
    """The --out of training runs."""
    out: Path = Path("runs/curves.png")
    """File to draw; one of the same name with .svg lies beside it."""

    def __call__(self) -> int:
        """Draw them."""
        if not self.folders:
            raise InvalidInput("curves needs the folder of a training run, the --out of `care-sim train`")
        groups = together(map(read, self.folders))
        from care_sim.reports.figures.files import check_figure, save
        from care_sim.training.curves_figure import curves_figure

        check_figure(self.out)
        save(curves_figure(groups), self.out)
        print(self.out.with_suffix(".png"))
        return 0


def read(folder: Path) -> Run:
    """The run in a folder. Raises InvalidInput for one without an evaluation."""
    for name in (CONFIG, RULES, CURVE):
        if not (folder / name).is_file():
            raise InvalidInput(f"{folder} holds no evaluated training run: no {name}")
    run = Run(read_config(folder / CONFIG), read_rules(folder / RULES), read_curve(folder / CURVE))
    if not run.curve:
        raise InvalidInput(f"{folder} holds no evaluated training run: {CURVE} has no evaluation")
    return run


def together(runs: Iterable[Run]) -> list[list[Run]]:
    """The runs of every task, in the order of the first."""
    groups: dict[str, list[Run]] = {}
    for run in runs:
        groups.setdefault(run.task, []).append(run)
    return list(groups.values())
