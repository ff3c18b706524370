"""Options of the studies that have a command of their own, and what all studies share."""

from collections.abc import Collection
from dataclasses import dataclass, fields

from care_sim.base.bounds import bounded
from care_sim.base.errors import InvalidInput
from care_sim.commands.options.shared import (
    EpisodeOptions,
    PlayOptions,
    SourceOptions,
    StudyOptions,
)

_PAPER_POLICIES = (
    "history",
    "history-uniform",
    "all-camera",
    "uncertainty",
    "beam-reduce",
    "random",
    "care",
    "care-sbf",
    "learned-scorer",
)
"""The policies of the paper's Sec. 5.1, and `random`, the floor alone."""
_CONTROLS = ("rows", "place")
"""The best patterns without a camera."""


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

    def check_loop(self, closed: Collection[str], opened: Collection[str]) -> None:
        """Raise InvalidInput for an option of the other loop: those named `closed` have no meaning
        in the open loop, those of the source and those named `opened` none in the closed loop.
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
    """With --source: shares of the cells that may fire at a keyframe, above 0 and at most 1."""
    floor_seeds: int = bounded(1, 1, 1000)
    """With --source: number of random floors, over which the counts of a scene are averaged."""


@dataclass(frozen=True, kw_only=True)
class Reproduce(FixedStudy):
    """Play the paper's study and print it beside the paper's figures.

    It has 49 configurations per seed, and those of --also.
    """


@dataclass(frozen=True, kw_only=True)
class Sweep(EpisodeStudy, EpisodeOptions):
    """Play every combination of scenarios, policies, budgets, faults.

    Each is played on every seed.
    """

    scenarios: tuple[str, ...] = ("dartout", "dense", "cutin")
    """Names of `care-sim list scenarios`, or MODULE:CLASS; `all` stands for all that have a
    name."""
    policies: tuple[str, ...] = ("history", "all-camera", "care", "care-sightlines", "fan", "full")
    """Names of `care-sim list policies`; `all` stands for all but the controls. `full` always runs
    with budget 1.0."""
    budgets: tuple[float, ...] = (0.1,)
    """Shares of the cells that may fire at a keyframe, above 0 and at most 1."""
    false_negative_rates: tuple[float, ...] = ()
    """Several values of --false-negative-rate, in turn."""
    camera_latencies: tuple[int, ...] = ()
    """Several values of --camera-latency, in turn."""


@dataclass(frozen=True, kw_only=True)
class Protocol(StudyOptions, PlayOptions):
    """Play the first-sighting protocol, on streets or recordings.

    Every policy plays over the same keyframes.
    """

    scenes: tuple[str, ...] = ()
    """One number: that many scenes, from the first. Otherwise names of scenes. Without this option,
    all scenes."""
    policies: tuple[str, ...] = (*_PAPER_POLICIES, "care-sightlines", *_CONTROLS, "full")
    """Names of `care-sim list policies`; `all` stands for all but the controls. `full` always runs
    with budget 1.0. Allocations are compared with those of `care`, which always plays for that."""
    budgets: tuple[float, ...] = (0.1, 0.2, 0.35)
    """Shares of the cells that may fire at a keyframe, above 0 and at most 1."""
    floor_seeds: int = bounded(3, 1, 1000)
    """Number of random floors, over which the counts of a scene are averaged."""
    camera_latencies: tuple[int, ...] = ()
    """Several values of --camera-latency, in turn; 1 is the paper's strict-causal variant."""
    presence: str = "annotated"
    """Objects that are present at scene start are never first sightings. `annotated`: all that are
    annotated there are present (the paper's rule). `visible`: only those that are visible there
    are: an object hidden at the start counts when it first shows."""
