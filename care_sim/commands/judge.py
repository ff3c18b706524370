"""`care-sim judge`: detectors against what is there."""

import json
from collections.abc import Mapping, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from care_sim.base.bounds import bounded, check_fields
from care_sim.base.errors import InvalidInput, print_lines, report_problems
from care_sim.base.files import JSON, check_no_link, check_output, write_text
from care_sim.commands.shared.play_options import PlayOptions
from care_sim.commands.shared.selection import check_values
from care_sim.commands.shared.study_command import DONE, FAILED, console
from care_sim.evaluation.detector_quality import Counts, SceneBoxes, counts, curve, reliability
from care_sim.perception.detectors import CLUSTER, PILLARS, PROXY, check_detector
from care_sim.policies.isolation import isolated_policies
from care_sim.reports.detectors import Judged, detector_tables
from care_sim.reports.figures.detectors import DETECTORS_FIGURE, detectors_figure
from care_sim.reports.figures.files import check_figure, save
from care_sim.sources.scenes import Scene, chosen_scenes
from care_sim.study.episode_play import result_or_reason
from care_sim.study.executors import MOST_WORKERS, WORKERS, processes
from care_sim.study.judging import JudgedScene, Samples, judge_scene
from care_sim.study.parameters import Parameters, parameters
from care_sim.study.play_config import PlayConfig, play_grid
from care_sim.study.progress import shown_progress
from care_sim.study.provenance import machine, versions
from care_sim.study.run_config import FULL
from care_sim.study.runner import DIED

_FIGURES = "judge.json"
_TABLES = "tables.md"
_OFFICIAL = "official"
_TRUTH = "truth"


