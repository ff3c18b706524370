"""`care-sim run`: one episode, its timeline and its outcome."""

import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import tyro

from care_sim.commands.shared.one_scene import SceneOptions, is_source, scene_plays
from care_sim.commands.shared.options import DEFAULT_OPTIONS, Options
from care_sim.commands.shared.study_command import console
from care_sim.commands.shared.written_files import finish_files
from care_sim.envs.wrappers.export_scans import ExportScans
from care_sim.envs.wrappers.record_rerun import RecordRerun
from care_sim.policies.base import Policy
from care_sim.reports.episodes.clips import Clip
from care_sim.reports.episodes.photos import Photo
from care_sim.reports.episodes.timeline import episode_timeline, scene_timeline
from care_sim.study.episode_config import grid
from care_sim.study.episode_play import GymEnv, trace
from care_sim.study.scene_trace import trace_scene


@dataclass(frozen=True, kw_only=True)
class Watched(SceneOptions):
    """Of one episode or scene: its seed, what is kept of it, and the conditions."""

    seed: int = 0
    """Seed of scenario, camera faults, noise and floor."""
    picture: Path | None = None
    """PNG file for a picture of the first keyframe at which the car brakes; of the open loop, of
    the first at which somebody appears.
    """
    at: float | None = None
    """Of --picture: the time that it shows, seconds from the start, instead of that moment."""
    video: Path | None = None
    """File for a clip of the episode: MP4 (extra 'video'), or animated GIF, WebP or PNG, by its
    ending.
    """
    video_start: float | None = None
    """Start the clip this many seconds after the episode starts."""
    record: Path | None = None
    """File (.rrd) for a recording that `care-sim view FILE` plays (extra 'viewer')."""
    export: Path | None = None
    """Folder for every scan as a point cloud (PCD), with poses and boxes as JSON (extra
    'open3d')."""
    conditions: Annotated[Options, tyro.conf.arg(name="")] = DEFAULT_OPTIONS
    """Further conditions."""


@dataclass(frozen=True, kw_only=True)
class Run(Watched):
    """Play one episode and print its timeline and outcome."""

    scenario: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO")]
    """dartout, dense, cutin, ncap, r157, drive, that of an installed package, or MODULE:CLASS;
    `care-sim scenarios` lists their parameters. For the open loop street, argoverse2:FOLDER,
    nuscenes:FOLDER, kitti:FOLDER, sweeps:FOLDER, boreas, or another of `care-sim sources`.
    """
    policy: str = "care"
    """`care-sim policies` lists them. `full` always runs with budget 1.0."""
    budget: float = 0.1
    """Share of the cells that may fire at a keyframe, above 0 and at most 1."""

    def __call__(self) -> int:
        """Run it."""
        if is_source(self.scenario):
            return self._play_scene()
        self.check_unused()
        # Made as a grid of one, the configuration gets what `full` needs, as in a study.
        axes = ([self.scenario], [self.policy], [self.budget], [self.seed])
        (config,) = grid(*axes, **self.conditions.arguments([self.policy]))
        if config.budget != self.budget:
            print("full fires every cell, whatever the budget", file=sys.stderr)
        photo = Photo(self.picture, self.at)
        film = Clip(self.video, self.video_start)
        played = trace(config, film.episode(self.policy), wrap=partial(self._watched, photo))
        film.show_outcome(played[0])
        episode_timeline(config, *played).print(console())
        photo.report()
        finish_files(self.record, film, self.video)
        return 0

    def _play_scene(self) -> int:
        """The same of a scene of the open loop."""
        given = self.conditions.arguments([self.policy])
        source = self.source(self.scenario, self.conditions.sensor)
        scene = self.scene_of(source, self.seed)
        (config,) = scene_plays(source, scene, [self.policy], self.budget, given)
        if config.budget != self.budget:
            print("full fires every cell, whatever the budget", file=sys.stderr)
        photo = Photo(self.picture, self.at)
        film = Clip(self.video, self.video_start)
        wrap = partial(self._watched, photo)
        played = trace_scene(config, config.film(), film.episode(self.policy), wrap=wrap)
        scene_timeline(config, played).print(console())
        photo.report()
        finish_files(self.record, film, self.video)
        return 0

    def _watched(self, photo: Photo, env: GymEnv, policy: Policy) -> GymEnv:
        """`env`, which is recorded and whose scans are written where files are given."""
        if self.record is not None:
            env = RecordRerun(env, self.record, policy)
        if self.export is not None:
            env = ExportScans(env, self.export, policy)
        return photo.watching(env, policy)
