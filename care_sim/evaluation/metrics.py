"""Metrics of an episode, as pure functions of its keyframes."""

from collections.abc import Sequence

import numpy as np

from care_sim.loops.records import Keyframe, Outcome, Records
from care_sim.world.approach import Impact


def outcome(keyframes: Sequence[Keyframe]) -> Outcome:
    """The result of an episode; the fields of `Outcome` say what each number is."""
    return outcome_of(Records.of(keyframes), keyframes[-1].impact)


def outcome_of(records: Records, impact: Impact | None) -> Outcome:
    """The result of an episode with these `records`, (n,) each, which ends with the `impact`."""
    # The first detection counts from the first keyframe on, in view or not: LiDAR may find what the
    # camera does not show.
    found = np.flatnonzero(records.detected)
    first = float(records.distance_m[found[0]]) if len(found) else None

    # What a policy lets come near is counted from when it could have been seen, not while it was
    # hidden behind something.
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
