"""Files of a training run in its folder.

| file | content |
|---|---|
| `config.json` | the effective configuration |
| `curve.csv` | steps, seconds, return and detection distance of every evaluation |
| `episodes.csv` | the same of every episode of it, and of the rules that the learner is beside |
| `checkpoint.zip` | the learner, by Stable-Baselines3; loading it executes code: load your own |
| `weights.npz` | `ppo` only: the weights with the best return on the validation seeds |

The first evaluation comes before the first step. Loading `weights.npz` executes nothing.

Every file is written beside and then put in its place: an interruption leaves the one before. The
experience that SAC learns from is not kept (half a gigabyte): a resumed run gathers its own.
"""

import csv
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from care_sim.base.checks import LARGEST_INTEGER, is_number
from care_sim.base.errors import InvalidInput
from care_sim.base.files import check_file_size, json_content, replacing, write_text
from care_sim.base.seeds import TRAINING
from care_sim.core.rig import Rig
from care_sim.policies.learned.weights import Card, save_weights
from care_sim.study.provenance import machine_line, package_versions
from care_sim.training.config import ALGORITHMS, AgentConfig
from care_sim.training.seeds import validation_seeds
from care_sim.training.validation import Row, ValidationScore

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm

CONFIG, CURVE, EPISODES = "config.json", "curve.csv", "episodes.csv"
CHECKPOINT, WEIGHTS = "checkpoint.zip", "weights.npz"
LEARNER = "learner"
"""Name of the learner among the policies of `episodes.csv`; the others are rules."""
_LARGEST_DRAWN = 1e30
"""The largest return or distance that a figure can draw."""


class Folder:
    """The folder of a configuration. Raises InvalidInput if it holds another run, no run to resume,
    or a damaged file.
    """

    def __init__(self, config: AgentConfig):
        self.config = config
        self.path = config.out
        self.checkpoint = self.path / CHECKPOINT
        self.weights = self.path / WEIGHTS
        if config.resume:
            self._check_resumable()
        elif (self.path / CONFIG).exists():
            raise InvalidInput(
                f"{self.path} holds a run already; add --resume, or give another --out"
            )
        self._curve = read_table(self.path / CURVE) if config.resume else []
        self._episodes = read_table(self.path / EPISODES) if config.resume else []

    def begin(self, model: "BaseAlgorithm") -> None:
        """Write the configuration and the learner. From here on the run can be resumed."""
        self.path.mkdir(parents=True, exist_ok=True)
        # The checkpoint first: a folder with a configuration alone could not be resumed.
        self.save(model)
        write_text(self.path / CONFIG, self.config.to_json())

    def rules(self, play: Callable[[], dict[str, list[Row]]]) -> dict[str, ValidationScore]:
        """Return the scores of rules: measured at the beginning of a run, read when it is
        resumed.
        """
        if not self._episodes:
            for name, played in play().items():
                self._add(name, 0, played)
            _write_table(self.path / EPISODES, self._episodes)
        return rule_scores(self._episodes)

    @property
    def seconds(self) -> float:
        """Return the seconds of learning until the last evaluation."""
        return float(self._curve[-1]["seconds"]) if self._curve else 0.0

    def evaluated(self, model: "BaseAlgorithm") -> bool:
        """Return True if the current learner has been evaluated."""
        return bool(self._curve) and self._curve[-1]["steps"] >= model.num_timesteps

    def keep(
        self, model: "BaseAlgorithm", played: Sequence[Row], seconds: float, rig: Rig
    ) -> ValidationScore:
        """Write an evaluation and, if it is the best so far, the weights. Returns its score."""
        score = ValidationScore.of(played)
        # The weights first: if the curve holds an evaluation, its weights exist.
        if score.mean_return > max((row["return"] for row in self._curve), default=float("-inf")):
            self._export(model, score, seconds, rig)
        steps = model.num_timesteps
        # An interruption before the curve was written left rows of this evaluation.
        self._episodes = [
            row for row in self._episodes if (row["policy"], row["steps"]) != (LEARNER, steps)
        ]
        self._add(LEARNER, steps, played)
        _write_table(self.path / EPISODES, self._episodes)
        self._curve.append(
            {
                "steps": steps,
                "seconds": round(seconds, 1),
                "return": score.mean_return,
                "distance_m": score.distance_m,
            }
        )
        _write_table(self.path / CURVE, self._curve)
        return score

    def save(self, model: "BaseAlgorithm") -> None:
        """Write a checkpoint."""
        with replacing(self.checkpoint) as unfinished:
            model.save(unfinished)

    def _add(self, policy: str, steps: int, played: Sequence[Row]) -> None:
        self._episodes += [{"policy": policy, "steps": steps, **row} for row in played]

    def _export(
        self, model: "BaseAlgorithm", score: ValidationScore, seconds: float, rig: Rig
    ) -> None:
        # The module subclasses PyTorch's and Stable-Baselines3's classes: optional extra 'rl'.
        from care_sim.training.networks import SectorPolicy

        # Only this network has a NumPy version; the others act from their checkpoint.
        if not isinstance(model.policy, SectorPolicy):
            return
        config = self.config
        held_out = validation_seeds(score.episodes)
        card = Card(
            kind="ppo",
            grid=rig.grid,
            setup=rig.setup,
            # Trained at several budgets, the weights fit any.
            budget=rig.budget if len({*config.budget}) == 1 else None,
            wrapper=config.wrapping,
            scenario=" ".join(config.env),
            data="drawn episodes of the environments"
            if config.drawn
            else "episodes of the environment",
            seeds={
                "learner": config.seed,
                "training_from": TRAINING,
                "validation": [held_out[0], held_out[-1]],
            },
            steps=model.num_timesteps,
            machine=f"{machine_line()}, {round(seconds)} s",
            versions=package_versions("care-sim", "numpy", "stable-baselines3", "torch"),
            result={"validation": asdict(score), "config": config.recipe},
        )
        save_weights(self.weights, model.policy.arrays(), card)

    def _check_resumable(self) -> None:
        for file in (self.path / CONFIG, self.checkpoint):
            if not file.exists():
                raise InvalidInput(f"{self.path} holds no run to be resumed: no {file.name}")
        self.config.check_same(read_config(self.path / CONFIG))


