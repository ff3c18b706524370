"""What a training run keeps in its folder.

| file | content |
|---|---|
| `config.json` | the effective configuration, and the hash of the code of a scenario of one's own |
| `rules.json` | what rules score on the same validation seeds |
| `curve.csv` | steps, seconds, return and detection distance of every evaluation |
| `episodes.csv` | the same of every episode of it, and of the rules' |
| `checkpoint.zip` | the learner, by Stable-Baselines3; loading it executes code: load your own |
| `weights.npz` | `ppo` only: the weights with the best return on the validation seeds |

The first evaluation comes before the first step. Loading `weights.npz` executes nothing.

Every file is written beside and then put in its place: an interruption leaves the one before. The
experience that SAC learns from is not kept (half a gigabyte): a resumed run gathers its own.
"""

import csv
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from care_sim.base.checks import LARGEST_INTEGER, check_known, is_number
from care_sim.base.errors import InvalidInput
from care_sim.base.files import replacing, write_text
from care_sim.base.json_text import json_content
from care_sim.base.plugins import is_place
from care_sim.base.scenario_names import scenario_of
from care_sim.base.seed_ranges import TRAINING
from care_sim.core.rig import Rig
from care_sim.policies.learned.weights import Card, save_weights
from care_sim.scenarios import PLUGINS
from care_sim.study.provenance import machine_line, package_versions, scenario_digest
from care_sim.training.config import ALGORITHMS, AgentConfig
from care_sim.training.seeds import validation_seeds
from care_sim.training.validation import (
    LEARNER,
    EpisodeRow,
    Played,
    ValidationScore,
    read_episodes,
    read_table,
    write_episodes,
)

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm

CONFIG, RULES, CURVE = "config.json", "rules.json", "curve.csv"
CHECKPOINT, WEIGHTS = "checkpoint.zip", "weights.npz"
CURVE_COLUMNS = ("steps", "seconds", "return", "distance_m")
_CODE = "scenario_code"
"""Of the configuration of a run on a scenario of one's own: the hash of its code."""
_LARGEST_DRAWN = 1e30
"""The largest return or distance that a figure can draw."""
Evaluation = tuple[int, float, float, float | None]
"""Of `CURVE_COLUMNS`: environment steps, seconds of learning, mean return, metres (none in the open
loop).
"""


