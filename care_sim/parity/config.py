"""How much is compared."""

from dataclasses import dataclass
from pathlib import Path

from care_sim.errors import check_whole


@dataclass(frozen=True, kw_only=True)
class ParityConfig:
    """Hold the ray engine `fast` against Bullet: in random scenes, and in full scans of every scenario's keyframes."""

    scenes: int = 100_000
    """Random scenes."""
    episodes: int = 5
    """Episodes a scenario, seeds from 0; every keyframe is scanned in full."""
    seed: int = 0
    """Seed of the random scenes."""
    out: Path | None = None
    """File for the figures as JSON."""

    def __post_init__(self) -> None:
        check_whole("scenes", self.scenes, 0)
        check_whole("episodes", self.episodes, 0)
        check_whole("seed", self.seed, 0)
