"""The best policy against the best control: at every budget, in both loops, one row of a table."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from care_sim.base.errors import counted, percent
from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, among, ratio_level
from care_sim.reports.engine.contrasts import Contrast, contrast_of_rows
from care_sim.reports.engine.controls import BEST_CONTROL, best_control, is_control
from care_sim.reports.engine.measures import AVOIDED, DETECTION, GATE_POINTS, Measure
from care_sim.reports.formatting import MARKS, emphasised, ends, signed
from care_sim.reports.protocol.differences import PolicyPair
from care_sim.reports.protocol.notes import papers
from care_sim.reports.protocol.paper import PAPER_BUDGETS
from care_sim.reports.protocol.quotes import GATE
from care_sim.reports.protocol.rows import HISTORY, SettingPlays, plays_by_setting
from care_sim.reports.table import Table, TableRow
from care_sim.study.rows.reading import (
    full_of,
    grouped,
    is_avoided,
    policy_of,
    preventable,
    tags_of_row,
)
from care_sim.study.run_config import FULL, REFERENCE, Row

_SIGHTINGS = "first sightings, points"
_CHOSEN = "Best policy and best control are chosen per budget on these results, which favours both."


@dataclass(frozen=True)
class Lead:
    """What one policy has over another in a setting at a budget.

    `measure` carries its unit. `difference` is `first` minus `second`, None without a `second`. It
    counts from `gate` on.
    """

    setting: str
    budget: float
    measure: str
    gate: float
    first: str
    second: str | None
    difference: Contrast | None

    @property
    def sign(self) -> int:
        """1 where the first is ahead, -1 where the second is, 0 where they are tied."""
        if self.difference is None or not self.difference.excludes_zero:
            return 0
        return 1 if self.difference.mean > 0 else -1

    @property
    def reaches_gate(self) -> bool:
        """Whether one is ahead by the gate at least: an effect that is sure, and large enough."""
        if self.difference is None or not self.sign:
            return False
        # Of a bound only the asterisk says that the gate is reached, whatever was missed.
        sure = not self.difference.bound and abs(self.difference.mean) >= self.gate
        return sure or bool(self.difference.asterisk)

    @property
    def row(self) -> TableRow:
        """The row of a table."""
        names = (self.setting, percent(self.budget), self.measure, self.first, self.second or "")
        if self.difference is None:
            return (*names, "", "", "")
        shown = emphasised(self.difference, signed(self.difference))
        ahead = self.first if self.sign > 0 else self.second or ""
        return (*names, shown, ends(self.difference), ahead if self.reaches_gate else "no")


def leads_tables(leads: Sequence[Lead]) -> list[Table]:
    """The best policy against the best control; none without leads."""
    return _table("The best policy against the best control", "best", BEST_CONTROL, leads, _CHOSEN)


def gate_tables(rows: Sequence[Row]) -> list[Table]:
    """CARE against history at the paper's budgets, in the settings of the paper."""
    pair = PolicyPair(REFERENCE, HISTORY, FIRST_SIGHTING)
    leads = [
        Lead(plays.setting.label, budget, _SIGHTINGS, GATE_POINTS, REFERENCE, HISTORY, found)
        for plays in plays_by_setting(rows)
        # The gate was fixed for the plain setting, so that no fault is judged by it.
        if plays.setting.as_in_paper
        for budget in plays.budgets
        if budget in PAPER_BUDGETS and (found := pair.measured(plays, budget))
    ]
    made = _table("CARE against history: the paper's gate of five points", "policy", "minus", leads)
    return [replace(table, quotes=papers((GATE,))) for table in made]


def ties(leads: Sequence[Lead]) -> list[str]:
    """One sentence per measure: how often the best policy is ahead of the best control."""
    sentences = []
    for measure in dict.fromkeys(lead.measure for lead in leads):
        signs = [lead.sign for lead in leads if lead.measure == measure and lead.second]
        if signs:
            sentences.append(
                f"The best control ties the best policy in {signs.count(0)} of "
                f"{counted(len(signs), 'comparison')} ({measure}), leads in {signs.count(-1)}, "
                f"trails in {signs.count(1)}."
            )
    return sentences