@dataclass(frozen=True, kw_only=True)
class Judge(PlayOptions):
    """Judge detectors: what they find, and how much of it is right.

    Judge detectors on full scans, or on those of a policy: what they find, how much of it is right,
    how sure they may be, how long they take.
    """

    scenes: tuple[str, ...] = ()
    """One number: that many scenes, from the first. Otherwise names of scenes. Without this
    option, all scenes."""
    detectors: tuple[str, ...] = (PROXY, CLUSTER, PILLARS)
    """Names of `care-sim detectors`, in place of --detector. A parameter of one is given as
    DETECTOR.NAME=VALUE, such as pillars.least_score=0.02."""
    least_scores: tuple[float, ...] = (0.3, 0.5)
    """Of a detector with scores: what is less sure is left out, once for each of these. Its curve
    shows all that it reports."""
    against: str = CLUSTER
    """The detector at whose precision the others are compared with it."""
    policy: str = FULL
    """`care-sim policies` lists them. `full` fires every cell."""
    budget: float = 1.0
    """Share of the cells that may fire at a keyframe, above 0 and at most 1."""
    workers: int = bounded(WORKERS, 1, MOST_WORKERS)
    """Processes that play at the same time."""
    out: Path = Path("runs/judge")
    """Folder of tables, figure and numbers."""
    official: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Write all boxes, too, in the form that the official nuScenes devkit scores."""
    force: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Replace what such a command wrote there."""

    def __post_init__(self) -> None:
        check_fields(self)
        check_values(self, "detectors", "least_scores")
        check_detector(self.against)
        if self.detector != PROXY:
            raise InvalidInput("judge takes --detectors, one or several, in place of --detector")
        for score in self.least_scores:
            if not 0 <= score <= 1:
                raise InvalidInput(f"least_scores must be from 0 to 1, got {score:g}")

    @isolated_policies()
    def __call__(self) -> int:
        """Run it."""
        scenes = self._scenes()
        plays = self._plays(scenes)
        if (self.out / _FIGURES).exists() and not self.force:
            raise InvalidInput(
                f"{self.out} holds what was judged before: give another --out, or --force to "
                "replace it"
            )
        check_no_link(self.out / _OFFICIAL)
        check_output(self.out / _FIGURES, JSON)
        check_output(self.out / _TABLES)
        check_figure(self.out / DETECTORS_FIGURE)
        judged: dict[str, dict[str, JudgedScene]] = {name: {} for name in self._names}
        problems = []
        # Whatever ends it, what is judged by then is told.
        try:
            with (
                processes(self.workers) as pool,
                shown_progress(len(plays), "scenes") as show,
            ):
                found = pool.map(partial(result_or_reason, judge_scene), plays)
                for number, (scene, each) in enumerate(zip(scenes, found, strict=True), 1):
                    if isinstance(each, str):
                        problems.append(f"failed: {scene.name}: {each}")
                    else:
                        for name, one in zip(self._names, each, strict=True):
                            judged[name][scene.name] = one
                    show(number, "")
        except BrokenExecutor:
            problems.append(f"{DIED} that judges")
        finally:
            if judged[self._names[0]]:
                self._tell(judged, plays[0][0])
        report_problems(problems)
        return FAILED if problems else DONE

    @property
    def _names(self) -> list[str]:
        """The detectors, each once."""
        return [*dict.fromkeys(self.detectors)]

    def _scenes(self) -> Sequence[Scene]:
        return chosen_scenes(self.scene_source().scenes(), self.scenes)

    def _plays(self, scenes: Sequence[Scene]) -> list[list[PlayConfig]]:
        """Those of every scene, one a detector."""
        source = self.scene_source()
        common = self.common([self.policy])
        floors, latencies = [common.pop("floor_seed")], [common.pop("camera_latency")]
        made = []
        for name in self._names:
            check_detector(name)
            own = common | {"detector": name, "detector_parameters": self._parameters(name)}
            made.append(
                play_grid(source, scenes, [self.policy], [self.budget], floors, latencies, **own)
            )
        return [list(plays) for plays in zip(*made, strict=True)]

    def _parameters(self, detector: str) -> Parameters:
        given = parameters(self.detector_parameters)
        # A detector may be named by its place, which has dots, too.
        owners = {name: name.rpartition(".")[0] for name, _ in given}
        if foreign := [name for name, owner in owners.items() if owner not in self.detectors]:
            raise InvalidInput(
                f"detector parameters are given as DETECTOR.NAME=VALUE of one of "
                f"{', '.join(self.detectors)}, got {foreign[0]}"
            )
        return tuple(
            (name.rpartition(".")[2], value) for name, value in given if owners[name] == detector
        )

    def _tell(self, judged: Mapping[str, Mapping[str, JudgedScene]], play: PlayConfig) -> None:
        scenes = {name: [*own.values()] for name, own in judged.items()}
        boxes = {name: [one.boxes for one in own] for name, own in scenes.items()}
        tables = detector_tables(scenes, self.least_scores, self.against)
        told = self._report([*judged[self._names[0]]], scenes, play)
        write_text(self.out / _FIGURES, json.dumps(told, indent=1) + "\n")
        write_text(self.out / _TABLES, "\n".join(table.markdown() for table in tables))
        save(detectors_figure(boxes), self.out / DETECTORS_FIGURE)
        # Samples of another run beside these would be scored as if they were of these scenes.
        for old in (self.out / _OFFICIAL).glob("*.json"):
            old.unlink()
        if self.official:
            for name, own in scenes.items():
                self._write_samples(name, [one.reported for one in own])
            self._write_samples(_TRUTH, [one.true for one in scenes[self._names[0]]])
        for table in tables:
            console().print(table.rich())
        figure = f"Figure: {self.out / DETECTORS_FIGURE}.png"
        print_lines(f"Tables: {self.out / _TABLES}", figure)

    def _write_samples(self, name: str, scenes: Sequence[Samples]) -> None:
        samples = {token: boxes for scene in scenes for token, boxes in scene.items()}
        write_text(self.out / _OFFICIAL / f"{name}.json", json.dumps(samples))

    def _report(self, names: Sequence[str], judged: Judged, play: PlayConfig) -> dict[str, Any]:
        """Everything that the tables and the figure show, and what was played, as plain values."""
        row = play.row()
        conditions = {name: row[name] for name in row if not name.startswith(("scene", "detector"))}
        return {
            "scenes": [*names],
            "conditions": conditions,
            "detector_parameters": [list(pair) for pair in parameters(self.detector_parameters)],
            "least_scores": list(self.least_scores),
            "versions": versions(),
            "machine": machine(),
            "detectors": {
                name: self._numbers([one.boxes for one in own])
                | {"scan_ms": float(np.median(np.concatenate([one.scan_ms for one in own])))}
                for name, own in judged.items()
            },
        }

    def _numbers(self, scenes: Sequence[SceneBoxes]) -> dict[str, Any]:
        found = {f"{score:g}": _plain(counts(scenes, score)) for score in (0.0, *self.least_scores)}
        return {
            "from score": found,
            "score, recall, precision": curve(scenes).round(5).tolist(),
            "boxes, mean score, share right": [
                [None if np.isnan(number) else round(number, 5) for number in row]
                for row in reliability(scenes).tolist()
            ],
        }


def _plain(found: Counts) -> dict[str, float]:
    columns = ("boxes", "right", "frames", "found", "events", "sighted")
    return {name: float(getattr(found, name).sum()) for name in columns}
