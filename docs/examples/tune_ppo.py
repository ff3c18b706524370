"""Hyperparameters of PPO chosen by Optuna: each trial is a training run in a folder of its own.

    pip install 'optuna>=4.5'
    python docs/examples/tune_ppo.py runs/tune 20          # 20 trials of 40,000 steps
    care-sim train ppo --env CARE-CutIn-v0 --hyperparameters runs/tune/best.toml

Run it again to add trials. The first trial has the default values. A trial ends early where its
curve is below the median of the others. All trials are evaluated on the same validation seeds, so
only other seeds show how good the best is.
"""

import sys
from pathlib import Path

import optuna
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend

from care_sim.training.config import PpoConfig
from care_sim.training.run import train_agent

ENV, STEPS = "CARE-CutIn-v0", 40_000
TRIED = ("learning_rate", "noise", "discount", "epochs", "batch")


def suggested(trial: optuna.Trial) -> dict[str, float]:
    """The hyperparameters of a trial."""
    return {
        "learning_rate": trial.suggest_float("learning_rate", 1e-4, 1e-2, log=True),
        "noise": trial.suggest_float("noise", 0.1, 1.0, log=True),
        "discount": trial.suggest_categorical("discount", [0.8, 0.9, 0.95, 0.99]),
        "epochs": trial.suggest_categorical("epochs", [1, 2, 4, 8]),
        "batch": trial.suggest_categorical("batch", [64, 128, 256, 512]),
    }


def main(folder: Path, trials: int, steps: int = STEPS, **settings: int) -> None:
    """Play trials, and write the hyperparameters of the best to `best.toml`."""

    def objective(trial: optuna.Trial) -> float:
        returns: list[float] = []

        def evaluated(mean_return: float) -> None:
            returns.append(mean_return)
            trial.report(max(returns), len(returns))
            if trial.should_prune():
                raise optuna.TrialPruned

        out = folder / f"{trial.number:03d}"
        given = {**suggested(trial), **settings}
        train_agent(PpoConfig(env=(ENV,), steps=steps, out=out, **given), evaluated)
        return max(returns)

    folder.mkdir(parents=True, exist_ok=True)
    study = optuna.create_study(
        storage=JournalStorage(JournalFileBackend(str(folder / "study.journal"))),
        study_name="ppo",
        direction="maximize",
        pruner=optuna.pruners.MedianPruner(n_startup_trials=4, n_warmup_steps=1),
        load_if_exists=True,
    )
    if not study.trials:
        study.enqueue_trial({name: getattr(PpoConfig, name) for name in TRIED})
    # Weights that have grown without bounds give actions that are no numbers: such a trial fails.
    study.optimize(objective, trials, catch=(ValueError,))
    best = [f"{name} = {value}" for name, value in study.best_params.items()]
    (folder / "best.toml").write_text("\n".join([f"[{ENV}]", *best, ""]))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
