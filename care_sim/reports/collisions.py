"""Episodes that threaten a collision, by policy and budget: what became of them, and how two
policies differ on the worlds that both have met.
"""

from collections import Counter
from collections.abc import Callable, Sequence

from care_sim.evaluation.collision_outcomes import CollisionOutcome, collision_outcome
from care_sim.reports.engine.contrasts import Contrast, contrast
from care_sim.reports.engine.controls import best_of, is_control
from care_sim.reports.engine.measures import AVOIDANCE, Units
from care_sim.study.rows.reading import is_avoided, policy_of, stops_for_nothing, tags_of_row
from care_sim.study.run_config import FULL, Row


def preventable(full: Sequence[Row], rows: Sequence[Row]) -> list[Row]:
    """The rows of the seeds on which the full scan avoids the collision."""
    spared = {row["seed"] for row in full if is_avoided(row)}
    return [row for row in rows if row["seed"] in spared]


class CollisionRows:
    """The rows of a study; `approach_mps` tells at which speed the car of a row came."""

    def __init__(self, rows: Sequence[Row], approach_mps: Callable[[Row], float]):
        self.tags = {policy_of(row): tags_of_row(row) for row in rows}
        self.budgets = sorted({row["budget"] for row in rows if row["policy"] != FULL})
        self._approach_mps = approach_mps
        self._cells: dict[tuple[str, float], list[Row]] = {}
        for row in rows:
            self._cells.setdefault((policy_of(row), row["budget"]), []).append(row)

    @property
    def policies(self) -> list[str]:
        """Their names, in the order of their first rows."""
        return list(self.tags)

    def of(self, policy: str, budget: float) -> list[Row]:
        """The rows of a policy at a budget; those of the full scan at any."""
        return self._cells.get((policy, 1.0 if policy == FULL else budget), [])

    def outcomes(self, rows: Sequence[Row]) -> Counter[CollisionOutcome]:
        """How many of the rows there are of each outcome. A stop for nothing counts as a hit."""
        return Counter(
            CollisionOutcome.HIT
            if stops_for_nothing(row)
            else collision_outcome(row["impact_speed_mps"], self._approach_mps(row))
            for row in rows
        )

    def difference(self, ours: str, theirs: str, budget: float) -> Contrast | None:
        """Points by which one policy avoids more than another, on the worlds that both have."""
        first, second = (self._avoided(policy, budget) for policy in (ours, theirs))
        return contrast(AVOIDANCE, first, second)

    def best_control(self, budget: float) -> str | None:
        """The control that avoids most at a budget, on the worlds that all controls have there;
        None without one.
        """
        controls = [policy for policy, tags in self.tags.items() if is_control(tags)]
        return best_of(AVOIDANCE, {policy: self._avoided(policy, budget) for policy in controls})

    def _avoided(self, policy: str, budget: float) -> Units:
        """What was measured by world: the seed, and what its scenario was given."""
        return AVOIDANCE.units(
            row | {"seed": repr((("seed", row["seed"]), *sorted(_given(row))))}
            for row in self.of(policy, budget)
        )


def _given(row: Row) -> list[tuple[str, object]]:
    return [(name, value) for name, value in row.items() if name.startswith("scenario.")]
