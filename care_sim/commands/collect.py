"""`care-sim collect`: a policy's episodes as a Minari dataset, for offline learning."""

import inspect
import shutil
import sys
import warnings
from collections.abc import Generator, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.progress import track

import care_sim
from care_sim.base.bounds import bounded, check_fields
from care_sim.base.errors import InvalidInput, counted, print_lines, shown
from care_sim.base.extras import import_minari
from care_sim.base.seed_ranges import training_seeds
from care_sim.commands.shared.options import DEFAULT_OPTIONS, Options
from care_sim.study.episode_config import EpisodeConfig, grid
from care_sim.study.run_config import MOST_TASKS


@dataclass(frozen=True, kw_only=True)
class Collect:
    """Write a policy's episodes as a Minari dataset.

    The dataset is for offline learning. It holds observations, actions, rewards, seeds and the
    environment. Every episode has a training seed.
    """

    scenario: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO")]
    """dartout, dense, cutin, ncap, r157, drive, that of an installed package, or MODULE:CLASS;
    `care-sim scenarios` lists their parameters.
    """
    dataset: str = tyro.MISSING
    """The id for `minari.load_dataset`, for example care-sim/dense/care-v0. Minari stores datasets
    in the folder MINARI_DATASETS_PATH, or else in ~/.minari/datasets.
    """
    policy: str = "care"
    """`care-sim policies` lists them. `full` always runs with budget 1.0."""
    budget: float = 0.1
    """Share of the cells that may fire at a keyframe, above 0 and at most 1."""
    episodes: int = bounded(20, 1, MOST_TASKS)
    """Episodes to play, on the training seeds from 10000 on."""
    conditions: Annotated[Options, tyro.conf.arg(name="")] = DEFAULT_OPTIONS
    """Further conditions."""

    def __post_init__(self) -> None:
        check_fields(self)

    def __call__(self) -> int:
        """Run it."""
        minari = import_minari()
        folder = _folder(self.dataset)
        axes = ([self.scenario], [self.policy], [self.budget], training_seeds(self.episodes))
        configs = grid(*axes, **self.conditions.arguments([self.policy]))
        returns: list[float] = []
        shown_configs = track(
            configs, "episodes", console=Console(stderr=True), disable=not sys.stderr.isatty()
        )
        with configs[0].make_env() as env, warnings.catch_warnings():
            # Minari asks for an author, an e-mail and a link, which are the publisher's to give.
            warnings.filterwarnings("ignore", category=UserWarning, module="minari")
            episodes = _played(env, shown_configs, returns)
            try:
                dataset = minari.create_dataset_from_buffers(
                    self.dataset,
                    episodes,
                    env,
                    algorithm_name=self.policy,
                    description=f"{self.policy} in {self.scenario}, budget {configs[0].budget:g}",
                    requirements=[f"care-sim=={care_sim.__version__}"],
                    # Compressed, unlike Minari's HDF5 and Arrow: an action is 64 KB, mostly zeros.
                    data_format="parquet",
                )
            except BaseException:
                # Minari makes the folder before it asks for the first episode. Until then, the
                # folder may be another process's.
                if inspect.getgeneratorstate(episodes) != inspect.GEN_CREATED:
                    shutil.rmtree(folder, ignore_errors=True)
                raise
        mean = sum(returns) / len(returns)
        print_lines(
            f"{counted(dataset.total_episodes, 'episode')}, {dataset.total_steps} steps, mean "
            f"return {mean:.2f}, in {folder}: minari.load_dataset({self.dataset!r})"
        )
        return 0


def _folder(dataset: str) -> Path:
    """Return the folder of a new dataset. Raises InvalidInput for an invalid id or an existing
    dataset.
    """
    from minari.dataset.minari_dataset import DATASET_ID_RE
    from minari.storage import get_dataset_path

    if not (match := DATASET_ID_RE.fullmatch(dataset)) or match["version"] is None:
        raise InvalidInput(
            "dataset must be NAMESPACE/NAME-vNUMBER, the namespace of at least two characters, for "
            f"example care-sim/dense/care-v0, got {shown(dataset)}"
        )
    folder: Path = get_dataset_path(dataset)
    if folder.exists():
        raise InvalidInput(
            f"dataset {dataset} is there already: name another version, or remove {folder}"
        )
    return folder


def _played(
    env: Any, configs: Iterable[EpisodeConfig], returns: list[float]
) -> Generator[Any, None, None]:
    """Yield episodes as Minari's buffers, and add their returns to `returns`."""
    from minari.data_collector import EpisodeBuffer

    for number, config in enumerate(configs):
        policy = config.make_policy(env)
        observation, _ = env.reset(seed=config.seed)
        policy.reset()
        observations, steps, over = [observation], [], False
        while not over:
            action = policy(observation)
            observation, reward, terminated, truncated, _ = env.step(action)
            observations.append(observation)
            steps.append((action, reward, terminated, truncated))
            over = terminated or truncated
        actions, rewards, terminations, truncations = map(list, zip(*steps, strict=True))
        returns.append(sum(rewards))
        yield EpisodeBuffer(
            id=number,
            seed=config.seed,
            observations={key: [each[key] for each in observations] for key in observation},
            actions=actions,
            rewards=rewards,
            terminations=terminations,
            truncations=truncations,
        )
