"""The commands that play episodes: frozen dataclasses whose fields are their options.

What imports the simulator or draws is imported by the command that needs it: help stays quick.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from care_sim.base.bounds import bounded, check_fields
from care_sim.base.checks import LARGEST_INTEGER
from care_sim.base.errors import InvalidInput, report_problems
from care_sim.commands.shared.options import USUAL, Options, seeds_of
from care_sim.commands.shared.running import Running, console, in_turn, playable
from care_sim.study.executors import CORES, MOST_WORKERS

if TYPE_CHECKING:
    from care_sim.policies.base import Policy
    from care_sim.study.episode_config import EpisodeConfig
    from care_sim.study.episode_play import Environment

    Configurations = Callable[[Sequence[int], Sequence[str]], Sequence[EpisodeConfig]]


@dataclass(frozen=True, kw_only=True)
class Run:
    """Play one episode and print its timeline and outcome."""

    scenario: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO")]
    """dartout, dense or cutin; `care-sim scenarios` lists them."""
    policy: str = "care"
    """`care-sim policies` lists them. `full` always runs with budget 1.0."""
    budget: float = 0.1
    """Share of the cells that may fire at a keyframe, above 0 and at most 1."""
    seed: int = 0
    """Draws scenario, camera faults, noise and floor."""
    picture: Path | None = None
    """PNG file for a picture of the first keyframe at which the brake is on."""
    video: Path | None = None
    """File for a clip of the episode: MP4 (extra 'video'), or animated GIF, WebP or PNG, by its ending."""
    record: Path | None = None
    """File (.rrd) for a recording that `care-sim view FILE` plays (extra 'viewer')."""
    export: Path | None = None
    """Folder for every scan as a point cloud (PCD), with poses and boxes as JSON (extra 'open3d')."""
    conditions: Annotated[Options, tyro.conf.arg(name="")] = USUAL
    """Further conditions."""

    def __call__(self) -> int:
        """Run it."""
        from care_sim.reports.episodes.brake_photo import Photographer
        from care_sim.reports.episodes.clips import Film
        from care_sim.reports.episodes.timeline import print_timeline
        from care_sim.study.episode_config import grid
        from care_sim.study.episode_play import trace

        axes = ([self.scenario], [self.policy], [self.budget], [self.seed])
        (config,) = grid(*axes, **self.conditions.arguments())
        if config.budget != self.budget:
            print("full fires every cell, whatever the budget", file=sys.stderr)
        photographer, film = Photographer(self.picture), Film(self.video)
        print_timeline(config, *trace(config, photographer, film.episode(self.policy), wrap=self._watched), console())
        photographer.report()
        film.write()
        return 0

    def _watched(self, env: "Environment", policy: "Policy") -> "Environment":
        """`env`, recorded and its scans written where that is wanted."""
        if self.record is not None:
            from care_sim.envs.wrappers.record_rerun import RecordRerun

            env = RecordRerun(env, self.record, policy)
        if self.export is not None:
            from care_sim.envs.wrappers.export_scans import ExportScans

            env = ExportScans(env, self.export, policy)
        return env


@dataclass(frozen=True, kw_only=True)
class _Study(Running):
    seeds: tuple[int, ...] = (5,)
    """One number: that many seeds, from 0. Several: these seeds."""


@dataclass(frozen=True, kw_only=True)
class Sweep(_Study):
    """Play every combination of scenarios, policies, budgets, faults and seeds."""

    scenarios: tuple[str, ...] = ("dartout", "dense", "cutin")
    """`care-sim scenarios` lists them; `all`."""
    policies: tuple[str, ...] = ("history", "all-camera", "care", "full")
    """`care-sim policies` lists them; `all`, but for controls. `full` always runs with budget 1.0."""
    budgets: tuple[float, ...] = (0.1,)
    """Shares of the cells that may fire at a keyframe, above 0 and at most 1."""
    false_negative_rates: tuple[float, ...] = ()
    """Several of --false-negative-rate, in turn."""
    camera_latencies: tuple[int, ...] = ()
    """Several of --camera-latency, in turn."""
    out: Path = Path("runs/sweep")
    """Folder of the results; an interrupted sweep goes on there."""
    conditions: Annotated[Options, tyro.conf.arg(name="")] = USUAL
    """Further conditions."""

    def __call__(self) -> int:
        """Run it."""
        from care_sim.commands.shared.selection import expanded
        from care_sim.scenarios import SCENARIOS
        from care_sim.study.episode_config import grid

        for axis in ("scenarios", "policies", "budgets", "seeds"):
            if not getattr(self, axis):
                raise InvalidInput(f"--{axis.replace('_', '-')} needs at least one value")
        scenarios, common = expanded(self.scenarios, SCENARIOS), self.conditions.arguments()
        policies, left_out = playable(
            self.policies, lambda name: grid(scenarios, [name], self.budgets[:1], [0], **common)
        )
        if not policies:
            raise InvalidInput("none of the policies can be played")
        rates = in_turn(self.false_negative_rates, "false_negative_rate", common)
        latencies = in_turn(self.camera_latencies, "camera_latency", common)
        configs = grid(scenarios, policies, self.budgets, seeds_of(self.seeds), rates, latencies, **common)
        return self.conduct("sweep", configs, self.out, left_out)


@dataclass(frozen=True, kw_only=True)
class _SetStudy(_Study):
    """A study whose episodes are set, but for the seeds and for policies that join in."""

    also: tuple[str, ...] = ()
    """Further policies, installed ones too, that are played and shown beside those of the study."""

    def play(self, study: str, configurations: "Configurations", out: Path) -> int:
        """Play the configurations of the seeds, with the policies that join in."""
        from care_sim.scenarios import SCENARIOS
        from care_sim.study.episode_config import grid, of_seeds

        seeds = seeds_of(self.seeds)
        also, left_out = playable(self.also, lambda name: grid(SCENARIOS, [name], [0.1], [0]))
        return self.conduct(study, of_seeds(configurations(seeds[:1], also), seeds), out, left_out)


@dataclass(frozen=True, kw_only=True)
class Reproduce(_SetStudy):
    """Play the paper's closed-loop study, 49 configurations a seed, and print it beside the paper's figures."""

    out: Path = Path("runs/reproduce")
    """Folder of the results; an interrupted study goes on there."""

    def __call__(self) -> int:
        """Run it."""
        from care_sim.study.designs.paper import configurations

        return self.play("paper", configurations, self.out)


@dataclass(frozen=True, kw_only=True)
class Ablate(_SetStudy):
    """Vary one thing at a time as the paper's ablations do, 162 configurations a seed: a table each."""

    out: Path = Path("runs/ablate")
    """Folder of the results; an interrupted study goes on there."""

    def __call__(self) -> int:
        """Run it."""
        from care_sim.reports.tables.ablations import configurations

        return self.play("ablate", configurations, self.out)


