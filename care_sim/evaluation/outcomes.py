"""Results of episodes and drives, as pure functions of their keyframes; outcomes of collisions."""

from collections.abc import Sequence
from dataclasses import asdict
from enum import StrEnum

import numpy as np

from care_sim.loops.records import DriveOutcome, EncounterOutcome, Keyframe, Outcome, Records, Sight
from care_sim.world.approach import Impact
from care_sim.world.motions import Meeting


def outcome(keyframes: Sequence[Keyframe]) -> Outcome:
    """The result of an episode; the fields of `Outcome` say what each number is."""
    return outcome_of(Records.of(keyframes), keyframes[-1].impact)


def outcome_of(records: Records, impact: Impact | None) -> Outcome:
    """The result of an episode with these `records`, (n,) each, which ends with the `impact`."""
    # The first detection counts from the first keyframe on, in view or not: LiDAR may detect
    # objects outside the camera's view.
    found = np.flatnonzero(records.detected)
    first = float(records.distance_m[found[0]]) if len(found) else None

    # Closeness counts from when the object was visible, not while it was hidden.
    is_seen = bool(records.in_view.any())
    since = int(records.in_view.argmax())
    unseen = since if is_seen else len(records.in_view)
    nearest = float(records.distance_m[since:].min())
    hits = np.flatnonzero(~np.isnan(records.impact_speed_mps))
    return Outcome(
        detection_distance_m=first,
        # Without an actor every distance is inf, and there was nobody to detect.
        undetected_to_m=nearest if first is None and np.isfinite(nearest) else None,
        braked=bool(records.braking.any()),
        braked_before_view=bool(records.unfounded[:unseen].any()),
        min_distance_m=float(records.nearest_m[since:].min()) if is_seen else None,
        clearance_m=float(records.clearance_m[since:].min()) if is_seen else None,
        collision=len(hits) > 0,
        impact_speed_mps=float(records.impact_speed_mps[hits[0]]) if len(hits) else None,
        closing_speed_mps=impact.closing_mps if impact else None,
        hit_kind=impact.kind if impact else None,
        hit_at_front=impact.at_front if impact else None,
        rays_fired=int(records.fired.sum()),
    )


def drive_outcome_of(
    records: Records,
    impact: Impact | None,
    sights: Sequence[tuple[Sight, ...]],
    meetings: Sequence[Meeting],
    progress: float,
) -> DriveOutcome:
    """The result of a drive with `meetings`, after a share `progress` of its way. `sights` are
    those of each keyframe, the others as in `outcome_of`.
    """
    return DriveOutcome(
        **asdict(outcome_of(records, impact)),
        hit_standing=impact.speed_mps == 0.0 if impact else None,
        needless_braking=int(records.needless.sum()),
        progress=min(max(progress, 0.0), 1.0),
        encounters=tuple(
            _encounter(
                one,
                [own[number] for own in sights],
                impact is not None and impact.body == one.body,
            )
            for number, one in enumerate(meetings)
        ),
    )


def _encounter(meeting: Meeting, sights: Sequence[Sight], hit: bool) -> EncounterOutcome:
    found = next((n for n, sight in enumerate(sights) if sight.detected), None)
    return EncounterOutcome(
        who=meeting.who,
        side=meeting.side,
        along_m=meeting.along_m,
        way=meeting.way,
        course=meeting.course,
        occluder=meeting.occluder,
        occluder_reported=meeting.occluder_reported,
        set_off=bool(meeting.crosser.went),
        view_keyframe=next((n for n, sight in enumerate(sights) if sight.in_view), None),
        detection_keyframe=found,
        detection_distance_m=None if found is None else sights[found].distance_m,
        hit=hit,
    )


SAME_SPEED_MPS = 1 / 3.6
"""Speeds within 1 km/h count as equal, as for test speeds in Euro NCAP's protocols."""


class CollisionOutcome(StrEnum):
    """The outcome of a test: no collision, a slower one, or an unbraked one."""

    AVOIDED = "avoided"
    MITIGATED = "mitigated"
    HIT = "hit"


def collision_outcome(impact_mps: float | None, unbraked_mps: float) -> CollisionOutcome:
    """Return the outcome from the impact's speed, None without one, and the impact speed of a car
    that does not brake.
    """
    if impact_mps is None:
        return CollisionOutcome.AVOIDED
    slower = impact_mps < unbraked_mps - SAME_SPEED_MPS
    return CollisionOutcome.MITIGATED if slower else CollisionOutcome.HIT


BEST_SCORE = 5.0
"""Score of a test without a contact."""
_MOST_OF_A_HIT = 4.0


def score(impact: float | None, reference: float) -> float:
    """Return 5 without an impact, else 4 max(0, 1 - impact / reference). Speeds in m/s (Ljungbergh
    et al. 2024, NeuroNCAP).
    """
    if impact is None:
        return BEST_SCORE
    return _MOST_OF_A_HIT * max(0.0, 1.0 - impact / reference)
