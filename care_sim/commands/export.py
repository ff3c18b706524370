"""`care-sim export`: data for other programs. A policy's detections on nuScenes scenes, for the
official devkit to score; its episodes as a Minari dataset, for offline learning.
"""

import inspect
import json
import shutil
import sys
import warnings
from collections.abc import Generator, Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from rich.console import Console
from rich.progress import track

import care_sim
from care_sim.base.errors import InvalidInput, counted, print_lines, shown
from care_sim.base.extras import import_extra
from care_sim.base.files import JSON, replacing
from care_sim.base.seeds import training_seeds
from care_sim.commands.options.results import ExportMinari, ExportNuScenes
from care_sim.commands.shared.selection import arguments_of, common_of, source_named
from care_sim.sources.nuscenes.detections import MODALITIES, result_boxes
from care_sim.sources.nuscenes.recordings import NuScenes
from care_sim.sources.nuscenes.table_files import JsonRow
from care_sim.study.episode_config import EpisodeConfig, grid
from care_sim.study.play_config import PlayConfig, play_grid
from care_sim.study.scene_play import play_through_film

_T = TypeVar("_T")


def export_nuscenes(options: ExportNuScenes) -> int:
    """Write a policy's detections in the form of the official nuScenes devkit."""
    # All that is asked for is checked before the file is begun.
    configs = _configs(options)
    with replacing(options.out, JSON) as unfinished:
        results: dict[str, list[JsonRow]] = {}
        for config in _shown(configs, "scenes"):
            results |= _scene_results(config)
        unfinished.write_text(
            json.dumps({"meta": _meta(options, configs[0]), "results": results}), encoding="utf-8"
        )
    count = sum(map(len, results.values()))
    samples = f"{len(results)} samples of {len(configs)} scenes"
    print_lines(f"{count} boxes in {samples} are in {options.out}")
    if not count:
        print("care-sim: the official devkit refuses results without a box", file=sys.stderr)
    return 0


def _configs(options: ExportNuScenes) -> list[PlayConfig]:
    """One play per scene of the split: the devkit wants results for each of its samples."""
    if options.source.partition(":")[0] != NuScenes.kind:
        raise InvalidInput(
            "source must be nuscenes:FOLDER, whose samples the official form names, got "
            f"{options.source!r}"
        )
    source = source_named(options, options.source)
    common = common_of(options, [options.policy])
    # One floor: results are of one way to play, whereas a study has several.
    floors = [common.pop("floor_seed")]
    return play_grid(source, source.scenes(), [options.policy], [options.budget], floors, **common)


def _meta(options: ExportNuScenes, config: PlayConfig) -> dict[str, Any]:
    """Return the origin of the results as the form wants it, and under `care_sim` what made
    them.
    """
    # The scene is left out: this is said once of all scenes.
    own = {"version": care_sim.__version__, "split": options.split or "val", **config.row()}
    del own["scene"]
    return MODALITIES | {"care_sim": own}


def _scene_results(config: PlayConfig) -> dict[str, list[JsonRow]]:
    """Play a nuScenes scene: the boxes of every sample, by its token, in the official form."""
    film = config.film()
    shots = zip(film.shots, play_through_film(config, film).keyframes, strict=True)
    return {
        shot.token: result_boxes(shot, record.reported, record.velocities) for shot, record in shots
    }


def export_minari(options: ExportMinari) -> int:
    """Write a policy's episodes as a Minari dataset."""
    minari = import_extra("minari", "A Minari dataset", "minari")
    folder = _folder(options.dataset)
    policies, seeds = [options.policy], training_seeds(options.episodes)
    given = arguments_of(options, policies)
    configs = grid([options.scenario], policies, [options.budget], seeds, **given)
    returns: list[float] = []
    shown_configs = _shown(configs, "episodes")
    with configs[0].make_env() as env, warnings.catch_warnings():
        # Minari wants an author, an e-mail and a link, which only the publisher knows.
        warnings.filterwarnings("ignore", category=UserWarning, module="minari")
        episodes = _played(env, shown_configs, returns)
        try:
            dataset = minari.create_dataset_from_buffers(
                options.dataset,
                episodes,
                env,
                algorithm_name=options.policy,
                description=f"{options.policy} in {options.scenario}, budget {configs[0].budget:g}",
                requirements=[f"care-sim=={care_sim.__version__}"],
                # Compressed, unlike Minari's HDF5 and Arrow: an action is 64 KB, mostly zeros.
                data_format="parquet",
            )
        except BaseException:
            # Minari makes the folder before it requests the first episode. Until then, the folder
            # may belong to another process.
            if inspect.getgeneratorstate(episodes) != inspect.GEN_CREATED:
                shutil.rmtree(folder, ignore_errors=True)
            raise
    mean = sum(returns) / len(returns)
    print_lines(
        f"{counted(dataset.total_episodes, 'episode')}, {dataset.total_steps} steps, mean "
        f"return {mean:.2f}, in {folder}: minari.load_dataset({options.dataset!r})"
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


def _shown(tasks: Sequence[_T], unit: str) -> Iterable[_T]:
    """The tasks, with their progress on a terminal."""
    return track(tasks, unit, console=Console(stderr=True), disable=not sys.stderr.isatty())
