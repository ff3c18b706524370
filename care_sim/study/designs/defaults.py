"""Policies and budgets of studies, as defaults of options. Nothing is imported here, so that help
loads no simulator.
"""

NCAP_POLICIES = ("history", "all-camera", "care", "care-sightlines", "fan", "full")
NCAP_BUDGETS = (0.01, 0.03, 0.1)
NCAP_STEP_KPH = 10.0
"""The steps of the protocol of 2026; that of 2023 goes by 5."""

R157_POLICIES = ("history", "all-camera", "care", "fan", "full")
R157_BUDGETS = (0.01, 0.03)
"""At 3% a pattern ahead detects as much as a camera (`results/camera.md`)."""

FIRING_POLICIES = ("care", "care-sightlines", "care-units", "rows", "place", "full")

FILM_POLICIES = ("history", "all-camera", "care", "care-sightlines", "rows", "place", "full")
FILM_BUDGETS = (0.01, 0.03, 0.1)
"""Policies of the realism study, for first sightings."""

PROTOCOL_POLICIES = (
    *("history", "history-uniform", "all-camera", "uncertainty", "beam-reduce", "random"),
    *("care", "care-sbf", "learned-scorer", "care-sightlines", "rows", "place", "full"),
)
"""Policies of the paper's Sec. 5.1, `random` (only the floor), and the best patterns without a
camera.
"""
ORDERED_POLICIES = (
    *("history", "all-camera", "care", "care-sbf", "care-sightlines", "care-sector"),
    *("learned-scorer", "history-place", "full"),
)
"""The policies whose cells are taken in every order."""
