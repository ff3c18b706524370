"""Options that several commands share. A subclass that changes a default keeps the help."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import tyro

from care_sim.base.checks import bounded, check_fields
from care_sim.base.errors import InvalidInput, shown
from care_sim.base.limits import MOST_WORKERS, WORKERS
from care_sim.base.seeds import CALIBRATION, split_of
from care_sim.core.conditions import ClosedLoopConditions, Conditions
from care_sim.study.rows.parameters import parameters

Flag = Annotated[bool, tyro.conf.FlagCreatePairsOff]
"""A switch that has no opposite."""
_CLOSED_LOOP, _BOTH_LOOPS = ClosedLoopConditions(), Conditions()
"""The defaults."""


@dataclass(frozen=True, kw_only=True)
class WorkerOptions:
    """How many processes a command takes."""

    workers: int = bounded(WORKERS, 1, MOST_WORKERS)
    """Processes that play at the same time."""

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, kw_only=True)
class PolicyOptions:
    """One policy and its budget."""

    policy: str = "care"
    """`care-sim list policies` lists them. `full` always runs with budget 1.0."""
    budget: float = 0.1
    """Share of the cells that may fire at a keyframe, above 0 and at most 1."""


@dataclass(frozen=True, kw_only=True)
class GridOptions:
    """Policies and budgets, of which every pair is played."""

    policies: tuple[str, ...] = ()
    """Names of `care-sim list policies`; `all` stands for all but the controls. `full` always runs
    with budget 1.0."""
    budgets: tuple[float, ...] = ()
    """Shares of the cells that may fire at a keyframe, above 0 and at most 1."""


@dataclass(frozen=True, kw_only=True)
class DetectorOptions:
    """Which detector looks at the points."""

    detector: str = "returns"
    """Built in: returns (the paper's proxy), graded (recall from a file), recorded (boxes from a
    file), centerpoint, megvii and pointrcnn (measured), cluster (a real one), pillars (a learned
    one), torchscript. Otherwise the name of an installed detector, or MODULE:CLASS.
    """
    detector_parameters: tuple[str, ...] = ()
    """Parameters of the detector as NAME=VALUE, for example file=model.pt for torchscript,
    file=recall.csv for graded."""


@dataclass(frozen=True, kw_only=True)
class ParameterOptions:
    """Parameters of policies."""

    policy_parameters: tuple[str, ...] = ()
    """Parameters of the policies as NAME=VALUE, for example k_safe=0 for care-sbf; for one of
    several policies as POLICY.NAME=VALUE, for example ppo.path=weights.npz."""


@dataclass(frozen=True, kw_only=True)
class SensingOptions(DetectorOptions):
    """Sensors, detector and conditions of the closed loop, the same for all episodes."""

    sensor: str = "hdl-32e"
    """LiDAR and cameras: a name of `care-sim list sensors`, or a .toml file of a set-up."""
    conditions: Annotated[ClosedLoopConditions, tyro.conf.OmitArgPrefixes] = _CLOSED_LOOP
    """How well the car senses, how it drives, and how it spends its budget."""

    def sensing(self) -> dict[str, Any]:
        """As arguments of `EpisodeConfig`. Raises InvalidInput for parameters that are none."""
        given = {each.name: getattr(self.conditions, each.name) for each in fields(self.conditions)}
        return given | {
            "sensor": self.sensor,
            "detector": self.detector,
            "detector_parameters": parameters(self.detector_parameters),
        }


@dataclass(frozen=True, kw_only=True)
class EpisodeOptions(SensingOptions, ParameterOptions):
    """Everything that episodes share: sensing, and parameters of scenarios and policies."""

    scenario_parameters: tuple[str, ...] = ()
    """Physics of the scenario as NAME=VALUE, a range as NAME=LOW,HIGH, for example vehicles=7
    gap_m=0.8,1.2; see `care-sim list scenarios`."""


@dataclass(frozen=True, kw_only=True)
class RecordingOptions:
    """Which part of a source is meant."""

    split: str | None = None
    """For streets: evaluation (150 scenes) or calibration (20). For nuScenes: train, val,
    mini_train, mini_val, all, or one of splits.json."""
    version: str | None = None
    """For nuScenes: the version, if the folder holds several."""
    topics: tuple[str, ...] = ()
    """For bags: the topics of points and poses, if there are several."""


@dataclass(frozen=True, kw_only=True)
class SourceOptions(RecordingOptions):
    """Which scenes a source has, and what their camera saw."""

    sensor: str | None = None
    """For streets, KITTI, Boreas and sweeps: LiDAR and cameras, a name of `care-sim list sensors`
    or a .toml file of a set-up."""
    camera_detections: Path | None = None
    """For nuScenes: a file with the boxes of a camera detector, in nuScenes or COCO results
    form."""
    sweeps: int | None = None
    """For nuScenes: sweeps per keyframe that a detector gets. The default is the detector's own
    number, mostly 1. 2 adds the sweep before, fired by the mask of the keyframe before.
    """
    camera_times: str | None = None
    """For nuScenes: own (the default: each camera at the time of its picture) or sweep (all at the
    time of the sweep)."""
    empty_boxes: bool = False
    """For nuScenes and Argoverse 2: annotate boxes without a recorded point, too."""
    reference: Annotated[str | None, tyro.conf.arg(metavar="STR")] = None
    """For sweeps: the detector that annotates them, cluster unless given."""

    def source_options(self) -> list[str]:
        """The names of options that are given."""
        given = {each.name: getattr(self, each.name) for each in fields(SourceOptions)}
        # By identity: 0 is equal to False, and a number that somebody gave.
        return [
            name
            for name, value in given.items()
            if not (value is None or value is False or value == ())
        ]


@dataclass(frozen=True, kw_only=True)
class PlayOptions(SourceOptions, DetectorOptions, ParameterOptions):
    """Options that all plays of the open loop share."""

    source: str = "streets"
    """streets, argoverse2:FOLDER, nuscenes:FOLDER, kitti:FOLDER, sweeps:FOLDER, boreas, or a source
    of your own: the name of an installed one or MODULE:CLASS, with :FOLDER for recordings."""
    conditions: Annotated[Conditions, tyro.conf.OmitArgPrefixes] = _BOTH_LOOPS
    """How well the car senses, and how it spends its budget."""


@dataclass(frozen=True, kw_only=True)
class SceneOptions(PlayOptions):
    """Plays of the open loop over several scenes."""

    scenes: tuple[str, ...] = ()
    """One number: that many scenes, from the first. Otherwise names of scenes. Without this option,
    all scenes."""


@dataclass(frozen=True, kw_only=True)
class StudyOptions(WorkerOptions):
    """Options of every command that plays a study."""

    cluster: str | None = None
    """Address of a dask scheduler whose workers play instead, as many tasks at a time as they have
    threads, for example tcp://HOST:8786 (extra 'cluster')."""
    out: Path | None = None
    """Folder of the results; an interrupted study resumes there. Without this option it is in runs/
    and has the name of the command: the first, such as runs/sweep and runs/sweep-2, that holds no
    results of other options."""
    force: bool = False
    """Play into a folder that holds another study, finished or not, or rows that are not asked for
    now. Its tables, figures and Parquet files are replaced at the end; its journal stays. Episodes
    never replace the plays of a protocol, nor plays episodes: their files have other names."""
    verbose: bool = False
    """Print all tables."""


def seeds_of(numbers: Sequence[int]) -> Sequence[int]:
    """The seeds that one number means (that many, from 0) or several numbers (these; twice the same
    is that seed alone). Raises InvalidInput for a number below one or above that of the test seeds,
    and for seeds of several splits (`care_sim.base.seeds`).
    """
    if len(numbers) != 1:
        split_of(numbers)
        return numbers
    if not 1 <= numbers[0] <= CALIBRATION:
        raise InvalidInput(
            f"seeds must be one number, a count from 1 to {CALIBRATION:,} (that many, from 0), or "
            "a list of two or more seeds (7 7 is seed 7 alone), got the count "
            f"{shown(numbers[0])}"
        )
    return range(numbers[0])
