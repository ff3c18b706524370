"""How fast the benchmark is on this machine: `care-sim bench`."""

from care_sim.bench.config import BenchConfig
from care_sim.bench.measure import measure
from care_sim.bench.run import run

__all__ = ["BenchConfig", "measure", "run"]
