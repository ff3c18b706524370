"""How much is compared."""

from dataclasses import dataclass
from pathlib import Path

from care_sim.base.bounds import bounded, check_fields
from care_sim.base.checks import LARGEST_INTEGER


@dataclass(frozen=True, kw_only=True)
class ParityConfig:
    """Hold the engine `fast` against Bullet: in random scenes, in full scans and pictures of the
    keyframes of every scenario, and in how the episodes of the paper's study go.
    """

    scenes: int = bounded(100_000, 0, LARGEST_INTEGER)
    """Random scenes."""
    episodes: int = bounded(5, 0, 10_000)
    """Seeds from 0 of every scenario, where every keyframe is scanned in full, and of the paper's
    study.
    """
    seed: int = bounded(0, 0, LARGEST_INTEGER)
    """Seed of the random scenes."""
    out: Path | None = None
    """File for the figures as JSON."""

    def __post_init__(self) -> None:
        check_fields(self)
