"""Episodes that threaten a collision, by policy and budget: what became of them, and how two
policies differ on the worlds that both have met.
"""

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from care_sim.evaluation.censoring import Reading, difference
from care_sim.evaluation.collision_outcomes import CollisionOutcome, collision_outcome
from care_sim.reports.contrasts import GATE_POINTS, Contrast, Measure
from care_sim.reports.controls import best_control, is_control
from care_sim.study.rows.reading import is_avoided, policy_of, stops_for_nothing, tags_of_row
from care_sim.study.run_config import FULL, Row


def _avoided(row: Row) -> Reading:
    return Reading(100.0 * is_avoided(row))


AVOIDANCE = Measure("Avoided", "points", 0, GATE_POINTS, _avoided)
_World = tuple[tuple[str, object], ...]


class CollisionRows:
    """The rows of a study; `approach_mps` tells at which speed the car of a row came."""

    def __init__(self, rows: Sequence[Row], approach_mps: Callable[[Row], float]):
        self.tags = {policy_of(row): tags_of_row(row) for row in rows}
        self.budgets = sorted({row["budget"] for row in rows if row["policy"] != FULL})
        self._approach_mps = approach_mps
        self._cells: dict[tuple[str, float], dict[_World, Row]] = {}
        for row in rows:
            key = policy_of(row), row["budget"]
            self._cells.setdefault(key, {})[_world_of(row)] = row

    @property
    def policies(self) -> list[str]:
        """Their names, in the order of their first rows."""
        return list(self.tags)

    def of(self, policy: str, budget: float) -> list[Row]:
        """The rows of a policy at a budget; those of the full scan at any."""
        return [*self._cell(policy, budget).values()]

    def outcomes(self, rows: Sequence[Row]) -> Counter[CollisionOutcome]:
        """How many of the rows there are of each outcome. A stop for nothing counts as a hit."""
        return Counter(self._outcome(row) for row in rows)

    def _outcome(self, row: Row) -> CollisionOutcome:
        if stops_for_nothing(row):
            return CollisionOutcome.HIT
        return collision_outcome(row["impact_speed_mps"], self._approach_mps(row))

    def difference(self, ours: str, theirs: str, budget: float) -> Contrast | None:
        """Points by which one policy avoids more than another, on the worlds that both have."""
        first, second = self._cell(ours, budget), self._cell(theirs, budget)
        shared = sorted({*first} & {*second}, key=repr)
        if not shared:
            return None
        of_ours, of_theirs = ([_avoided(cell[w]) for w in shared] for cell in (first, second))
        return Contrast(AVOIDANCE, difference(of_ours, of_theirs))

    def best_control(self, budget: float) -> str | None:
        """The control that avoids most at a budget, on the worlds that all controls have there;
        None without one.
        """
        cells = {
            policy: cell
            for policy, tags in self.tags.items()
            if is_control(tags) and (cell := self._cell(policy, budget))
        }
        shared = set.intersection(*map(set, cells.values())) if cells else set()
        if not shared:
            return None
        return best_control(
            {
                policy: float(np.mean([is_avoided(cell[world]) for world in shared]))
                for policy, cell in cells.items()
            }
        )

    def _cell(self, policy: str, budget: float) -> dict[_World, Row]:
        return self._cells.get((policy, 1.0 if policy == FULL else budget), {})


def _world_of(row: Row) -> _World:
    """What decides the world of a row: the seed, and what its scenario was given."""
    given = [(name, value) for name, value in row.items() if name.startswith("scenario.")]
    return (("seed", row["seed"]), *sorted(given))
