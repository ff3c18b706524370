"""A training run from the first step, or a checkpoint, to the last.

Learners are those of Stable-Baselines3 and sb3-contrib. Both libraries are imported when a learner
is trained, since their extra 'rl' is optional.
"""

import math
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
from care_sim.policies.learned.grid_features import CHANNELS
from care_sim.study.progress import Show, rounded_duration, shown_progress
from care_sim.training.config import AgentConfig, OnPolicy, PpoConfig, RecurrentPpoConfig, SacConfig
from care_sim.training.environments import plain, side_by_side, validation_episodes, wrapped
from care_sim.training.folder import Folder
from care_sim.training.validation import Row, acting, play, rule

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm

TENSORBOARD = "tensorboard"
"""Folder of the logs for TensorBoard, in that of the run."""
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
"""The rules compared with the learner, and their budget if it is not the learner's. They are
chance, the paper's policies, patterns without a camera, our best policy without a memory, and the
full scan.
"""


def train_agent(
    config: AgentConfig, evaluated: Callable[[float], None] = lambda _return: None
) -> None:
    """Train, and store everything in `config.out` (`care_sim.training.folder`). `evaluated` is
    called with the mean return of every stored evaluation. Raises InvalidInput for arguments that
    do not fit, MissingExtra for a library that is not installed.
    """
    # Report a missing library before the folder is made.
    algorithm(config.algorithm)
    _check_tensorboard(config)
    import_torch().set_num_threads(config.threads)
    folder = Folder(config)
    with closing(wrapped(config)) as env, closing(side_by_side(config)) as envs:
        model = (
            _resumed(config, folder, envs)
            if config.resume
            else make_learner(config, envs, sensing(env).rig.grid.goes_round)
        )
        folder.begin(model)
        for name, score in folder.rules(partial(played_rules, config)).items():
            print_lines(f"{name}: {score}")
        _learn(config, folder, model, env, evaluated)


def algorithm(name: str) -> Any:
    """Return the class of a learner, a `BaseAlgorithm`. Raises MissingExtra for one that is not
    installed.
    """
    try:
        if name == "recurrent-ppo":
            from sb3_contrib import RecurrentPPO

            return RecurrentPPO
        from stable_baselines3 import PPO, SAC
    except ImportError as error:
        raise missing_extra(name, "rl", error) from error
    return {"ppo": PPO, "sac": SAC}[name]


def make_learner(config: AgentConfig, envs: Any, goes_round: bool = True) -> "BaseAlgorithm":
    """Return a new learner; `goes_round` is True for a full turn."""
    policy, options = _settings(config, goes_round)
    log = str(config.out / TENSORBOARD) if config.tensorboard else None
    learner: BaseAlgorithm = algorithm(config.algorithm)(
        policy=policy,
        env=envs,
        learning_rate=config.learning_rate,
        gamma=config.discount,
        seed=config.seed,
        device="cpu",
        tensorboard_log=log,
        **options,
    )
    return learner


def _settings(config: AgentConfig, goes_round: bool) -> tuple[Any, dict[str, Any]]:
    """Return the policy, and the learner's own options."""
    # The module subclasses PyTorch's and Stable-Baselines3's classes: optional extra 'rl'.
    from care_sim.training.networks import Sectored, SectorPolicy

    shape = len(CHANNELS), config.rows, config.columns
    seen = {"shape": shape, "goes_round": goes_round, "without": config.without}
    # PPO scores sectors with the network that `ppo` later runs in NumPy. The others keep their own
    # networks behind features of the sectors, since their critics or memories need a vector.
    own = {
        "features_extractor_class": Sectored,
        "features_extractor_kwargs": seen | {"sectors": (config.elevations, config.azimuths)},
    }
    if isinstance(config, PpoConfig):
        kwargs = seen | {"hidden": config.hidden, "log_std_init": math.log(config.noise)}
        return SectorPolicy, _on_policy(config) | {"policy_kwargs": kwargs}
    if isinstance(config, RecurrentPpoConfig):
        kwargs = own | {"log_std_init": math.log(config.noise)}
        return "MultiInputLstmPolicy", _on_policy(config) | {"policy_kwargs": kwargs}
    assert isinstance(config, SacConfig)
    return "MultiInputPolicy", {
        "buffer_size": config.memory,
        "batch_size": config.batch,
        "policy_kwargs": own,
    }


