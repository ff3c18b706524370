"""Names of the report engine under their former path, until every room imports them from there."""

from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.engine.measures import (
    AVOIDED,
    BRAKED,
    DETECTED,
    DETECTION,
    GATE_COLLISION_POINTS,
    GATE_M,
    GATE_POINTS,
    Measure,
    contrast,
    contrast_of_cases,
    preventable,
)

__all__ = [
    "AVOIDED",
    "BRAKED",
    "DETECTED",
    "DETECTION",
    "GATE_COLLISION_POINTS",
    "GATE_M",
    "GATE_POINTS",
    "Contrast",
    "Measure",
    "contrast",
    "contrast_of_cases",
    "preventable",
]
