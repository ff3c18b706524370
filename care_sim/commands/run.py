"""`care-sim run`: one episode, its timeline and its outcome."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from care_sim.commands.shared.options import DEFAULT_OPTIONS, Options
from care_sim.commands.shared.study_command import console
from care_sim.envs.wrappers.export_scans import ExportScans
from care_sim.envs.wrappers.record_rerun import RecordRerun
from care_sim.policies.base import Policy
from care_sim.reports.episodes.clips import BrakePhoto, Clip
from care_sim.reports.episodes.timeline import print_timeline
from care_sim.study.episode_config import grid
from care_sim.study.episode_play import GymEnv, trace


@dataclass(frozen=True, kw_only=True)
class Run:
    """Play one episode and print its timeline and outcome."""

    scenario: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO")]
    """dartout, dense, cutin, ncap, r157, drive, that of an installed package, or MODULE:CLASS;
    `care-sim scenarios` lists their parameters.
    """
    policy: str = "care"
    """`care-sim policies` lists them. `full` always runs with budget 1.0."""
    budget: float = 0.1
    """Share of the cells that may fire at a keyframe, above 0 and at most 1."""
    seed: int = 0
    """Seed of scenario, camera faults, noise and floor."""
    picture: Path | None = None
    """PNG file for a picture of the first keyframe at which the car brakes."""
    video: Path | None = None
    """File for a clip of the episode: MP4 (extra 'video'), or animated GIF, WebP or PNG, by its
    ending.
    """
    record: Path | None = None
    """File (.rrd) for a recording that `care-sim view FILE` plays (extra 'viewer')."""
    export: Path | None = None
    """Folder for every scan as a point cloud (PCD), with poses and boxes as JSON (extra
    'open3d')."""
    conditions: Annotated[Options, tyro.conf.arg(name="")] = DEFAULT_OPTIONS
    """Further conditions."""

    def __call__(self) -> int:
        """Run it."""
        # Made as a grid of one, the configuration gets what `full` needs, as in a study.
        axes = ([self.scenario], [self.policy], [self.budget], [self.seed])
        (config,) = grid(*axes, **self.conditions.arguments([self.policy]))
        if config.budget != self.budget:
            print("full fires every cell, whatever the budget", file=sys.stderr)
        photographer = BrakePhoto(self.picture)
        film = Clip(self.video)
        print_timeline(
            config,
            *trace(config, photographer, film.episode(self.policy), wrap=self._watched),
            console(),
        )
        photographer.report()
        film.write()
        return 0

    def _watched(self, env: GymEnv, policy: Policy) -> GymEnv:
        """`env`, which is recorded and whose scans are written where files are given."""
        if self.record is not None:
            env = RecordRerun(env, self.record, policy)
        if self.export is not None:
            env = ExportScans(env, self.export, policy)
        return env
