"""What stands below an episode beside others."""

import pytest

from care_sim.loops.records import Keyframe
from care_sim.viewer.pictures.comparison import verdict_text


def frames(seen, found, total=30):
    """Keyframes of 0.1 s, of an actor in view from `seen` and detected from `found` on."""
    return [
        Keyframe(
            index=n,
            time_s=n / 10,
            fired=(),
            in_view=n >= seen,
            detected=n >= found,
            braking=False,
            speed_mps=8.0,
            distance_m=30.0,
            nearest_m=30.0,
            clearance_m=1.25,
            impact_speed_mps=None,
        )
        for n in range(total)
    ]


@pytest.mark.parametrize(
    ("seen", "found", "text"),
    [
        (40, 40, "not in view yet"),
        (20, 40, "in view for 1.0 s, not detected"),
        (5, 5, "detected at 30.0 m; clearance 1.2 m"),
        (2, 25, "detected at 30.0 m, 2.3 s after coming into view; clearance 1.2 m"),
    ],
)
def test_the_detection_is_told_with_the_time_since_the_actor_came_into_view(seen, found, text):
    assert verdict_text(frames(seen, found), 0.1)[0] == text
