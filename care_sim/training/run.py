"""A training run from the first step, or a checkpoint, to the last."""

import time
from collections.abc import Callable
from contextlib import closing
from functools import partial
from typing import TYPE_CHECKING, Any

import care_sim
from care_sim.base.errors import InvalidInput, counted, print_lines
from care_sim.base.extras import import_torch, missing_extra
from care_sim.base.files import check_no_link
from care_sim.envs.sensing import sensing
from care_sim.study.progress import Show, shown_progress
from care_sim.training import algorithms
from care_sim.training.config import AgentConfig, OnPolicy
from care_sim.training.environments import plain, side_by_side, validation_episodes, wrapped
from care_sim.training.episodes import Played
from care_sim.training.folder import Folder
from care_sim.training.pace import Pace
from care_sim.training.validation import acting, play, rule

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm

RULES = {
    "random": None,
    "history": None,
    "fan": None,
    "place": None,
    "all-camera": None,
    "care": None,
    "care-spread": None,
    "full": 1.0,
}
"""The rules that the learner is compared with, and their budget where it is not the learner's:
chance, the paper's, patterns that ask no camera, the best of ours that remembers nothing, and what
can be reached.
"""


def train_agent(
    config: AgentConfig, evaluated: Callable[[float], None] = lambda _return: None
) -> int:
    """Train, and keep everything in `config.out`; see `care_sim.training.folder`. `evaluated` is
    told the mean return of every evaluation, once it is kept.

    Raises InvalidInput for what does not fit, MissingExtra for a library that is not installed.
    """
    # What is missing is told before the folder is made.
    algorithms.algorithm(config.algorithm)
    _check_tensorboard(config)
    import_torch().set_num_threads(config.threads)
    folder = Folder(config)
    env = wrapped(config)
    envs = side_by_side(config)
    try:
        model = (
            _resumed(config, folder, envs)
            if config.resume
            else algorithms.make_learner(config, envs, sensing(env).rig.grid.goes_round)
        )
        folder.begin(model)
        # Whatever SAC does beyond its steps is fewer than it has environments.
        whole = config.whole_rollouts(model.num_timesteps) if isinstance(config, OnPolicy) else ""
        if whole:
            _say(whole)
        for name, score in folder.rules(partial(played_rules, config)).items():
            _say(f"{name}: {score}")
        _learn(config, folder, model, env, evaluated)
    finally:
        envs.close()
        env.close()
    return 0


def _resumed(config: AgentConfig, folder: Folder, envs: Any) -> "BaseAlgorithm":
    _say(
        f"resuming from {folder.checkpoint}: loading a checkpoint runs code from it, so resume "
        "your own runs only"
    )
    model: BaseAlgorithm = algorithms.algorithm(config.algorithm).load(
        folder.checkpoint, env=envs, device="cpu"
    )
    if model.num_timesteps >= config.steps and folder.evaluated(model):
        raise InvalidInput(
            f"{folder.path}: {model.num_timesteps} steps are done; ask for more than that with "
            "--steps"
        )
    # Episodes other than those before the interruption; the same again at every resumption.
    envs.seed(config.seed + model.num_timesteps)
    # The experience of SAC is not kept, so it gathers some anew before it learns from it.
    if config.algorithm == "sac":
        model.learning_starts += model.num_timesteps  # type: ignore[attr-defined]
    return model


def played_rules(config: AgentConfig) -> dict[str, list[Played]]:
    """How the rules play the validation seeds. One that does not fit the learner's environment, as
    a map of another grid, is left out, and said so.
    """
    _say(f"playing the rules on {counted(config.episodes, 'validation episode')}")
    played = {}
    for name, budget in RULES.items():
        with closing(plain(config, budget)) as env:
            try:
                care_sim.make_policy(name, env.unwrapped)
            except InvalidInput as error:
                _say(f"{name} does not fit and is not beside it: {error}")
            else:
                played[name] = play(env, rule(name, env), validation_episodes(config))
    return played


def _learn(
    config: AgentConfig,
    folder: Folder,
    model: "BaseAlgorithm",
    env: Any,
    evaluated: Callable[[float], None],
) -> None:
    """Evaluate and learn in turn, until the last step is evaluated.

    Stable-Baselines3's EvalCallback and CheckpointCallback cannot do it: the one evaluates episodes
    of seeds that it draws itself, the other does not replace its files whole.
    """
    clock = Stopwatch(folder.seconds)
    begun = model.num_timesteps
    with shown_progress(config.steps, "steps") as show:
        shown = _progress(show, config, clock)
        while True:
            # A resumed run may have been interrupted between learning and evaluation.
            if not folder.evaluated(model):
                played = play(env, acting(model), validation_episodes(config))
                score = folder.keep(model, played, clock.seconds, env.unwrapped.rig)
                _say(f"{model.num_timesteps} steps: {score}")
                evaluated(score.mean_return)
            if (left := config.steps - model.num_timesteps) <= 0:
                break
            with clock:
                _learn_steps(model, min(config.evaluate_every, left), shown, folder)
    if learned := model.num_timesteps - begun:
        rate = learned / clock.own_seconds
        _say(
            f"{rate:.0f} environment steps per second inside {config.algorithm}, learning included"
        )


def _learn_steps(
    model: "BaseAlgorithm",
    steps: int,
    shown: Callable[["BaseAlgorithm"], None],
    folder: Folder,
) -> None:
    from stable_baselines3.common.callbacks import ConvertCallback

    def each(local: dict[str, Any], _: dict[str, Any]) -> bool:
        shown(local["self"])
        return True

    # An interrupt ends `learn` anywhere; what was learned until then is kept.
    try:
        model.learn(steps, ConvertCallback(each), reset_num_timesteps=False)
    finally:
        folder.save(model)


def _progress(
    show: Show, config: AgentConfig, clock: "Stopwatch"
) -> Callable[["BaseAlgorithm"], None]:
    pace = Pace(config.steps)

    def shown(model: "BaseAlgorithm") -> None:
        steps, updates = model.num_timesteps, model._n_updates
        show(min(steps, config.steps), pace.told(steps, updates, clock.own_seconds))

    return shown


class Stopwatch:
    """Seconds spent in learning, evaluations left out; `before` are those of a resumed run."""

    def __init__(self, before: float):
        self._before = before
        self._done = 0.0
        self._since: float | None = None

    def __enter__(self) -> None:
        self._since = time.monotonic()

    def __exit__(self, *_: object) -> None:
        self._done = self.own_seconds
        self._since = None

    @property
    def own_seconds(self) -> float:
        """Of this program."""
        return self._done + (time.monotonic() - self._since if self._since is not None else 0.0)

    @property
    def seconds(self) -> float:
        """With those before it was resumed."""
        return self._before + self.own_seconds


def _check_tensorboard(config: AgentConfig) -> None:
    # A resumed learner writes its log without the option, too.
    check_no_link(config.out / algorithms.TENSORBOARD)
    if config.tensorboard:
        try:
            import tensorboard  # noqa: F401
        except ImportError as error:
            raise missing_extra("--tensorboard", "rl", error) from error


def _say(line: str) -> None:
    print_lines(line)
