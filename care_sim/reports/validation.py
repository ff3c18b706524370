"""The rows of a validation by world: who was chosen, who leads whom, and whether the world
discriminates.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.reports.collisions import preventable
from care_sim.reports.engine.contrasts import Contrast, contrast_of_rows
from care_sim.reports.engine.controls import BEST_CONTROL, is_control
from care_sim.reports.engine.measures import AVOIDED, DETECTION
from care_sim.study.designs.validate import CAMERA_POLICIES, is_training
from care_sim.study.rows.reading import detections, is_avoided, setting_of, tags_of_row
from care_sim.study.rows.settings import Setting
from care_sim.study.run_config import FULL, Row

_Cells = dict[tuple[str, float], list[Row]]
"""The rows of every policy at every budget."""
BEST_CAMERA = "best camera policy"
HINDSIGHT = "control in hindsight"
"""The best control by the very test seeds it is then compared on: a choice in its favour."""
SEPARATED = ("care", "all-camera", "history")
"""The paper's reserves, of which each pair has to be told apart."""


@dataclass(frozen=True)
class Lead:
    """What one policy has over another on the test seeds: first detection in metres, and collisions
    that a full scan prevents in points; None where they share no such seed.
    """

    detection: Contrast | None
    avoided: Contrast | None

    @property
    def is_told(self) -> bool:
        """Whether either difference counts, whoever it favours."""
        return any(each.counts for each in self._known)

    @property
    def leads(self) -> bool:
        """Whether one difference counts for the first, and none against it."""
        signs = [each.mean > 0 for each in self._known if each.counts]
        return bool(signs) and all(signs)

    @property
    def _known(self) -> list[Contrast]:
        return [each for each in (self.detection, self.avoided) if each]


class WorldPlays:
    """The rows of a validation of one world, by policy and budget.

    The choices are by training seeds and everything else is of test seeds, the choice in hindsight
    included. A policy is named by itself or by a role: `BEST_CAMERA`, `BEST_CONTROL`, `HINDSIGHT`.
    """

    def __init__(self, setting: Setting, rows: Sequence[Row]):
        self.setting = setting
        self.tags = {row["policy"]: tags_of_row(row) for row in rows}
        self.test_rows = [row for row in rows if not is_training(row)]
        self.budgets = sorted({row["budget"] for row in rows if row["policy"] != FULL})
        self._training = _by_cell(row for row in rows if is_training(row))
        self._test = _by_cell(self.test_rows)
        self._controls = [name for name, tags in self.tags.items() if is_control(tags)]

    def named(self, role: str, budget: float) -> str | None:
        """The policy of a role at a budget; None where nobody was played to choose from."""
        choices = {
            BEST_CAMERA: (self._training, CAMERA_POLICIES),
            BEST_CONTROL: (self._training, self._controls),
            HINDSIGHT: (self._test, self._controls),
        }
        return _best(*choices[role], budget) if role in choices else role

    def best_control(self, budget: float) -> str | None:
        """The best control that a car can have, by the training seeds."""
        return self.named(BEST_CONTROL, budget)

    def played(self, role: str, budget: float) -> list[Row]:
        """The test rows of a policy at a budget; the full scan has one budget."""
        policy = self.named(role, budget)
        return self._test.get((policy, 1.0 if policy == FULL else budget), []) if policy else []

    def lead(self, ours: str, theirs: str, budget: float) -> Lead:
        """What one policy has over another at a budget."""
        a, b, full = (self.played(role, budget) for role in (ours, theirs, FULL))
        avoided = contrast_of_rows(AVOIDED, preventable(full, a), preventable(full, b))
        return Lead(contrast_of_rows(DETECTION, a, b), avoided)

    def answers(self, budget: float) -> tuple[bool, bool, bool]:
        """Whether the best camera policy leads the best control, whether the full scan does, and
        whether each two of `SEPARATED` are apart. A world discriminates where all three are so.
        """
        return (
            self.lead(BEST_CAMERA, BEST_CONTROL, budget).leads,
            self.lead(FULL, BEST_CONTROL, budget).leads,
            all(self.lead(*pair, budget).is_told for pair in combinations(SEPARATED, 2)),
        )

    @property
    def discriminates_at(self) -> list[float]:
        """The budgets at which the world discriminates."""
        return [budget for budget in self.budgets if all(self.answers(budget))]

    @property
    def has_too_few(self) -> bool:
        """Whether there are too few test seeds for any difference to count."""
        return len({row["seed"] for row in self.test_rows}) < FEWEST_PAIRS

    @property
    def ran_into(self) -> str:
        """On how many test seeds a body runs into the car of the full scan, which body and how
        fast; empty where none does. Seeing more does not avoid that.
        """
        full = {row["seed"]: row for row in self.test_rows if row["policy"] == FULL}
        hit = [row for row in full.values() if row.get("hit_at_front") is False]
        if not hit:
            return ""
        kinds = ", ".join(sorted({row["hit_kind"] for row in hit}))
        # Older files lack the column.
        speeds = [row["closing_speed_mps"] for row in hit if row.get("closing_speed_mps")]
        fastest = f" up to {max(speeds):.1f} m/s" if speeds else ""
        return f"{len(hit)}/{len(full)} {kinds}{fastest}"


def played_worlds(rows: Sequence[Row]) -> list[WorldPlays]:
    """The worlds of a validation, the first of them as it is and the others with a factor
    changed.
    """
    placed = [(setting_of(row), row) for row in rows]
    # The full scan does not feel every condition: its rows may stand in a plainer setting, and
    # belong to each that differs from it in those alone.
    settings = dict.fromkeys(setting for setting, row in placed if row["policy"] != FULL)
    worlds = {
        setting: [
            row
            for own, row in placed
            if own == (setting.for_full() if row["policy"] == FULL else setting)
        ]
        for setting in settings or dict.fromkeys(setting for setting, _ in placed)
    }
    return [WorldPlays(setting, own) for setting, own in worlds.items()]


def _best(cells: _Cells, policies: Sequence[str], budget: float) -> str | None:
    """The policy that avoids the most collisions, then the one with the earliest detection, over
    the seeds of `cells` that all have played; of equals the first.
    """
    by_seed = {
        policy: {row["seed"]: row for row in cells[policy, budget]}
        for policy in policies
        if (policy, budget) in cells
    }
    if not by_seed:
        return None
    shared = set.intersection(*map(set, by_seed.values()))
    return min(
        by_seed, key=lambda policy: _rank([by_seed[policy][seed] for seed in sorted(shared)])
    )


def _rank(rows: Sequence[Row]) -> tuple[int, float]:
    distances = [found.value for found in detections(rows)]
    return sum(not is_avoided(row) for row in rows), -float(np.mean(distances or [0.0]))


def _by_cell(rows: Iterable[Row]) -> _Cells:
    cells: _Cells = {}
    for row in rows:
        cells.setdefault((row["policy"], row["budget"]), []).append(row)
    return cells