def _on_policy(config: OnPolicy) -> dict[str, Any]:
    return {
        "n_steps": config.rollout,
        "batch_size": config.batch,
        "n_epochs": config.epochs,
        "gae_lambda": 0.9,
    }


def _resumed(config: AgentConfig, folder: Folder, envs: Any) -> "BaseAlgorithm":
    print_lines(
        f"resuming from {folder.checkpoint}: loading a checkpoint runs code from it, so resume "
        "your own runs only"
    )
    model: BaseAlgorithm = algorithm(config.algorithm).load(
        folder.checkpoint, env=envs, device="cpu"
    )
    if model.num_timesteps >= config.steps and folder.evaluated(model):
        raise InvalidInput(
            f"{folder.path}: {model.num_timesteps} steps are done; ask for more than that with "
            "--steps"
        )
    # Other episodes than before the interruption; the same at every resumption.
    envs.seed(config.seed + model.num_timesteps)
    # SAC's experience is not stored, so SAC gathers some before it learns.
    if config.algorithm == "sac":
        model.learning_starts += model.num_timesteps  # type: ignore[attr-defined]
    return model


def played_rules(config: AgentConfig) -> dict[str, list[Row]]:
    """Play the validation seeds with the rules. A rule that does not fit the learner's environment,
    such as a map of another grid, is reported and left out.
    """
    print_lines(f"playing the rules on {counted(config.episodes, 'validation episode')}")
    played = {}
    for name, budget in RULES.items():
        with closing(plain(config, budget)) as env:
            try:
                care_sim.make_policy(name, env.unwrapped)
            except InvalidInput as error:
                print_lines(f"{name} does not fit and is not beside it: {error}")
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
    """Evaluate and learn in turn, until the last step is evaluated. Stable-Baselines3's callbacks
    do not fit: EvalCallback draws its own seeds, and CheckpointCallback does not replace its files
    whole.
    """
    before, begun, learning_s = folder.seconds, model.num_timesteps, 0.0
    with shown_progress(config.steps, "steps") as show:
        while True:
            # A resumed run may have been interrupted between learning and evaluation.
            if not folder.evaluated(model):
                played = play(env, acting(model), validation_episodes(config))
                score = folder.keep(model, played, before + learning_s, env.unwrapped.rig)
                print_lines(f"{model.num_timesteps} steps: {score}")
                evaluated(score.mean_return)
            if (left := config.steps - model.num_timesteps) <= 0:
                break
            started = time.monotonic()
            _learn_steps(model, min(config.evaluate_every, left), _paced(show, config), folder)
            learning_s += time.monotonic() - started
    if learned := model.num_timesteps - begun:
        print_lines(
            f"{learned / learning_s:.0f} environment steps per second inside {config.algorithm}, "
            "learning included"
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

    # An interrupt ends `learn` anywhere; the weights learned until then are kept.
    try:
        model.learn(steps, ConvertCallback(each), reset_num_timesteps=False)
    finally:
        folder.save(model)


def _paced(show: Show, config: AgentConfig) -> Callable[["BaseAlgorithm"], None]:
    """Return a display of steps per second and remaining time."""
    first: tuple[int, float] | None = None

    def shown(model: "BaseAlgorithm") -> None:
        nonlocal first
        steps, now = model.num_timesteps, time.monotonic()
        first = first or (steps, now)
        told = ""
        if steps > first[0]:
            rate = (steps - first[0]) / (now - first[1])
            left = rounded_duration(max(config.steps - steps, 0) / rate)
            told = f"{rate:.0f} steps/s, {left} left"
        show(min(steps, config.steps), told)

    return shown


def _check_tensorboard(config: AgentConfig) -> None:
    # A resumed learner writes its log without the option, too.
    check_no_link(config.out / TENSORBOARD)
    if config.tensorboard:
        try:
            import tensorboard  # noqa: F401
        except ImportError as error:
            raise missing_extra("--tensorboard", "rl", error) from error
