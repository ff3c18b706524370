"""Options of commands that play before one's eyes, and of the lists."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Literal

import tyro

from care_sim.base.errors import InvalidInput
from care_sim.commands.options.shared import EpisodeOptions, RecordingOptions


@dataclass(frozen=True, kw_only=True)
class WatchOptions(RecordingOptions, EpisodeOptions):
    """Options of commands that show a play of either loop, and keep it in files."""

    scene: str | None = None
    """For a source of scenes: the name of the scene. Without it streets play that of the seed,
    recordings the first."""
    seed: int = 0
    """Seed of scenario, camera faults, noise and floor."""
    record: Path | None = None
    """File (.rrd) for a recording that `care-sim view FILE` plays (extra 'viewer'), several
    policies side by side."""
    video: Path | None = None
    """File for a clip, several policies side by side: MP4 (extra 'video'), or animated GIF, WebP or
    PNG, by its ending."""
    video_start: float | None = None
    """Start the clip this many seconds after the episode starts."""

    def check_closed(self) -> None:
        """Raise InvalidInput if an option of scenes is given, and no source is named."""
        for name in ("scene", *(field.name for field in fields(RecordingOptions))):
            if getattr(self, name) not in (None, ()):
                raise InvalidInput(f"--{name} has no meaning in the closed loop")


@dataclass(frozen=True, kw_only=True)
class Run(WatchOptions):
    """Play one episode and print its timeline and outcome.

    A trained agent plays where it learned, in the first of several environments and without drawn
    faults. The settings of its training count where an option has its default.
    """

    what: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO|SOURCE|AGENT")]
    """dartout, dense, cutin, ncap, r157, drive, that of an installed package, or MODULE:CLASS;
    `care-sim list scenarios` lists their parameters. For the open loop street, argoverse2:FOLDER,
    nuscenes:FOLDER, kitti:FOLDER, sweeps:FOLDER, boreas, or another of `care-sim list sources`. Or
    a trained agent: a folder of `care-sim train`, a file of weights, or a name of `care-sim list
    agents`."""
    scenario: str | None = None
    """For an agent: another scenario or source than that of its training. The settings of its
    training then do not count."""
    policy: str | None = None
    """`care-sim list policies` lists them; care unless given. `full` always runs with budget
    1.0."""
    budget: float | None = None
    """Share of the cells that may fire at a keyframe, above 0 and at most 1; 0.1 unless given, for
    an agent the first of its training."""
    picture: Path | None = None
    """PNG file for a picture of the first keyframe at which the car brakes; in the open loop, of
    the first at which somebody appears."""
    at: float | None = None
    """For --picture: the time that it shows, seconds from the start, instead of that moment."""
    view: bool = False
    """Open the viewer on the recording once the episode is played (extra 'viewer'); without
    --record it is runs/run.rrd."""
    export: Path | None = None
    """Folder for every scan as a point cloud (PCD), with poses and boxes as JSON (extra
    'open3d')."""


@dataclass(frozen=True, kw_only=True)
class Compare(WatchOptions):
    """Play one seed under several policies, side by side."""

    scenario: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO|SOURCE")]
    """dartout, dense, cutin, ncap, r157, drive, that of an installed package, or MODULE:CLASS;
    `care-sim list scenarios` lists their parameters. For the open loop street, argoverse2:FOLDER,
    nuscenes:FOLDER, kitti:FOLDER, sweeps:FOLDER, boreas, or another of `care-sim list sources`."""
    policies: tuple[str, ...] = ("history", "care")
    """Names of `care-sim list policies`; `all` stands for all but the controls. `full` always runs
    with budget 1.0."""
    budget: float = 0.1
    """Share of the cells that may fire at a keyframe, above 0 and at most 1."""


@dataclass(frozen=True, kw_only=True)
class View:
    """Open a recording in the Rerun viewer.

    It shows recordings of `run --record` or `compare --record` (extra 'viewer').

    The viewer needs no network. If there is one, the viewer looks for updates and counts its use,
    which `rerun analytics disable` ends, and its page in a browser fetches a font.
    """

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """The recording (.rrd)."""
    web: bool = False
    """Serve the recording to browsers of this machine instead. Ctrl-C ends it."""


@dataclass(frozen=True, kw_only=True)
class List:
    """List what can be named.

    Policies come with tags, parameters and sources, scenarios and sources with parameters, agents
    with where and how they learned. `care_sim.names(KIND)` gives the names in Python.
    """

    kind: tyro.conf.Positional[
        Literal["policies", "agents", "scenarios", "sources", "detectors", "sensors", "engines"]
    ]
    """The kind to list."""
