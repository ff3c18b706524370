"""Options of the studies."""

from collections.abc import Collection
from dataclasses import dataclass, fields
from typing import Annotated

import tyro

from care_sim.base.checks import bounded
from care_sim.base.errors import InvalidInput
from care_sim.commands.options.shared import (
    EpisodeOptions,
    GridOptions,
    SceneOptions,
    SensingOptions,
    SourceOptions,
    StudyOptions,
)
from care_sim.core.conditions import FIXED
from care_sim.study.designs.defaults import (
    FILM_BUDGETS,
    FILM_POLICIES,
    FIRING_POLICIES,
    NCAP_BUDGETS,
    NCAP_POLICIES,
    NCAP_STEP_KPH,
    ORDERED_POLICIES,
    PROTOCOL_POLICIES,
    R157_BUDGETS,
    R157_POLICIES,
)


@dataclass(frozen=True, kw_only=True)
class EpisodeStudy(StudyOptions):
    """A study of the closed loop."""

    seeds: tuple[int, ...] = (5,)
    """One number: that many seeds, from 0. Several numbers: these seeds, of one split; 7 7 is seed
    7 alone."""


@dataclass(frozen=True, kw_only=True)
class FixedStudy(EpisodeStudy):
    """A study whose episodes are fixed, except for the seeds and for further policies."""

    also: tuple[str, ...] | None = None
    """Further policies, installed ones too, that are played and shown beside those of the study.
    Without this option, in the closed loop, the control `fan`; with no name after it, none."""


@dataclass(frozen=True, kw_only=True)
class EitherLoopStudy(FixedStudy, SourceOptions):
    """A study of the closed loop, or with `source` of the open loop."""

    source: str | None = None
    """Play the open loop instead, on streets, argoverse2:FOLDER, nuscenes:FOLDER, kitti:FOLDER,
    sweeps:FOLDER, boreas, or a source of your own: the name of an installed one or MODULE:CLASS,
    with :FOLDER for recordings."""
    scenes: tuple[str, ...] = ()
    """With --source. One number: that many scenes, from the first. Otherwise names of scenes.
    Without this option, all scenes of the study."""
    budgets: tuple[float, ...] = ()
    """With --source: shares of the cells that may fire at a keyframe, above 0 and at most 1."""

    def check_loop(self, closed: Collection[str], opened: Collection[str]) -> None:
        """Raise InvalidInput for an option of the other loop. Options in `closed` have no meaning
        in the open loop. Options in `opened` and those of the source have none in the closed loop.
        """
        of_scenes = {"scenes", *(field.name for field in fields(SourceOptions)), *opened}
        foreign, word = (closed, "with") if self.source else (of_scenes, "without")
        for field in fields(self):
            if field.name in foreign and getattr(self, field.name) != field.default:
                option = field.name.replace("_", "-")
                raise InvalidInput(f"--{option} has no meaning {word} --source")


@dataclass(frozen=True, kw_only=True)
class ProtocolVariants(EitherLoopStudy):
    """The paper's closed-loop study in several variants, with `source` the first-sighting protocol
    in the same ones.
    """

    policies: tuple[str, ...] = ()
    """With --source: names of `care-sim list policies`; `all` stands for all but the controls.
    `full` always runs with budget 1.0."""
    budgets: tuple[float, ...] = (0.03, 0.05, 0.1)
    floor_seeds: int = bounded(1, 1, 1000)
    """With --source: number of random floors, over which the counts of a scene are averaged."""


@dataclass(frozen=True, kw_only=True)
class Reproduce(FixedStudy):
    """Play the paper's study and print it beside the paper's figures.

    It has 49 configurations per seed, and those of --also.
    """


