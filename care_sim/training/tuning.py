"""Hyperparameters chosen by Optuna: every trial is a training run in a folder of its own.

| in the folder | content |
|---|---|
| `study.journal` | Optuna's record of the trials, which `--resume` goes on from |
| `trials/NUMBER` | the run of a trial (`care_sim.training.folder`) |
| `best.toml` | the hyperparameters of the best trial yet, as `--hyperparameters` takes them |

A trial counts by the best return of its learning curve, as the weights that a run keeps. One whose
curve is below the median of the others at the same evaluation ends early. All have the same seed
and so meet the same episodes. The first one has the values that are given, so that the best is
never behind them on the validation seeds. These choose twice then, hyperparameters and weights: how
good the best is, only other seeds tell.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from care_sim.base.errors import InvalidInput, one_line, print_lines
from care_sim.base.extras import missing_extra
from care_sim.base.files import check_no_link, write_text
from care_sim.training.config import AgentConfig
from care_sim.training.environments import wrapped
from care_sim.training.episodes import LEARNER, read_episodes, write_episodes
from care_sim.training.folder import CONFIG, CURVE, RULES, read_curve
from care_sim.training.hyperparameters import as_table, names_of, table_of

STUDY, TRIALS, BEST = "study.journal", "trials", "best.toml"
SPACES: dict[str, Any] = {
    "learning_rate": (1e-4, 1e-2),
    "noise": (0.1, 1.0),
    "discount": [0.8, 0.9, 0.95, 0.99],
    "epochs": [1, 2, 4, 8],
    "batch": [64, 128, 256, 512],
}
"""What is tried, of the hyperparameters that a learner has: between two numbers on a logarithmic
scale, or one of a list.
"""
_STARTUP = 4
"""Trials that are never ended early, of which the first median is."""
_RECIPE = "recipe"

Evaluated = Callable[[float], None]
"""Is told the mean return of every evaluation."""
Train = Callable[[AgentConfig, Evaluated], object]
"""Trains a configuration. What `Evaluated` raises goes through it."""


class Pruned(Exception):
    """A trial ends early."""


def tune(config: AgentConfig, trials: int, train: Train) -> Path:
    """Try sets of hyperparameters until so many `trials` are done; returns the file of the best.

    Raises InvalidInput where the folder holds another study, or one that `config.resume` does not
    ask for, and where no trial could be completed; MissingExtra without Optuna.
    """
    optuna = _import_optuna()
    # What no trial could play is told before there is a study.
    wrapped(config).close()
    study = _opened(optuna, config)
    while len(_done(optuna, study)) < trials:
        trial = _begun(optuna, study) or study.ask()
        # With a sampler of its own every trial is the same, whether or not there was an
        # interruption before it.
        study.sampler = optuna.samplers.TPESampler(seed=config.seed + trial.number)
        values = {name: _suggested(trial, name) for name in spaces_of(config)}
        _say(f"trial {trial.number}: {_told(values)}")
        state, reached = _played(optuna, trial, replace(config, **values), train)
        study.tell(trial, reached, state=state)
        told = "" if reached is None else f", return {reached:.2f}"
        _say(f"trial {trial.number}: {state.name.lower()}{told}")
        _write_best(optuna, study, config)
    best = _write_best(optuna, study, config)
    if not best.exists():
        raise InvalidInput(f"{config.out}: none of the trials was completed, {trials} were begun")
    return best


def spaces_of(config: AgentConfig) -> Iterator[str]:
    """The hyperparameters of a learner that are tried."""
    return (name for name in SPACES if name in names_of(type(config)))


def _opened(optuna: Any, config: AgentConfig) -> Any:
    """The study in the folder; one of its first trial where there is none."""
    path = config.out / STUDY
    if path.exists() and not config.resume:
        raise InvalidInput(
            f"{config.out} holds a study already; add --resume, or give another --out"
        )
    if config.resume and not path.exists():
        raise InvalidInput(f"{config.out} holds no study to be resumed: no {STUDY}")
    config.out.mkdir(parents=True, exist_ok=True)
    check_no_link(path)
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    journal = optuna.storages.journal
    storage = journal.JournalStorage(journal.JournalFileBackend(str(path)))
    study = optuna.create_study(
        storage=storage,
        study_name=config.algorithm,
        direction="maximize",
        load_if_exists=True,
        pruner=optuna.pruners.MedianPruner(n_startup_trials=_STARTUP, n_warmup_steps=1),
    )
    recipe = _recipe(config)
    before = study.user_attrs.get(_RECIPE)
    if before is None:
        study.set_user_attr(_RECIPE, recipe)
        study.enqueue_trial({n: v for n, v in recipe.items() if n in SPACES and _is_in(v, n)})
    elif before != recipe:
        name = next(one for one in recipe if before.get(one) != recipe[one])
        raise InvalidInput(
            f"{config.out}: tuned with {name} {before.get(name)!r}, asked is {recipe[name]!r}"
        )
    return study


def _recipe(config: AgentConfig) -> dict[str, Any]:
    """What decides a study: the values that are not tried stay, the others begin it."""
    recipe: dict[str, Any] = json.loads(json.dumps(config.recipe | {"steps": config.steps}))
    return recipe


def _done(optuna: Any, study: Any) -> list[Any]:
    return [trial for trial in study.trials if trial.state.is_finished()]


def _begun(optuna: Any, study: Any) -> Any:
    """The trial that was interrupted; None where there is none."""
    running = study.get_trials(states=(optuna.trial.TrialState.RUNNING,))
    return optuna.trial.Trial(study, running[0]._trial_id) if running else None


def _suggested(trial: Any, name: str) -> Any:
    space = SPACES[name]
    if isinstance(space, list):
        return trial.suggest_categorical(name, space)
    return trial.suggest_float(name, *space, log=True)


def _is_in(value: Any, name: str) -> bool:
    space = SPACES[name]
    return value in space if isinstance(space, list) else space[0] <= value <= space[1]


def _played(optuna: Any, trial: Any, config: AgentConfig, train: Train) -> tuple[Any, Any]:
    """How a trial ends, and its best return where it is complete."""
    states = optuna.trial.TrialState
    folder = config.out / TRIALS / f"{trial.number:03d}"
    check_no_link(folder.parent)
    check_no_link(folder)
    _take_rules(config.out / TRIALS / "000", folder)
    try:
        if not _is_done(folder / CURVE, config):
            own = replace(config, out=folder, resume=(folder / CONFIG).exists())
            train(own, partial(_watched, trial, folder / CURVE))
    except Pruned:
        return states.PRUNED, None
    except InvalidInput:
        raise
    # Weights that have grown without bounds give actions that are no numbers.
    except ValueError as error:
        _say(f"trial {trial.number}: {one_line(str(error))}")
        return states.FAIL, None
    return states.COMPLETE, _best_of(folder / CURVE)[-1]


def _take_rules(first: Path, folder: Path) -> None:
    """Rules are scored once: all trials are evaluated on the same episodes."""
    if (first / RULES).exists() and not (folder / RULES).exists():
        folder.mkdir(parents=True, exist_ok=True)
        # The table first, as a run writes them.
        write_episodes(folder, [row for row in read_episodes(first) if row.policy != LEARNER])
        write_text(folder / RULES, (first / RULES).read_text(encoding="utf-8"))


def _watched(trial: Any, curve: Path, _: float) -> None:
    """Tell the trial of its curve. Raises Pruned where it is to end."""
    # All of it: an interruption may have come before what it holds was told.
    known = trial.storage.get_trial(trial._trial_id).intermediate_values
    for number, best in enumerate(_best_of(curve)):
        if number not in known:
            trial.report(best, number)
    if trial.should_prune():
        raise Pruned


def _best_of(curve: Path) -> list[float]:
    """The best return up to each evaluation."""
    best: list[float] = []
    for _, _, value, _ in read_curve(curve):
        best.append(max([value, *best[-1:]]))
    return best


def _is_done(curve: Path, config: AgentConfig) -> bool:
    rows = read_curve(curve)
    return bool(rows) and rows[-1][0] >= config.steps


def _write_best(optuna: Any, study: Any, config: AgentConfig) -> Path:
    """The hyperparameters of the best trial as a file, all of them."""
    path = config.out / BEST
    complete = study.get_trials(states=(optuna.trial.TrialState.COMPLETE,))
    if complete:
        best = study.best_trial
        trained = replace(config, **best.params)
        values = {name: getattr(trained, name) for name in names_of(type(config))}
        about = f"# Trial {best.number} of {len(study.trials)}: validation return {best.value:.4g}."
        write_text(path, f"{about}\n{as_table(table_of(config.env), values)}")
    return path


def _told(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {value:.4g}" for name, value in values.items())


def _import_optuna() -> Any:
    try:
        import optuna
    except ImportError as error:
        raise missing_extra("--tune", "tune", error) from error
    return optuna


def _say(line: str) -> None:
    print_lines(line)
