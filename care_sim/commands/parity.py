"""`care-sim parity`: the engine `fast` against Bullet."""

from dataclasses import dataclass

from care_sim.measure.parity.run import ParityConfig, run_parity


@dataclass(frozen=True, kw_only=True)
class Parity(ParityConfig):
    """Hold the engine `fast` against Bullet, ray by ray.

    Compare the engine `fast` with Bullet: rays of random scenes and of every keyframe, pictures,
    whole episodes.
    """

    def __call__(self) -> int:
        """Run it."""
        return run_parity(self)