@dataclass(frozen=True, kw_only=True)
class Sweep(EpisodeStudy, EpisodeOptions, GridOptions):
    """Play every combination of scenarios, policies, budgets, faults.

    Each is played on every seed.
    """

    scenarios: tuple[str, ...] = ("dartout", "dense", "cutin")
    """Names of `care-sim list scenarios`, or MODULE:CLASS; `all` stands for all that have a
    name."""
    policies: tuple[str, ...] = ("history", "all-camera", "care", "care-sightlines", "fan", "full")
    budgets: tuple[float, ...] = (0.1,)
    false_negative_rates: tuple[float, ...] = ()
    """Several values of --false-negative-rate, in turn."""
    camera_latencies: tuple[int, ...] = ()
    """Several values of --camera-latency, in turn."""


@dataclass(frozen=True, kw_only=True)
class Protocol(StudyOptions, SceneOptions, GridOptions):
    """Play the first-sighting protocol, on streets or recordings.

    Every policy plays over the same keyframes; allocations are compared with those of `care`, which
    always plays for that.
    """

    policies: tuple[str, ...] = PROTOCOL_POLICIES
    budgets: tuple[float, ...] = (0.1, 0.2, 0.35)
    floor_seeds: int = bounded(3, 1, 1000)
    """Number of random floors, over which the counts of a scene are averaged."""
    camera_latencies: tuple[int, ...] = ()
    """Several values of --camera-latency, in turn; 1 is the paper's strict-causal variant."""
    presence: str = "annotated"
    """Objects that are present at scene start are never first sightings. `annotated`: all that are
    annotated there are present (the paper's rule). `visible`: only those that are visible there
    are: an object hidden at the start counts when it first shows."""


@dataclass(frozen=True, kw_only=True)
class Ablate(EitherLoopStudy):
    """Vary one thing at a time, as the paper's ablations do.

    One table per thing varied; with --source in the open loop, on a quarter of the scenes.
    """

    budgets: tuple[float, ...] = (0.1, 0.2, 0.35)


@dataclass(frozen=True, kw_only=True)
class Order(ProtocolVariants):
    """Play the paper's study under every order of cells in a set.

    Play 279 configurations per seed and those of --also, or with --source the first-sighting
    protocol, and list what the paper says order by order.
    """

    policies: tuple[str, ...] = ORDERED_POLICIES


@dataclass(frozen=True, kw_only=True)
class Firing(ProtocolVariants):
    """Show what a LiDAR that fires tiles, rows or a window decides.

    Play the dense street under every hardware, or with --source the first-sighting protocol, and
    compare a policy that knows its hardware with one whose demand is projected.

    Units that do not divide the grid of a set-up are left out, as are the study's policies with
    weights of another grid; a line names each.
    """

    sensors: tuple[str, ...] = ("hdl-32e",)
    """Without --source: names of `care-sim list sensors` or .toml files of set-ups."""
    policies: tuple[str, ...] = FIRING_POLICIES


@dataclass(frozen=True, kw_only=True)
class Realism(ProtocolVariants):
    """Show which orders of policies a real car's sensing keeps.

    Play the headline tables under the conditions of a real car, with --source that of first
    sightings, and say which orders of policies hold, are lost or flip. Drives play the seeds 100
    further on, Euro NCAP tests the first seed alone. A line names each condition that is left out,
    since a budget, a set-up or a recording does not allow it.
    """

    seeds: tuple[int, ...] = (10,)
    tables: tuple[str, ...] = ("all",)
    """Without --source: which headline tables are played, of dartout-10, dense-3, dense-5,
    cutin-10, ncap-1, ncap-3 and drive-1 (scenario and budget); `all` stands for all of them. A
    quick look is --tables dense-3 --seeds 1."""
    also: tuple[str, ...] | None = ()
    """Further policies, installed ones too, that are played beside those of the headline tables."""
    policies: tuple[str, ...] = FILM_POLICIES
    budgets: tuple[float, ...] = FILM_BUDGETS


@dataclass(frozen=True, kw_only=True)
class Faults(FixedStudy, SensingOptions):
    """Let every fault grow until the order of the policies changes.

    The conditions are those that all episodes share, beside the fault that grows.
    """


