"""What an episode leaves behind for the scoring: a record per keyframe, and the outcome."""

from dataclasses import dataclass

from care_sim.core.grid import Cells


@dataclass(frozen=True)
class Keyframe:
    """The record of one keyframe, from which every metric is computed. Scoring only: it holds
    truth.

    `in_view`: the unimpaired camera shows the first-sighting actor; `detected`: the detector
    reported it. `distance_m`: planar, sensor to its centre, at the scan. The rest holds for the
    time until the next keyframe: `nearest_m` (centre to centre) and `clearance_m` (hull to hull) at
    their smallest, `impact_speed_mps` the car's speed at its first contact with any body, else
    None.
    """

    index: int
    time_s: float
    fired: Cells
    in_view: bool
    detected: bool
    braking: bool
    speed_mps: float
    distance_m: float
    nearest_m: float
    clearance_m: float
    impact_speed_mps: float | None


@dataclass(frozen=True)
class Outcome:
    """The result of an episode; see `care_sim.evaluation.metrics.outcome` for the definitions."""

    detection_distance_m: float | None
    undetected_to_m: float | None
    braked: bool
    min_distance_m: float | None
    clearance_m: float | None
    collision: bool
    impact_speed_mps: float | None
    rays_fired: int
