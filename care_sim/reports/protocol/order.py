"""What the order of cells inside a set does to the first-sighting protocol: recalls, and the
paper's statements, order by order.
"""

from collections.abc import Iterator, Sequence

from care_sim.base.errors import percent
from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, Ratio
from care_sim.reports.formatting import interval, marked, tag_notes
from care_sim.reports.order_tables import Shown, other_orders, played_once, tables_by_order
from care_sim.reports.order_verdicts import Verdict, Verdicts, on_mirrored_order, verdict_tables
from care_sim.reports.protocol.closing import protocol_closing
from care_sim.reports.protocol.differences import MeasuredDifference, difference_between
from care_sim.reports.protocol.formatting import claim_in_short, verdict, written
from care_sim.reports.protocol.notes import played
from care_sim.reports.protocol.paper import claims_about
from care_sim.reports.protocol.rows import SettingPlays, plays_by_setting
from care_sim.reports.table import Table
from care_sim.study.designs.order import BASE_ORDER, rows_by_order, without_order
from care_sim.study.run_config import FULL, Row

_RATIOS = (FIRST_SIGHTING, OVERALL)
_INTERVALS = f"With intervals over scenes, none of fewer than {FEWEST_PAIRS}."


class OrderPlays:
    """The plays of the study by order; the orders differ in nothing else."""

    def __init__(self, rows: Sequence[Row]):
        self.by_order = {
            order: plays_by_setting(own)[0] for order, own in rows_by_order(rows).items()
        }
        first = next(iter(self.by_order.values()))
        self.tags = first.tags
        self.budgets = first.budgets
        self.label = first.setting.label
        self.scenes = len(first.scenes)
        self.played = played(first)
        self.once = without_order(rows)

    def level(self, ratio: Ratio, order: str, policy: str, budget: float) -> float | None:
        """A recall in %."""
        return self.by_order[order].level(ratio, policy, budget).by_event

    def change(
        self, ratio: Ratio, order: str, policy: str, budget: float
    ) -> MeasuredDifference | None:
        """A recall under an order less that under the usual one, scene by scene."""
        if BASE_ORDER not in self.by_order:
            return None
        ours, usual = (self.by_order[each].tallies(policy, budget) for each in (order, BASE_ORDER))
        return difference_between(ratio, ours, usual)


def order_tables(rows: Sequence[Row]) -> list[Table]:
    """Recalls by order, their differences to the usual order, and the paper's statements by
    order.
    """
    study = OrderPlays(rows)
    if not study.tags:
        return []
    notes = (study.played, *played_once(study.once), *tag_notes(study.tags.values()))
    title = f"{study.label}: the paper's statements by order of cells"
    return [
        *tables_by_order(
            Shown(f"{study.label}: recall", "%", "points"),
            study.by_order,
            _levels(study),
            _changes(study),
            notes,
            (_INTERVALS,),
        ),
        *verdict_tables(title, verdicts(rows), study.played),
    ]


def order_closing(rows: Sequence[Row]) -> list[str]:
    """Size of the study, and which statements hang on whether rows are numbered from the top or
    from the bottom.
    """
    return [*protocol_closing(rows), *on_mirrored_order(verdicts(rows))]


def verdicts(rows: Sequence[Row]) -> Verdicts:
    """Every statement of the paper on policies and budgets that were played, under every order."""
    return {order: dict(_judged(plays)) for order, plays in OrderPlays(rows).by_order.items()}


def _judged(plays: SettingPlays) -> Iterator[tuple[str, Verdict]]:
    for each, claims in claims_about(plays.setting).items():
        if not set(each.policies) <= set(plays.policies):
            continue
        for budget in plays.budgets:
            claim = claims.at(budget)
            found = each.measured(plays, budget) if claim else None
            if claim and found:
                text = f"{each.label}, {each.heading.lower()}, {percent(budget)}"
                yield (
                    f"{text} (paper: {claim_in_short(claim)})",
                    Verdict(verdict(found, claim.sign), interval(found)),
                )


def _levels(study: OrderPlays) -> Iterator[tuple[str, ...]]:
    for ratio in _RATIOS:
        yield (ratio.name,)
        for policy, budget, names in _cells(study):
            levels = (study.level(ratio, order, policy, budget) for order in study.by_order)
            yield (*names, *(written(ratio, level) for level in levels))
        ceilings = [study.level(ratio, order, FULL, 1.0) for order in study.by_order]
        if any(level is not None for level in ceilings):
            yield (FULL, percent(1.0), *(written(ratio, level) for level in ceilings))


def _changes(study: OrderPlays) -> Iterator[tuple[str, ...]]:
    others = other_orders(study.by_order)
    for ratio in _RATIOS:
        yield (ratio.name,)
        for policy, budget, names in _cells(study):
            if policy not in study.once:
                changes = (study.change(ratio, order, policy, budget) for order in others)
                yield (*names, *map(interval, changes))


def _cells(study: OrderPlays) -> Iterator[tuple[str, float, tuple[str, str]]]:
    """Policies and budgets, and how a line names them."""
    for budget in study.budgets:
        for policy, tags in study.tags.items():
            yield policy, budget, (marked(policy, tags), percent(budget))
