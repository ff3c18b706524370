"""The command of the paper's first-sighting protocol (Secs. 3 and 5)."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from care_sim.conditions import Conditions
from care_sim.errors import InvalidInput, check_whole
from care_sim.study.options import parameters
from care_sim.study.running import Running, in_turn, playable

USUAL = Conditions()
"""The defaults."""
EIGHT = (
    "history",
    "history-uniform",
    "all-camera",
    "uncertainty",
    "beam-reduce",
    "random",
    "care",
    "care-sbf",
)
"""Those of the paper's Sec. 5.1 that need no training, and the floor alone."""


@dataclass(frozen=True, kw_only=True)
class Protocol(Running):
    """Play the paper's first-sighting protocol: every policy over the same keyframes, on streets or recordings."""

    source: str = "streets"
    """streets, argoverse2:FOLDER or nuscenes:FOLDER."""
    scenes: tuple[str, ...] = ()
    """One number: that many scenes, from the first. Else scenes by name. All of them, unless given."""
    policies: tuple[str, ...] = EIGHT
    """`care-sim policies` lists them; `all`. `full` always runs with budget 1.0."""
    budgets: tuple[float, ...] = (0.1, 0.2, 0.35)
    """Shares of the cells that may fire at a keyframe, above 0 and at most 1."""
    floor_seeds: int = 3
    """So many random floors, over which each scene's tallies are averaged."""
    detector: str = "returns"
    """returns (the paper's proxy), cluster (a real one), torchscript, or that of an installed package."""
    detector_parameters: tuple[str, ...] = ()
    """Parameters of the detector as NAME=VALUE."""
    policy_parameters: tuple[str, ...] = ()
    """Parameters of the policy as NAME=VALUE, for example k_safe=0 for care-sbf."""
    camera_latencies: tuple[int, ...] = ()
    """Several of --camera-latency, in turn; 1 is the paper's strict-causal variant."""
    split: str | None = None
    """Of streets: evaluation (150 scenes) or calibration (20). Of nuScenes: val, all, or one of splits.json."""
    version: str | None = None
    """Of nuScenes: the version, where the folder holds several."""
    camera_detections: Path | None = None
    """Of nuScenes: a file with a camera detector's boxes, in nuScenes or COCO results form."""
    out: Path = Path("runs/protocol")
    """Folder of the results; an interrupted run goes on there."""
    conditions: Annotated[Conditions, tyro.conf.arg(name="")] = USUAL
    """Further conditions."""

    def __call__(self) -> int:
        """Run it."""
        from care_sim.study.play_config import play_grid
        from care_sim.study.scenes import chosen, source_of

        check_whole("floor_seeds", self.floor_seeds, 1)
        source = source_of(
            self.source, split=self.split, version=self.version, camera_detections=self.camera_detections
        )
        scenes, common = chosen(source.scenes(), self.scenes), self._common()
        latencies = in_turn(self.camera_latencies, "camera_latency", common)
        first = common.pop("floor_seed")
        policies, left_out = playable(
            self.policies, lambda name: play_grid(source, scenes[:1], [name], self.budgets[:1], **common)
        )
        if not policies:
            raise InvalidInput("none of the policies can be played")
        floors = range(first, first + self.floor_seeds)
        configs = play_grid(source, scenes, policies, self.budgets, floors, latencies, **common)
        return self.conduct("protocol", configs, self.out, left_out)

    def _common(self) -> dict[str, Any]:
        """What all plays share, as fields of `PlayConfig`."""
        return asdict(self.conditions) | {
            "detector": self.detector,
            "detector_parameters": parameters(self.detector_parameters),
            "policy_parameters": parameters(self.policy_parameters),
        }
