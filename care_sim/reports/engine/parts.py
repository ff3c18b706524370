"""The cells of one setting, and what its policies have over each other and over the controls."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

from care_sim.evaluation.scene_contrasts import Ratio
from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.engine.controls import best_of, is_control
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.measures import AVOIDED, Measure, Recall, Units
from care_sim.reports.formatting import marked
from care_sim.study.rows.reading import Key, Setting, policy_of, spared_seeds, tags_of_row
from care_sim.study.run_config import FULL, Row


class PolicyRows:
    """The rows of a study by policy and budget. `tags` of the policies in the order of their first
    rows; `budgets` of all but the full scan, which has one of its own.
    """

    def __init__(self, rows: Sequence[Row]):
        self.rows = rows
        self.tags = {policy_of(row): tags_of_row(row) for row in rows}
        self.budgets = sorted({row["budget"] for row in rows if row["policy"] != FULL})
        self._cells: dict[tuple[str, float], list[Row]] = {}
        for row in rows:
            self._cells.setdefault((policy_of(row), row["budget"]), []).append(row)

    @property
    def policies(self) -> list[str]:
        """Their names, with the full scan's."""
        return [*self.tags]

    @property
    def controls(self) -> list[str]:
        """The controls that a car can have."""
        return [policy for policy, tags in self.tags.items() if is_control(tags)]

    def of(self, policy: str, budget: float) -> list[Row]:
        """The rows of a policy at a budget; those of the full scan at any."""
        return self._cells.get((policy, 1.0 if policy == FULL else budget), [])

    def marked(self, policy: str) -> str:
        """A policy's name, with a mark when no car can have it."""
        return marked(policy, self.tags[policy])


class OverControl(NamedTuple):
    """A measure of policies less that of the best control.

    `controls` holds the best control of every budget, `differences` those of every policy there;
    None where there is none.
    """

    measure: Measure | Recall
    controls: list[str | None]
    differences: dict[str, list[Contrast | None]]

    @property
    def ratio(self) -> Ratio:
        """Return the ratio of a measure of the open loop."""
        assert isinstance(self.measure, Recall)
        return self.measure.ratio


class Part:
    """The cells of one setting. Policies are named with their parameters; `tags` and `budgets` are
    those of all but the full scan, which has one budget and is kept aside as the ceiling.
    """

    def __init__(self, frame: Frame, setting: Setting):
        self.frame = frame
        self.setting = setting
        own = [key for key in frame.groups if key[0] == setting and key[1] != FULL]
        self.tags = {policy: frame.tags[policy] for _, policy, _ in own}
        self.budgets = sorted({budget for _, _, budget in own})

    @property
    def policies(self) -> tuple[str, ...]:
        """All but the full scan, in the order of their first rows."""
        return tuple(self.tags)

    @cached_property
    def full(self) -> Sequence[Row]:
        """The full scans of the same worlds."""
        return self.rows(FULL, 1.0)

    @property
    def controls(self) -> list[str]:
        """The controls that a car can have."""
        return [policy for policy, tags in self.tags.items() if is_control(tags)]

    @property
    def avoided(self) -> Measure:
        """Collisions avoided, on the seeds on which the full scan has none, if it was played."""
        if not self.full:
            return AVOIDED
        spared = spared_seeds(self.full)
        return replace(
            AVOIDED,
            name="Preventable collisions avoided",
            read=lambda row: AVOIDED.read(row) if row["seed"] in spared else None,
        )

    def key(self, policy: str, budget: float) -> Key:
        """A cell of the setting."""
        return self.setting, policy, budget

    def rows(self, policy: str, budget: float) -> Sequence[Row]:
        """The rows of a cell; the full scan has one budget."""
        return self.frame.of(self.key(policy, budget))

    def units(self, measure: Measure | Recall, policy: str, budget: float) -> Units:
        """Return the measurements of a cell, by seed or by scene."""
        return self.frame.units(measure, self.key(policy, budget))

    def contrast(
        self, measure: Measure | Recall, ours: str, theirs: str, budget: float
    ) -> Contrast | None:
        """One policy minus another at a budget; None without a shared unit."""
        pair = (self.key(policy, budget) for policy in (ours, theirs))
        return self.frame.contrast(measure, *pair)

    def best_control(self, measure: Measure | Recall, budget: float) -> str | None:
        """The best control of a measure at a budget; None without one."""
        return best_of(
            measure, {policy: self.units(measure, policy, budget) for policy in self.controls}
        )

    def over_control(self, measure: Measure | Recall, policies: Iterable[str]) -> OverControl:
        """The policies less the best control at every budget."""
        best = [self.best_control(measure, budget) for budget in self.budgets]
        against = list(zip(self.budgets, best, strict=True))
        return OverControl(
            measure,
            best,
            {
                policy: [
                    self.contrast(measure, policy, control, budget) if control else None
                    for budget, control in against
                ]
                for policy in policies
            },
        )

    def marked(self, policy: str) -> str:
        """A policy's name, with a mark when no car can have it."""
        return self.frame.marked(policy)


def parts(rows: Sequence[Row]) -> list[Part]:
    """The settings of a study of episodes, in the order of their first rows."""
    frame = Frame(rows)
    return [Part(frame, setting) for setting in dict.fromkeys(key[0] for key in frame.groups)]
