"""Learning curves of training runs, read from their folders: runs that differ by their seed alone lie together."""
import csv
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from care_sim.errors import InvalidInput
from care_sim.training.config import HOW_LONG
from care_sim.training.folder import CONFIG, CURVE, RULES


@dataclass(frozen=True)
class Run:
    """A run: its configuration, what rules score on its validation seeds, and an evaluation a row. `measure` is the
    column that is drawn: the distance of the first detection, or the return where there is none.
    """

    config: Mapping[str, Any]
    rules: Mapping[str, Mapping[str, float]]
    steps: Sequence[int]
    values: Sequence[float]
    measure: str

    @property
    def task(self) -> str:
        """What runs that lie together share."""
        return json.dumps({name: self.config[name] for name in self.config if name not in ("seed", *HOW_LONG)})


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
        from care_sim.study.figures import save
        from care_sim.training.curves_figure import curves_figure

        self.out.parent.mkdir(parents=True, exist_ok=True)
        save(curves_figure(groups), self.out)
        print(self.out.with_suffix(".png"))
        return 0


def read(folder: Path) -> Run:
    """The run in a folder. Raises InvalidInput for one without an evaluation."""
    for name in (CONFIG, RULES, CURVE):
        if not (folder / name).is_file():
            raise InvalidInput(f"{folder} holds no evaluated training run: no {name}")
    with (folder / CURVE).open(newline="") as file:
        rows = list(csv.DictReader(file))
    measure = "distance_m" if all(row["distance_m"] for row in rows) else "return"
    config, rules = (json.loads((folder / name).read_text()) for name in (CONFIG, RULES))
    return Run(config, rules, [int(row["steps"]) for row in rows], [float(row[measure]) for row in rows], measure)


def together(runs: Iterable[Run]) -> list[list[Run]]:
    """The runs of every task, in the order of the first."""
    groups: dict[str, list[Run]] = {}
    for run in runs:
        groups.setdefault(run.task, []).append(run)
    return list(groups.values())