def leads_of_episodes(rows: Sequence[Row], conditions: bool = True) -> list[Lead]:
    """First detections in every setting at every budget, and collisions where there are any;
    without `conditions` in plain settings alone.

    Compared are policies that a car can have, on the seeds that all have played. Fewer than
    `FEWEST_PAIRS` seeds give no lead.
    """
    groups = grouped(rows)
    tags = {policy_of(row): tags_of_row(row) for row in rows}
    played: dict[tuple[str, float], dict[str, Sequence[Row]]] = {}
    full: dict[str, Sequence[Row]] = {}
    for (setting, policy, budget), own in groups.items():
        if _is_real(policy, tags) and (conditions or not setting.conditions):
            played.setdefault((setting.label, budget), {})[policy] = own
            full[setting.label] = full_of(groups, setting) or ()
    order = [*full]
    return [
        lead
        for place in sorted(played, key=lambda place: (order.index(place[0]), place[1]))
        for lead in _leads_at(place, played[place], full[place[0]], tags)
    ]


def leads_of_plays(rows: Sequence[Row]) -> list[Lead]:
    """First sightings in every setting at every budget, of policies that a car can have."""
    found = (
        _lead_of_plays(plays, budget)
        for plays in plays_by_setting(rows)
        for budget in plays.budgets
    )
    return [lead for lead in found if lead]


def _table(title: str, first: str, second: str, leads: Sequence[Lead], *notes: str) -> list[Table]:
    if not leads:
        return []
    columns = ("setting", "budget", "measure", first, second, "difference", "interval")
    rows = tuple(lead.row for lead in leads)
    return [Table(title, (*columns, "gate reached by"), rows, notes, whole=columns[1:], names=3)]


def _is_real(policy: str, tags: Mapping[str, tuple[str, ...]]) -> bool:
    """Whether a car can have the policy at a budget."""
    return policy != FULL and {*MARKS}.isdisjoint(tags[policy])


def _leads_at(
    place: tuple[str, float],
    played: Mapping[str, Sequence[Row]],
    full: Sequence[Row],
    tags: Mapping[str, tuple[str, ...]],
) -> Iterator[Lead]:
    # A policy that lacks a hard seed would lead by that.
    shared = set.intersection(*({row["seed"] for row in own} for own in played.values()))
    if len(shared) < FEWEST_PAIRS:
        return
    full = [row for row in full if row["seed"] in shared]
    own = {p: [row for row in rows if row["seed"] in shared] for p, rows in played.items()}
    threatened = {p: preventable(full, rows) if full else rows for p, rows in own.items()}
    measured: list[tuple[Measure, Mapping[str, Sequence[Row]]]] = []
    if any(row["detection_distance_m"] is not None for rows in own.values() for row in rows):
        measured.append((DETECTION, own))
    if not all(is_avoided(row) for rows in threatened.values() for row in rows):
        measured.append((AVOIDED, threatened))
    for measure, compared in measured:
        levels = {policy: _mean(measure, rows) for policy, rows in compared.items()}
        lead = _lead(
            place,
            f"{measure.name.lower()}, {measure.unit}",
            measure.gate,
            levels,
            tags,
            partial(_contrast, measure, compared),
        )
        if lead:
            yield lead


def _contrast(
    measure: Measure, compared: Mapping[str, Sequence[Row]], ours: str, theirs: str
) -> Contrast | None:
    return contrast_of_rows(measure, compared[ours], compared[theirs])


def _mean(measure: Measure, rows: Sequence[Row]) -> float | None:
    """The mean of a measure, an actor never detected counted as in differences; None of nothing."""
    readings = [reading.value for row in rows if (reading := measure.read(row)) is not None]
    return float(np.mean(readings)) if readings else None


def _lead_of_plays(plays: SettingPlays, budget: float) -> Lead | None:
    tallies = {
        policy: own
        for policy in plays.policies
        if _is_real(policy, plays.tags) and (own := plays.tallies(policy, budget))
    }
    shared = set.intersection(*map(set, tallies.values())) if tallies else set()
    levels = {
        policy: ratio_level(FIRST_SIGHTING, among(own, shared)).by_event
        for policy, own in tallies.items()
    }
    return _lead(
        (plays.setting.label, budget),
        _SIGHTINGS,
        GATE_POINTS,
        levels,
        plays.tags,
        lambda a, b: PolicyPair(a, b, FIRST_SIGHTING).measured(plays, budget),
    )


def _lead(
    place: tuple[str, float],
    measure: str,
    gate: float,
    levels: Mapping[str, float | None],
    tags: Mapping[str, tuple[str, ...]],
    minus: Callable[[str, str], Contrast | None],
) -> Lead | None:
    """The best that is no control against the best control; None where nobody is to compare."""
    known = {policy: level for policy, level in levels.items() if level is not None}
    others = [policy for policy in known if not is_control(tags[policy])]
    best = max(others, key=known.__getitem__, default=None)
    if best is None or len(known) < 2:
        return None
    control = best_control({p: at for p, at in known.items() if is_control(tags[p])})
    found = minus(best, control) if control else None
    return Lead(*place, measure, gate, best, control, found)