@dataclass(frozen=True, kw_only=True)
class Crowding(FixedStudy):
    """Fill the dense street until the all-camera reserve collapses."""


@dataclass(frozen=True, kw_only=True)
class Ncap(EpisodeStudy, SensingOptions, GridOptions):
    """Play the Euro NCAP tests: avoided, mitigated or hit; a score."""

    seeds: tuple[int, ...] = (10,)
    tests: tuple[str, ...] = ("all",)
    """Names of tests, as on the page of CARE-NCAP-v0; `all` stands for all of them."""
    policies: tuple[str, ...] = NCAP_POLICIES
    budgets: tuple[float, ...] = NCAP_BUDGETS
    step_kph: float = bounded(NCAP_STEP_KPH, 5, 50)
    """Plays the protocols' speeds that are multiples of this; 5 plays them all."""


@dataclass(frozen=True, kw_only=True)
class R157(EpisodeStudy, GridOptions):
    """Play the preventable cut-ins of UN Regulation 157.

    These are the cut-ins that the regulation's careful human driver prevents.
    """

    seeds: tuple[int, ...] = (1,)
    policies: tuple[str, ...] = R157_POLICIES
    budgets: tuple[float, ...] = R157_BUDGETS
    every: int = bounded(1, 1, 100)
    """Plays one of N preventable cases of the grid, by a fixed lot: 3 plays 127 of the 379."""
    driver: str = FIXED
    """fixed, or careful-human: the regulation's driver at the wheel."""


@dataclass(frozen=True, kw_only=True)
class Validate(EpisodeStudy, SensingOptions):
    """Say whether a world tells good policies from lucky ones.

    A world discriminates if a camera leads the best control, a full scan leaves something to win,
    and the reserves differ.
    """

    world: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="WORLD")]
    """dartout, dense, cutin, that of an installed package, or MODULE:CLASS; `care-sim list
    scenarios` lists them."""
    seeds: tuple[int, ...] = (20,)
    """The test seeds. One number: that many, from 0. Several numbers: these, below 1,000; 7 7 is
    seed 7 alone."""
    training_seeds: int = bounded(10, 1, 1000)
    """Number of training seeds, from 10,000 on: they choose the best, and teach places."""
    budgets: tuple[float, ...] = (0.01, 0.03, 0.1)
    """Shares of the cells that may fire at a keyframe, above 0 and at most 1."""
    scenario_parameters: tuple[str, ...] = ()
    """Physics of the world as NAME=VALUE, a range as NAME=LOW,HIGH; see `care-sim list
    scenarios`."""
    factors: tuple[str, ...] = ()
    """Further worlds, each with one parameter changed, as NAME=VALUE: for example mirrored=drawn
    ego_speed_mps=12.2,12.8."""


@dataclass(frozen=True, kw_only=True)
class Mechanism(StudyOptions, SceneOptions):
    """Find why one policy finds what another misses, ray by ray.

    Policies are compared on one shared belief, on streets or recordings. The driver and `full`
    always play.
    """

    policies: tuple[str, ...] = ("history", "all-camera", "care")
    """Names of `care-sim list policies`; `all` stands for all but the controls."""
    driver: str = "care"
    """The policy that plays where the others are asked: the belief is its own."""
    budget: float = 0.1
    """Share of the cells that may fire at a keyframe, above 0 and at most 1."""
    presence: str = "annotated"
    """As in `care-sim protocol`: who is present at scene start, and so no first sighting."""


@dataclass(frozen=True, kw_only=True)
class Vehicle(FixedStudy):
    """Play late evidence, a failing camera, a wrong pose.

    Late evidence in turns, a camera that fails during a drive, a pose that is not exact.
    """

    also: tuple[str, ...] | None = ()
    """Further policies, installed ones too, that are played beside those of the study; not
    care-sbf, full or all-camera, which the study plays in part."""
