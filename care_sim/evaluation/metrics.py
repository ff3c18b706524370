"""Metrics of an episode, as pure functions of its keyframes."""

from collections.abc import Sequence

import numpy as np

from care_sim.loops.records import Keyframe, Outcome


def outcome(keyframes: Sequence[Keyframe]) -> Outcome:
    """The result of an episode; the fields of `Outcome` say what each number is."""
    # The first detection counts from the first keyframe on, in view or not: LiDAR may find what the
    # camera does not show.
    first = next((record.distance_m for record in keyframes if record.detected), None)
    appeared = next((n for n, record in enumerate(keyframes) if record.in_view), len(keyframes))

    # What a policy lets come near is counted from when it could have been seen, not while it was
    # hidden behind something.
    seen = keyframes[appeared:]
    nearest = min(record.distance_m for record in seen or keyframes)
    impact = next(
        (record.impact_speed_mps for record in keyframes if record.impact_speed_mps is not None),
        None,
    )
    return Outcome(
        detection_distance_m=first,
        # Without an actor every distance is inf, and there was nobody to detect.
        undetected_to_m=nearest if first is None and np.isfinite(nearest) else None,
        braked=any(record.braking for record in keyframes),
        min_distance_m=min((record.nearest_m for record in seen), default=None),
        clearance_m=min((record.clearance_m for record in seen), default=None),
        collision=impact is not None,
        impact_speed_mps=impact,
        rays_fired=int(np.sum([len(record.fired) for record in keyframes])),
    )
