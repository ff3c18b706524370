"""The first 20 streets of the benchmark's suite as a source: no policy was tried on them before.

cd docs/examples
care-sim protocol --source suite_streets:SuiteStreets --budgets 0.01 --detector centerpoint
"""

from dataclasses import dataclass

from care_sim.sources.scenes import Streets


@dataclass(frozen=True)
class SuiteStreets(Streets):
    """Streets 200 to 219."""

    kind = "suite-streets"

    def seeds(self):
        """The first 20 seeds of the suite."""
        return range(200, 220)
