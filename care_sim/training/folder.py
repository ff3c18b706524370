"""What a training run keeps in its folder.

| file | content |
|---|---|
| `config.json` | the effective configuration |
| `rules.json` | what rules score on the same validation seeds |
| `curve.csv` | steps, seconds, return and detection distance at every evaluation |
| `checkpoint.zip` | all that a run needs to go on, by Stable-Baselines3; loading it executes code: load your own |
| `weights.npz` | the weights with the best return on the validation seeds; loading it executes nothing (`ppo` only) |
"""

import csv
import json
import os
from collections.abc import Callable
from dataclasses import asdict
from typing import TYPE_CHECKING

from care_sim.errors import InvalidInput
from care_sim.policies.weights import Card, machine, save, versions
from care_sim.training.config import AgentConfig
from care_sim.training.evaluation import Score
from care_sim.training.seeds import TRAINING, validation_seeds
from care_sim.types import Rig

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm

CONFIG, RULES, CURVE = "config.json", "rules.json", "curve.csv"
COLUMNS = ("steps", "seconds", "return", "distance_m")


class Folder:
    """The folder of a configuration. Raises InvalidInput when it holds another run, or none to be resumed."""

    def __init__(self, config: AgentConfig):
        self.config, self.path = config, config.out
        self.checkpoint, self.weights = self.path / "checkpoint.zip", self.path / "weights.npz"
        self._settings, self._curve = self.path / CONFIG, self.path / CURVE
        if config.resume:
            self._check_resumable()
        elif self._settings.exists():
            raise InvalidInput(f"{self.path} holds a run already; add --resume, or give another --out")

    def begin(self) -> None:
        """Write the configuration down."""
        self.path.mkdir(parents=True, exist_ok=True)
        self._settings.write_text(self.config.to_json())

    def rules(self, score: Callable[[], dict[str, Score]]) -> dict[str, Score]:
        """What rules score: measured at the beginning of a run, read when it is resumed."""
        path = self.path / RULES
        if not path.exists():
            path.write_text(json.dumps({name: asdict(each) for name, each in score().items()}, indent=1) + "\n")
        return {name: Score(**plain) for name, plain in json.loads(path.read_text()).items()}

    @property
    def seconds(self) -> float:
        """How long the run has taken by the last evaluation."""
        return self._rows()[-1][1] if self._rows() else 0.0

    @property
    def best_return(self) -> float:
        """The best return at an evaluation so far."""
        return max((row[2] for row in self._rows()), default=float("-inf"))

    def keep(self, model: "BaseAlgorithm", score: Score, seconds: float, rig: Rig) -> None:
        """Write an evaluation, a checkpoint and, when it is the best yet, the weights."""
        if score.mean_return > self.best_return:
            self._export(model, score, seconds, rig)
        new = not self._curve.exists()
        with self._curve.open("a", newline="") as file:
            lines = csv.writer(file)
            lines.writerows([COLUMNS] if new else [])
            lines.writerow([model.num_timesteps, round(seconds, 1), score.mean_return, score.distance_m])
        self.save(model)

    def save(self, model: "BaseAlgorithm") -> None:
        """Write a checkpoint; an interruption leaves the one before."""
        beside = self.path / "checkpoint.new.zip"
        model.save(beside)
        os.replace(beside, self.checkpoint)

    def _export(self, model: "BaseAlgorithm", score: Score, seconds: float, rig: Rig) -> None:
        from care_sim.training.networks import SectorPolicy

        if isinstance(model.policy, SectorPolicy):
            save(self.weights, model.policy.arrays(), self._card(model, score, seconds, rig))

    def _card(self, model: "BaseAlgorithm", score: Score, seconds: float, rig: Rig) -> Card:
        config, held_out = self.config, validation_seeds(score.episodes)
        return Card(
            kind="ppo",
            grid=asdict(rig.grid),
            budget=rig.budget if len(config.budget) == 1 else None,
            wrapper=str(config.wrapping),
            scenario=config.env,
            data="episodes of the environment",
            seeds={"learner": config.seed, "training_from": TRAINING, "validation": [held_out[0], held_out[-1]]},
            steps=model.num_timesteps,
            machine=f"{machine()}, {round(seconds)} s",
            versions=versions("care-sim", "numpy", "stable-baselines3", "torch"),
            result={"validation": asdict(score), "config": json.loads(config.to_json())},
        )

    def _check_resumable(self) -> None:
        for file in (self._settings, self.checkpoint):
            if not file.exists():
                raise InvalidInput(f"{self.path} holds no run to be resumed: no {file.name}")
        self.config.check_same(self._settings.read_text())

    def _rows(self) -> list[list[float]]:
        if not self._curve.exists():
            return []
        with self._curve.open(newline="") as file:
            return [[float(value or "nan") for value in row] for row in list(csv.reader(file))[1:]]