class Folder:
    """The folder of a configuration.

    Raises InvalidInput when it holds another run, none to be resumed, or a damaged file.
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
        self._curve = read_curve(self.path / CURVE) if config.resume else []
        self._episodes = read_episodes(self.path) if config.resume else []
        # A trial begins with the rules that were scored before.
        if not config.resume and (self.path / RULES).exists():
            rows = read_episodes(self.path)
            self._episodes = [row for row in rows if row.policy != LEARNER]

    def begin(self, model: "BaseAlgorithm") -> None:
        """Write the configuration down, and the learner as it is.

        From here on the run can be resumed.
        """
        self.path.mkdir(parents=True, exist_ok=True)
        # The checkpoint first: a folder with a configuration alone could not be resumed.
        self.save(model)
        content = json.loads(self.config.to_json()) | _own_code(self.config.env)
        write_text(self.path / CONFIG, json.dumps(content, indent=1) + "\n")

    def rules(self, play: Callable[[], dict[str, list[Played]]]) -> dict[str, ValidationScore]:
        """What rules score: measured at the beginning of a run, read when it is resumed."""
        path = self.path / RULES
        if not path.exists():
            played = play()
            self._episodes = [
                EpisodeRow(name, 0, one) for name, each in played.items() for one in each
            ]
            # The table first: where the scores are, its rows are, too.
            write_episodes(self.path, self._episodes)
            scores = {name: asdict(ValidationScore.of(each)) for name, each in played.items()}
            write_text(path, json.dumps(scores, indent=1) + "\n")
        return {name: ValidationScore(**plain) for name, plain in read_rules(path).items()}

    @property
    def seconds(self) -> float:
        """How long the run has learned by the last evaluation."""
        return self._curve[-1][1] if self._curve else 0.0

    def evaluated(self, model: "BaseAlgorithm") -> bool:
        """Whether the learner has been evaluated as it is."""
        return bool(self._curve) and self._curve[-1][0] >= model.num_timesteps

    def keep(
        self, model: "BaseAlgorithm", played: Sequence[Played], seconds: float, rig: Rig
    ) -> ValidationScore:
        """Write an evaluation and, when it is the best yet, the weights. Returns its score."""
        score = ValidationScore.of(played)
        # The weights first: when the curve knows an evaluation, its weights are there.
        if score.mean_return > max((row[2] for row in self._curve), default=float("-inf")):
            self._export(model, score, seconds, rig)
        steps = model.num_timesteps
        # An interruption before the curve was written left rows of this evaluation.
        before = [row for row in self._episodes if (row.policy, row.steps) != (LEARNER, steps)]
        self._episodes = [*before, *(EpisodeRow(LEARNER, steps, one) for one in played)]
        write_episodes(self.path, self._episodes)
        self._curve.append(
            (model.num_timesteps, round(seconds, 1), score.mean_return, score.distance_m)
        )
        with replacing(self.path / CURVE) as unfinished, unfinished.open("w", newline="") as file:
            csv.writer(file).writerows([CURVE_COLUMNS, *self._curve])
        return score

    def save(self, model: "BaseAlgorithm") -> None:
        """Write a checkpoint."""
        with replacing(self.checkpoint) as unfinished:
            model.save(unfinished)

    def _export(
        self, model: "BaseAlgorithm", score: ValidationScore, seconds: float, rig: Rig
    ) -> None:
        # The module subclasses PyTorch's and Stable-Baselines3's classes: optional extra 'rl'.
        from care_sim.training.networks import SectorPolicy

        # Only this network has a twin in NumPy; the others act from their checkpoint.
        if isinstance(model.policy, SectorPolicy):
            save_weights(
                self.weights, model.policy.arrays(), self._card(model, score, seconds, rig)
            )

    def _card(
        self, model: "BaseAlgorithm", score: ValidationScore, seconds: float, rig: Rig
    ) -> Card:
        config = self.config
        held_out = validation_seeds(score.episodes)
        return Card(
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

    def _check_resumable(self) -> None:
        for file in (self.path / CONFIG, self.checkpoint):
            if not file.exists():
                raise InvalidInput(f"{self.path} holds no run to be resumed: no {file.name}")
        before = read_config(self.path / CONFIG)
        self.config.check_same(before)
        # A folder of before tells nothing of the code.
        if (_CODE in before) and before[_CODE] != _own_code(self.config.env).get(_CODE):
            raise InvalidInput(
                f"{self.path}: the code of {' '.join(self.config.env)} is another than when it was "
                "trained; give another --out"
            )


def _own_code(envs: Sequence[str]) -> dict[str, Any]:
    """The hash of the code of a scenario of one's own, None where it cannot be read; of several
    environments by name. Nothing where none is one's own.
    """
    names = {env: scenario_of(env) for env in envs}
    own = {
        env: scenario_digest(name)
        for env, name in names.items()
        if is_place(name) or name in PLUGINS.entries()
    }
    if not own:
        return {}
    return {_CODE: own if len(envs) > 1 else own[envs[0]]}


def read_config(path: Path) -> dict[str, Any]:
    """The configuration of a run.

    Raises InvalidInput for a damaged file, or one of something else.
    """
    config = _read_map(path)
    kinds: dict[str, Callable[[Any], bool]] = {
        "algorithm": _is_text,
        "env": lambda env: (
            _is_text(env) or (isinstance(env, list) and bool(env) and all(map(_is_text, env)))
        ),
        "budget": lambda budgets: (
            isinstance(budgets, list) and bool(budgets) and all(map(_is_finite, budgets))
        ),
        "episodes": _is_finite,
    }
    for name, is_kind in kinds.items():
        if not is_kind(config.get(name)):
            raise InvalidInput(
                f"{path} is no configuration of a training run: {name} is {config.get(name)!r:.80}"
            )
    check_known(f"algorithm in {path}", config["algorithm"], ALGORITHMS)
    return config


def read_rules(path: Path) -> dict[str, dict[str, Any]]:
    """What rules score. Raises InvalidInput for a damaged file, or one of something else."""
    rules = _read_map(path)
    for name, score in rules.items():
        if not isinstance(score, dict) or {*score} != {*ValidationScore.__dataclass_fields__}:
            raise InvalidInput(
                f"{path} holds no scores of rules: {name!r:.80} has not "
                f"{', '.join(ValidationScore.__dataclass_fields__)}"
            )
        for column, value in score.items():
            if not (_is_finite(value) or (column == "distance_m" and value is None)):
                raise InvalidInput(
                    f"{path} holds no scores of rules: {column} of {name!r:.80} is {value!r:.80}"
                )
    return rules


def _read_map(path: Path) -> dict[str, Any]:
    try:
        content = json_content(path)
    except ValueError as error:
        raise InvalidInput(f"{path} is damaged: {error}") from error
    if not isinstance(content, dict):
        raise InvalidInput(f"{path} is no file of a training run: it holds no map")
    return content


def read_curve(path: Path) -> list[Evaluation]:
    """The evaluations of a run, none yet included. Raises InvalidInput for a damaged file."""
    return read_table(path, CURVE_COLUMNS, _evaluation)


def _evaluation(row: list[str]) -> Evaluation:
    """A row of the curve. Raises ValueError for what is no number that can be drawn."""
    steps, seconds, value, distance = row
    numbers = (float(seconds), float(value), *([float(distance)] if distance else []))
    if not (0 <= int(steps) <= LARGEST_INTEGER and all(map(_is_finite, numbers))):
        raise ValueError(f"{', '.join(row)} are no numbers of an evaluation")
    return int(steps), float(seconds), float(value), float(distance) if distance else None


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _is_finite(value: object) -> bool:
    return is_number(value) and abs(value) <= _LARGEST_DRAWN  # type: ignore[arg-type]
