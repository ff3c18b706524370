"""How much is compared."""

from dataclasses import dataclass
from pathlib import Path

from care_sim.errors import check_whole


@dataclass(frozen=True, kw_only=True)
class ParityConfig:
    """Hold the engine `fast` against Bullet: in random scenes, in full scans and pictures of the keyframes of every
    scenario, and in how the episodes of the paper's study go.
    """

    scenes: int = 100_000
    """Random scenes."""
    episodes: int = 5
    """Seeds from 0 of every scenario, where every keyframe is scanned in full, and of the paper's study."""
    seed: int = 0
    """Seed of the random scenes."""
    out: Path | None = None
    """File for the figures as JSON."""

    def __post_init__(self) -> None:
        check_whole("scenes", self.scenes, 0)
        check_whole("episodes", self.episodes, 0)
        check_whole("seed", self.seed, 0)