@dataclass(frozen=True, kw_only=True)
class Faults(_SetStudy):
    """Let every fault grow and find where the order of the policies changes, 318 configurations a seed."""

    out: Path = Path("runs/faults")
    """Folder of the results; an interrupted study goes on there."""

    def __call__(self) -> int:
        """Run it."""
        from care_sim.reports.tables.faults import configurations

        return self.play("faults", configurations, self.out)


@dataclass(frozen=True, kw_only=True)
class Crowding(_SetStudy):
    """Find where the all-camera reserve collapses as vehicles fill the dense street, 221 configurations a seed."""

    out: Path = Path("runs/crowding")
    """Folder of the results; an interrupted study goes on there."""

    def __call__(self) -> int:
        """Run it."""
        from care_sim.reports.tables.crowding import configurations

        return self.play("crowding", configurations, self.out)


@dataclass(frozen=True, kw_only=True)
class Report:
    """Print the tables of a folder of results and draw its figures again, or make one web page of it all."""

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")]
    """The --out of an earlier study."""
    page: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """HTML file for the page, which needs nothing else to be read; the folder is left as it is (extra 'page')."""
    episodes: int = bounded(400, 0, LARGEST_INTEGER)
    """The most episodes that are played again to be watched in the page, seed by seed; 0 for none."""
    workers: int = bounded(CORES, 1, MOST_WORKERS)
    """Processes that play them."""

    def __post_init__(self) -> None:
        check_fields(self)

    def __call__(self) -> int:
        """Run it."""
        return self._print() if self.page is None else self._write(self.page)

    def _print(self) -> int:
        from care_sim.reports.report import print_report, reported, write_report

        rows, study, left_out = reported(self.folder)
        print_report(rows, console(), study, left_out)
        write_report(rows, self.folder, study, left_out)
        return 0

    def _write(self, path: Path) -> int:
        from care_sim.base.extras import check_page

        check_page()
        from care_sim.base.text import counted
        from care_sim.reports.page.build import write_page

        page = write_page(self.folder, path, self.episodes, self.workers)
        report_problems(page.warnings)
        print(f"{path}: {path.stat().st_size / 1e6:.1f} MB, {counted(page.watchable, 'episode')} to watch")
        return 0
