"""`care-sim bench`: how fast the benchmark is on this machine."""

from dataclasses import dataclass

from care_sim.measure.bench.config import BenchConfig
from care_sim.measure.bench.run import run_bench


@dataclass(frozen=True, kw_only=True)
class Bench(BenchConfig):
    """Measure speed, beside other engines and environments.

    Measure speed: keyframe, scans, steps and memory, beside other engines and environments.

    The ray casters Embree and MuJoCo and the environments highway-env and panda-gym are measured in
    the same run, EnvPool's highway-env where it is installed, and PPO where the extra `rl` is. All
    but what takes several threads or processes runs on one core.
    """

    def __call__(self) -> int:
        """Run it."""
        return run_bench(self)
