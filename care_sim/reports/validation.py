"""What the rows of a validation say of a world: who was chosen, who leads whom, and whether the
world discriminates.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from care_sim.base.errors import counted, percent
from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.reports.contrasts import AVOIDED, DETECTION, Contrast, contrast, preventable
from care_sim.reports.controls import is_control
from care_sim.study.designs.validate import CAMERA_POLICIES, is_training
from care_sim.study.rows.reading import detections, is_avoided, setting_of, tags_of_row
from care_sim.study.rows.settings import Setting
from care_sim.study.run_config import FULL, Row

_Cells = dict[tuple[str, float], list[Row]]
"""The rows of every policy at every budget."""
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
    included.
    """

    def __init__(self, setting: Setting, rows: Sequence[Row]):
        self.setting = setting
        self.tags = {row["policy"]: tags_of_row(row) for row in rows}
        self.test_rows = [row for row in rows if not is_training(row)]
        self.budgets = sorted({row["budget"] for row in rows if row["policy"] != FULL})
        self._training = _by_cell(row for row in rows if is_training(row))
        self._test = _by_cell(self.test_rows)

    def played(self, policy: str, budget: float) -> list[Row]:
        """The test rows of a policy at a budget; the full scan has one budget."""
        return self._test.get((policy, 1.0 if policy == FULL else budget), [])

    def best_camera(self, budget: float) -> str | None:
        """The best policy with a camera, by the training seeds."""
        return _best(self._training, CAMERA_POLICIES, budget)

    def best_control(self, budget: float) -> str | None:
        """The best control that a car can have, by the training seeds."""
        return _best(self._training, self._controls, budget)

    def hindsight_control(self, budget: float) -> str | None:
        """The best control that a car can have, by the very test seeds it is then compared on: a
        choice in its favour.
        """
        return _best(self._test, self._controls, budget)

    def lead(self, ours: str | None, theirs: str | None, budget: float) -> Lead:
        """What one policy has over another at a budget; nothing where one of them is None."""
        a, b = (self.played(policy, budget) if policy else [] for policy in (ours, theirs))
        full = self.played(FULL, budget)
        avoided = contrast(AVOIDED, preventable(full, a), preventable(full, b))
        return Lead(contrast(DETECTION, a, b), avoided)

    def camera_lead(self, budget: float) -> Lead:
        """What the best policy with a camera has over the best control."""
        return self.lead(self.best_camera(budget), self.best_control(budget), budget)

    def hindsight_lead(self, budget: float) -> Lead:
        """What the best policy with a camera has over the best control in hindsight."""
        return self.lead(self.best_camera(budget), self.hindsight_control(budget), budget)

    def full_lead(self, budget: float) -> Lead:
        """What the full scan has over the best control: all that there is to win."""
        return self.lead(FULL, self.best_control(budget), budget)

    def separations(self, budget: float) -> dict[tuple[str, str], Lead]:
        """What each of `SEPARATED` has over those after it."""
        return {pair: self.lead(*pair, budget) for pair in combinations(SEPARATED, 2)}

    def failings(self, budget: float) -> list[str]:
        """Why the world does not discriminate at a budget; nothing where it does."""
        found = []
        camera, control = self.best_camera(budget), self.best_control(budget)
        if camera is None or control is None:
            return ["nobody was chosen on training seeds"]
        if not self.camera_lead(budget).leads:
            found.append(f"{camera} does not lead {control}")
        if not self.full_lead(budget).leads:
            found.append("a full scan leaves nothing to win")
        tied = [
            " and ".join(pair)
            for pair, lead in self.separations(budget).items()
            if not lead.is_told
        ]
        if tied:
            found.append(f"{', '.join(tied)} are not told apart")
        return found

    @property
    def has_too_few(self) -> bool:
        """Whether there are too few test seeds for any difference to count."""
        return self._test_seeds < FEWEST_PAIRS

    @property
    def verdict(self) -> str:
        """Whether the world discriminates, in one sentence; nothing is said on too few seeds."""
        if self.has_too_few:
            return (
                f"{self.setting.label}: no verdict on {counted(self._test_seeds, 'test seed')}, it "
                f"takes {FEWEST_PAIRS}."
            )
        failings = {budget: self.failings(budget) for budget in self.budgets}
        passed = [percent(budget) for budget, found in failings.items() if not found]
        if passed:
            return f"{self.setting.label}: discriminates at {', '.join(passed)}."
        because = "; ".join(
            f"at {percent(budget)} {', '.join(found)}" for budget, found in failings.items()
        )
        return f"{self.setting.label}: does not discriminate, because {because}."

    @property
    def ran_into(self) -> str:
        """On how many test seeds a body runs into the car of the full scan; empty where none does.

        Such a world cannot be won by seeing more.
        """
        full = {row["seed"]: row for row in self.test_rows if row["policy"] == FULL}
        hit = [row for row in full.values() if row.get("hit_at_front") is False]
        if not hit:
            return ""
        kinds = ", ".join(sorted({row["hit_kind"] for row in hit}))
        # Older files lack the column.
        speeds = [row["closing_speed_mps"] for row in hit if row.get("closing_speed_mps")]
        fastest = f", closing at up to {max(speeds):.1f} m/s" if speeds else ""
        return (
            f"{self.setting.label}: on {len(hit)} of {counted(len(full), 'test seed')} a body "
            f"({kinds}) runs into the car of the full scan{fastest}. Seeing more does not avoid "
            "that."
        )

    @property
    def _test_seeds(self) -> int:
        return len({row["seed"] for row in self.test_rows})

    @property
    def _controls(self) -> list[str]:
        return [name for name, tags in self.tags.items() if is_control(tags)]


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
