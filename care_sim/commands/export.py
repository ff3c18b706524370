"""`care-sim export`: a policy's detections on nuScenes scenes, for the official devkit to score."""

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro
from rich.console import Console
from rich.progress import track

import care_sim
from care_sim.base.errors import InvalidInput, print_lines
from care_sim.base.files import JSON, replacing
from care_sim.commands.shared.play_options import PlayOptions
from care_sim.sources.nuscenes.recordings import NuScenes
from care_sim.sources.nuscenes.results_form import MODALITIES, result_boxes
from care_sim.sources.nuscenes.table_files import JsonRow
from care_sim.study.play_config import PlayConfig, play_grid
from care_sim.study.scene_play import play_through_film


@dataclass(frozen=True, kw_only=True)
class Export(PlayOptions):
    """Write a policy's detections for the official nuScenes devkit.

    Play a policy over nuScenes scenes and write its detections in the results form of the
    official devkit.
    """

    source: str = tyro.MISSING
    """nuscenes:FOLDER, the folder of a nuScenes v1.0 database."""
    policy: str = "care"
    """`care-sim policies` lists them. `full` always runs with budget 1.0."""
    budget: float = 0.1
    """Share of the cells that may fire at a keyframe, above 0 and at most 1."""
    out: Path
    """The results file, JSON."""

    def __call__(self) -> int:
        """Run it."""
        # All that is asked for is checked before the file is begun.
        configs = self._configs()
        with replacing(self.out, JSON) as unfinished:
            shown = track(
                configs, "scenes", console=Console(stderr=True), disable=not sys.stderr.isatty()
            )
            results = {
                token: boxes for config in shown for token, boxes in _scene_results(config).items()
            }
            unfinished.write_text(
                json.dumps({"meta": self._meta(configs[0]), "results": results}), encoding="utf-8"
            )
        count = sum(map(len, results.values()))
        samples = f"{len(results)} samples of {len(configs)} scenes"
        print_lines(f"{count} boxes in {samples} are in {self.out}")
        if not count:
            print("care-sim: the official devkit refuses results without a box", file=sys.stderr)
        return 0

    def _configs(self) -> list[PlayConfig]:
        """One play per scene of the split: the devkit wants results for each of its samples."""
        if self.source.partition(":")[0] != NuScenes.kind:
            raise InvalidInput(
                "source must be nuscenes:FOLDER, whose samples the official form names, got "
                f"{self.source!r}"
            )

        # One floor and one latency: results are of one way to play, whereas a study has several.
        source = self.scene_source()
        common = self.common([self.policy])
        floors = [common.pop("floor_seed")]
        latencies = [common.pop("camera_latency")]
        return play_grid(
            source, source.scenes(), [self.policy], [self.budget], floors, latencies, **common
        )

    def _meta(self, config: PlayConfig) -> dict[str, Any]:
        """What the form asks about the origin of results, and under `care_sim` what made them."""
        # The scene is left out: this is said once of all scenes.
        own = {"version": care_sim.__version__, "split": self.split or "val", **config.row()}
        del own["scene"]
        return MODALITIES | {"care_sim": own}


def _scene_results(config: PlayConfig) -> dict[str, list[JsonRow]]:
    """Play a nuScenes scene: the boxes of every sample, by its token, in the official form."""
    film = config.film()
    shots = zip(film.shots, play_through_film(config, film).keyframes, strict=True)
    return {
        shot.token: result_boxes(shot, record.detections, record.velocities)
        for shot, record in shots
    }
