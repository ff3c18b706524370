"""Records of an episode for the scoring: one per keyframe, and the outcome."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.grid import Cells
from care_sim.world.approach import Impact


@dataclass(frozen=True)
class Sight:
    """One of the bodies that a drive lets the ego meet, at a scan."""

    distance_m: float
    """From the sensor to its centre, in the plane."""
    in_view: bool
    """Whether the unimpaired cameras show it."""
    detected: bool
    """Whether the detector reported it."""


@dataclass(frozen=True)
class Keyframe:
    """The record of one keyframe of the closed loop, from which every metric is computed.

    Scoring only: it holds truth. The first-sighting actor is the subject of the episode. Without
    one, distances are inf.
    """

    index: int
    """The number of the keyframe, from 0."""
    time_s: float
    """Time of the scan, seconds from the start."""
    fired: Cells
    """(n,) the cells that were fired, ascending; one that was fired several times stands there as
    often."""
    in_view: bool
    """Whether the unimpaired camera shows the first-sighting actor at the scan."""
    detected: bool
    """Whether the detector reported that actor."""
    braking: bool
    """Whether the brake was on after this scan."""
    speed_mps: float
    """The car's true speed at the scan."""
    distance_m: float
    """From the sensor to the actor's centre at the scan, in the plane."""
    nearest_m: float
    """Least distance from the car's centre to the actor's until the next keyframe."""
    clearance_m: float
    """Least distance between their hulls until the next keyframe, below 0 where they overlap."""
    impact_speed_mps: float | None
    """The car's own speed at its first contact with any body until the next keyframe, else None."""
    impact: Impact | None = None
    """The contact at which `impact_speed_mps` was measured."""
    sights: tuple[Sight, ...] = ()
    """Sights of `World.meetings`, in their order."""
    needless: bool = False
    """Whether the brake was on with nothing to brake for; see `care_sim.loops.needless`. Judged in
    drives alone.
    """
    unfounded: bool = False
    """Whether the brake was on for what a detector made up; see `care_sim.loops.needless`. Always
    False with the paper's proxy, which reports bodies alone.
    """


@dataclass(frozen=True)
class Outcome:
    """The result of an episode of the closed loop.

    An episode whose actor is never detected is censored: its detection distance is not known, only
    the most that it can have been.
    """

    detection_distance_m: float | None
    """From the sensor to the first-sighting actor's centre, in the plane, at the first keyframe at
    which it is detected; None if it never is.
    """
    undetected_to_m: float | None
    """The least distance at which a scan missed an actor that is never detected, since it came into
    view, or in the whole episode if it never did. The detection distance is at most this. None if
    the actor is detected or there is none.
    """
    braked: bool
    """Whether the brake was on at any keyframe."""
    min_distance_m: float | None
    """Least distance from the car's centre to the actor's from the first keyframe at which the
    camera has it in view; None if it never comes into view.
    """
    clearance_m: float | None
    """Least distance between their hulls over the same time, below 0 where they overlap."""
    collision: bool
    """Whether the car touched any body."""
    impact_speed_mps: float | None
    """The car's own speed at its first contact with any body, None without a collision."""
    rays_fired: int
    """Shots fired in all; of all hardware but `energy` these are cells."""
    braked_before_view: bool
    """Whether the brake was on for what the detector made up (`Keyframe.unfounded`) before the
    camera first had the actor in view, or at any keyframe if it never had. Such a stop is needless,
    and what the car avoids by it is no merit.
    """
    closing_speed_mps: float | None
    """The magnitude of the difference of the two velocities at that contact."""
    hit_kind: str | None
    """The kind of the body that the car touched, None without a collision."""
    hit_at_front: bool | None
    """Whether the car ran into it. Else it ran into the car."""


@dataclass(frozen=True)
class EncounterOutcome:
    """Result of one planned encounter of a drive."""

    who: str
    """Kind in the catalogue of bodies."""
    side: str
    """Side from which it comes, "left" or "right"."""
    along_m: float
    """Position of its line on the route."""
    way: str
    """Shape of the route where it comes into view: "straight", "bend" or "turn"."""
    course: str
    """Result without braking: "conflict", "near-miss" or "stop"."""
    occluder: str
    """Kind of the body that hides it."""
    occluder_reported: bool
    """Whether perception knows the occluder's class."""
    set_off: bool
    """Whether it came out. It stays hidden if other traffic would hit it, or if the ego never comes
    near."""
    view_keyframe: int | None
    """First keyframe at which faultless cameras show it, None if never."""
    detection_keyframe: int | None
    """First keyframe at which it is detected, None if never."""
    detection_distance_m: float | None
    """Planar distance from the sensor to its centre at that keyframe."""
    hit: bool
    """Whether the car touched it."""


@dataclass(frozen=True)
class DriveOutcome(Outcome):
    """The result of a drive. The first-sighting actor of `Outcome` is the first conflict, else the
    first encounter; without encounters its columns are None.
    """

    hit_standing: bool | None
    """Whether the car stood."""
    needless_braking: int
    """Keyframes with the brake on and nothing to brake for; see `care_sim.loops.needless`."""
    progress: float
    """Share of the way that was driven, 0 to 1."""
    encounters: tuple[EncounterOutcome, ...]
    """In the order of the way."""


class Records(NamedTuple):
    """A keyframe of W worlds, (W,) each, or the keyframes of one world; as in
    `care_sim.loops.records.Keyframe`. `fired` is how many cells were fired, and `impact_speed_mps`
    NaN where nothing was hit.
    """

    time_s: Floats
    fired: Integers
    in_view: Mask
    detected: Mask
    braking: Mask
    speed_mps: Floats
    distance_m: Floats
    nearest_m: Floats
    clearance_m: Floats
    impact_speed_mps: Floats
    needless: Mask
    unfounded: Mask

    @classmethod
    def of(cls, keyframes: Sequence[Keyframe]) -> "Records":
        """Return the records of an episode as columns."""
        columns = {name: [getattr(one, name) for one in keyframes] for name in cls._fields}
        columns["fired"] = [len(one.fired) for one in keyframes]
        # None, where nothing was hit, becomes NaN.
        impacts = np.array(columns.pop("impact_speed_mps"), float)
        return cls(
            **{name: np.array(column) for name, column in columns.items()}, impact_speed_mps=impacts
        )
