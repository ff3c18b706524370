"""The command `care-sim export`: a policy's detections on nuScenes scenes, for the official devkit to score."""

import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from care_sim.errors import InvalidInput
from care_sim.study.options import pairs

if TYPE_CHECKING:
    from care_sim.sources.nuscenes.tables import Row
    from care_sim.sources.recordings import Recordings

REPLAY = "care_sim:CARE-Replay-v0"
DATABASE = ("split", "version", "camera_detections")
"""Options that say what is read of the source."""


@dataclass(frozen=True, kw_only=True)
class Export:
    """Play a policy over nuScenes scenes and write its detections in the results form of the official devkit."""

    source: str
    """nuscenes:FOLDER, the folder of a nuScenes v1.0 database."""
    split: str = "val"
    """Which scenes: val, one of splits.json in the folder of the version, or all."""
    version: str | None = None
    """Of several in the folder, for example v1.0-trainval."""
    camera_detections: Path | None = None
    """File of 2D detections on the pictures, in nuScenes or COCO results form; else annotations are projected."""
    policy: str = "care"
    """`care-sim policies` lists them. `full` always runs with budget 1.0."""
    policy_parameters: tuple[str, ...] = ()
    """Parameters of the policy as NAME=VALUE."""
    budget: float = 0.1
    """Share of the cells that may fire at a keyframe, above 0 and at most 1."""
    detector: str = "returns"
    """returns, cluster, torchscript or an installed one."""
    detector_parameters: tuple[str, ...] = ()
    """Parameters of the detector as NAME=VALUE, for example file=model.pt for torchscript."""
    floor_seed: int = 0
    """Which of the random floors of every scene."""
    out: Path
    """The results file, JSON."""

    def __call__(self) -> int:
        """Run it."""
        from rich.console import Console
        from rich.progress import track

        scenes = self._recordings().scenes()
        self.out.parent.mkdir(parents=True, exist_ok=True)
        shown = track(scenes, "scenes", console=Console(stderr=True), disable=not sys.stderr.isatty())
        results = {token: boxes for scene in shown for token, boxes in self._play(scene).items()}
        self.out.write_text(json.dumps({"meta": self._meta(), "results": results}), encoding="utf-8")
        count = sum(map(len, results.values()))
        print(f"{count} boxes in {len(results)} samples of {len(scenes)} scenes are in {self.out}")
        if not count:
            print("care-sim: the official devkit refuses results without a box", file=sys.stderr)
        return 0

    def _play(self, scene: str) -> "dict[str, list[Row]]":
        """The boxes of every sample of a scene, by token."""
        import gymnasium

        from care_sim.policies import make_policy
        from care_sim.sources.nuscenes.results_form import boxes

        with gymnasium.make(REPLAY, disable_env_checker=True, scene=scene, **self._environment()) as env:
            policy = make_policy(self.policy, env, **dict(pairs(self.policy_parameters)))
            observation, _ = env.reset(seed=0)
            policy.reset()
            over = False
            while not over:
                observation, _, _, over, _ = env.step(policy(observation))
            film, exposures = env.unwrapped.film, env.unwrapped.exposures  # type: ignore[attr-defined]
        shots = zip(film.shots, exposures, strict=True)
        return {shot.token: boxes(shot, exposure.detections, exposure.velocities) for shot, exposure in shots}

    def _meta(self) -> dict[str, Any]:
        """What the results form asks about their origin, and under `care_sim` what made them."""
        import care_sim
        from care_sim.sources.nuscenes.results_form import MODALITIES

        own = {name: value for name, value in asdict(self).items() if name not in ("source", "out")}
        own |= {"budget": self._budget, "camera_detections": self.camera_detections and self.camera_detections.name}
        return MODALITIES | {"care_sim": {"package": care_sim.__version__, **own}}

    @property
    def _budget(self) -> float:
        return 1.0 if self.policy == "full" else self.budget

    def _environment(self) -> dict[str, Any]:
        own = {name: getattr(self, name) for name in ("source", *DATABASE, "detector", "floor_seed")}
        return own | {"budget": self._budget, "detector_parameters": dict(pairs(self.detector_parameters))}

    def _recordings(self) -> "Recordings":
        from care_sim.sources.recordings import NuScenes, recordings

        if self.source.partition(":")[0] != NuScenes.kind:
            raise InvalidInput(
                f"source must be nuscenes:FOLDER, whose samples the official form names, got {self.source!r}"
            )
        return recordings(self.source, {name: getattr(self, name) for name in DATABASE})
