"""Options of the commands of the open loop: source of the scenes, detector, conditions."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import tyro

from care_sim.base.errors import report_problems
from care_sim.commands.shared.selection import policy_parameters
from care_sim.core.conditions import Conditions
from care_sim.perception.detectors import PROXY
from care_sim.sources.installed import SOURCES
from care_sim.sources.named import source_of
from care_sim.sources.scenes import Source
from care_sim.study.parameters import parameters

_DEFAULT_CONDITIONS = Conditions()
"""The defaults."""


def named_after(command: str, played: str) -> str:
    """A command and the world or kind of source that it plays, of a place its module, as folders
    are called.
    """
    return f"{command}-{played.partition(':')[0]}"


@dataclass(frozen=True, kw_only=True)
class SourceOptions:
    """Which of a source's scenes there are, and what their camera saw."""

    split: str | None = None
    """For streets: evaluation (150 scenes) or calibration (20). For nuScenes: train, val,
    mini_train, mini_val, all, or one of splits.json.
    """
    version: str | None = None
    """For nuScenes: the version, where the folder holds several."""
    sensor: str | None = None
    """For streets, KITTI, Boreas and sweeps: LiDAR and cameras, a name of `care-sim sensors` or a
    .toml file of a set-up.
    """
    camera_detections: Path | None = None
    """For nuScenes: a file with a camera detector's boxes, in nuScenes or COCO results form."""
    sweeps: int | None = None
    """For nuScenes: sweeps that a detector gets at a keyframe, 1 unless given: its own, and the
    last before it, fired by the mask of the keyframe before.
    """
    camera_times: str | None = None
    """For nuScenes: own (the default: each camera at the time of its picture) or sweep (all at the
    time of the sweep)."""
    empty_boxes: bool = False
    """For nuScenes and Argoverse 2: annotate boxes without a recorded point, too."""
    reference: Annotated[str | None, tyro.conf.arg(metavar="STR")] = None
    """For sweeps: the detector that annotates them, cluster unless given."""
    topics: tuple[str, ...] = ()
    """For bags: the topics of points and poses, where there are several."""

    def source_named(self, text: str) -> Source:
        """The source that a text and the options name. Raises InvalidInput where there is none."""
        # Of two with one name it is told which one plays.
        kind = text.partition(":")[0]
        report_problems([line for one, line in SOURCES.refusals() if one.name == kind])
        return source_of(text, **{name: getattr(self, name) for name in self.source_options()})

    def source_options(self) -> list[str]:
        """Those that are given."""
        given = {field.name: getattr(self, field.name) for field in fields(SourceOptions)}
        # By identity: 0 is equal to False, and a number that somebody gave.
        return [
            name
            for name, value in given.items()
            if not (value is None or value is False or value == ())
        ]


@dataclass(frozen=True, kw_only=True)
class PlayOptions(SourceOptions):
    """Options that all plays share."""

    source: str = "streets"
    """streets, argoverse2:FOLDER, nuscenes:FOLDER, kitti:FOLDER, sweeps:FOLDER, boreas, or a source
    of your own: the name of an installed one or MODULE:CLASS, of recordings with :FOLDER behind it.
    """
    detector: str = PROXY
    """returns (the paper's proxy), graded (the surer the more returns), cluster (a real
    one), pillars (a learned one), torchscript, the name of an installed one, or MODULE:CLASS.
    """
    detector_parameters: tuple[str, ...] = ()
    """Parameters of the detector as NAME=VALUE, for example file=model.pt for torchscript."""
    policy_parameters: tuple[str, ...] = ()
    """Parameters of the policies as NAME=VALUE, for example k_safe=0 for care-sbf; of one among
    several as POLICY.NAME=VALUE, for example ppo.path=weights.npz."""
    conditions: Annotated[Conditions, tyro.conf.arg(name="")] = _DEFAULT_CONDITIONS
    """Further conditions."""

    def scene_source(self) -> Source:
        """The source that the options name. Raises InvalidInput where there is none."""
        return self.source_named(self.source)

    def common(self, policies: Sequence[str]) -> dict[str, Any]:
        """Conditions and parameters that all plays share, as fields of
        `care_sim.study.play_config.PlayConfig`, of studies that play these policies. Raises
        InvalidInput for parameters of another one.
        """
        return asdict(self.conditions) | {
            "detector": self.detector,
            "detector_parameters": parameters(self.detector_parameters),
            "policy_parameters": policy_parameters(self.policy_parameters, policies),
        }
