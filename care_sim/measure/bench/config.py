"""What is measured, and how long."""

from dataclasses import dataclass
from pathlib import Path

from care_sim.base.bounds import bounded, check_fields
from care_sim.base.checks import LARGEST_INTEGER, check_known
from care_sim.scenarios import PAPER_SCENARIOS
from care_sim.study.episode_config import EpisodeConfig


@dataclass(frozen=True, kw_only=True)
class BenchConfig:
    """Measure speed: a keyframe by stage, scans, steps, many worlds at once and memory, beside
    known ones in the same run.
    """

    scenario: str = "dense"
    """Scenario whose keyframe is taken apart and whose speed is held against the targets."""
    budget: float = 0.10
    """Budget fraction, 0 to 1."""
    policy: str = "care"
    """Policy that chooses the cells."""
    seed: int = 0
    """Seed of the first episode, and of the scenes of scans and choices."""
    seconds: float = bounded(3.0, 0.001, 3600)
    """Duration of every single measurement of steps; worlds at once and PPO take longer where whole
    episodes, and whole rollouts, do.
    """
    repeats: int = bounded(5, 1, 10_000)
    """Rounds; in each round everything is measured once."""
    samples: int = bounded(200, 1, 1_000_000)
    """Scans per engine, and choices of cells, in a round; a tenth of them per point of the growth
    curves."""
    resets: int = bounded(2000, 1, LARGEST_INTEGER)
    """Episodes that are begun in the worker whose memory is measured, and in the worlds at once
    whose memory is, rounded up to whole batches.
    """
    seeds: int = bounded(5, 0, 10_000)
    """Seeds of the paper's closed-loop study, 49 episodes each, that two workers play; 0 leaves it
    out.
    """
    out: Path | None = None
    """File for the figures as JSON; the growth curves are drawn beside it, as PNG and SVG."""

    def __post_init__(self) -> None:
        check_fields(self)
        # Taken apart is the keyframe of a car that drives straight ahead.
        check_known("scenario", self.scenario, PAPER_SCENARIOS)

    @property
    def episode(self) -> EpisodeConfig:
        """The first episode. Raises InvalidInput for what it does not accept."""
        return EpisodeConfig(self.scenario, self.policy, self.budget, self.seed)