def rule_scores(episodes: Sequence[Row]) -> dict[str, ValidationScore]:
    """Return the score of every rule, by name."""
    played: dict[str, list[Row]] = {}
    for row in episodes:
        if row["policy"] != LEARNER:
            played.setdefault(row["policy"], []).append(row)
    return {name: ValidationScore.of(rows) for name, rows in played.items()}


def read_config(path: Path) -> dict[str, Any]:
    """Return the configuration of a run. Raises InvalidInput for a damaged file or another kind of
    file.
    """
    try:
        config = json_content(path)
    except ValueError as error:
        raise InvalidInput(f"{path} is damaged: {error}") from error
    if not isinstance(config, dict):
        raise InvalidInput(f"{path} is no configuration of a training run: it holds no map")
    env = config.get("env")
    listed = env if isinstance(env, list) else [env]
    right = {
        "algorithm": config.get("algorithm") in ALGORITHMS,
        "env": bool(listed) and all(isinstance(name, str) for name in listed),
        "budget": bool(config.get("budget"))
        and isinstance(config["budget"], list)
        and all(map(_is_finite, config["budget"])),
        "episodes": _is_finite(config.get("episodes")),
    }
    for name, is_right in right.items():
        if not is_right:
            raise InvalidInput(
                f"{path} is no configuration of a training run: {name} is {config.get(name)!r:.80}"
            )
    return config


def read_table(path: Path) -> list[Row]:
    """Return the rows of `CURVE` or `EPISODES`, none for a missing file. Raises InvalidInput for a
    damaged file.
    """
    columns = COLUMNS[path.name]
    if not path.exists():
        return []
    try:
        check_file_size(path)
        with path.open(newline="", encoding="utf-8") as file:
            head, *rows = csv.reader(file)
        if head != [*columns]:
            raise ValueError(f"its columns are not {', '.join(columns)}")
        return [
            {name: read(text) for (name, read), text in zip(columns.items(), row, strict=True)}
            for row in rows
        ]
    except (ValueError, csv.Error) as error:
        raise InvalidInput(f"{path} is damaged: {error}") from error


def _write_table(path: Path, rows: Sequence[Row]) -> None:
    with replacing(path) as unfinished, unfinished.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS[path.name])
        writer.writeheader()
        writer.writerows(rows)


def _count(text: str) -> int:
    number = int(text)
    if not 0 <= number <= LARGEST_INTEGER:
        raise ValueError(f"{text} is no count")
    return number


def _number(text: str) -> float:
    number = float(text)
    if not _is_finite(number):
        raise ValueError(f"{text} is no number that can be drawn")
    return number


def _metres(text: str) -> float | None:
    return _number(text) if text else None


def _is_finite(value: object) -> bool:
    return is_number(value) and abs(value) <= _LARGEST_DRAWN  # type: ignore[arg-type]


_SCORES: dict[str, Callable[[str], Any]] = {"return": _number, "distance_m": _metres}
COLUMNS: dict[str, dict[str, Callable[[str], Any]]] = {
    CURVE: {"steps": _count, "seconds": _number, **_SCORES},
    EPISODES: {"policy": str, "steps": _count, "seed": _count, "env": str, **_SCORES},
}
"""The columns of both tables, and the reader of each."""
