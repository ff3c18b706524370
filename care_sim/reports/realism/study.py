"""The study of realism in either loop: what a headline table holds, under every condition."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from care_sim.base.errors import percent
from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.levels import level
from care_sim.reports.engine.measures import (
    AVOIDED,
    DETECTION,
    OPEN_LOOP,
    Measure,
    Recall,
    Units,
)
from care_sim.reports.realism.orders import Order, Standing
from care_sim.study.designs.realism import (
    CONDITIONS,
    FILM_CAMERA,
    FILM_CONDITIONS,
    FILM_PAIRS,
    FILM_POLICIES,
    HEADLINES,
    IDEAL,
    LATE_CAMERA,
    LATE_FILM_CAMERA,
    Headline,
    Pair,
)
from care_sim.study.designs.variants import FilmPlace, Variant
from care_sim.study.rows.reading import READ_WITH
from care_sim.study.run_config import FULL, REFERENCE, Row

_OF_THE_FILM = ("sensor", "sensor_hash", *READ_WITH)
"""Columns of a source, which are no conditions."""


@dataclass(frozen=True)
class Block:
    """A headline table, or a measure of the open loop at a budget: its policies, and the pairs
    whose order it tells.

    `name` is the heading, in which `group` is the measure where several are told; `units` are what
    was measured of a policy under a condition. With `by_cases` its units are pairs of case and
    seed, of which cases are drawn.
    """

    name: str
    group: str
    label: str
    measure: Measure | Recall
    policies: Sequence[str]
    pairs: Sequence[Pair]
    units: Callable[[Variant, str], Units]
    by_cases: bool = False

    def contrast(self, ours: Units, theirs: Units) -> Contrast | None:
        """`ours` minus `theirs`; None where one of them was not played."""
        if self.by_cases and isinstance(self.measure, Measure):
            return self.measure.contrast_of_cases(ours, theirs)
        return self.measure.contrast(ours, theirs)

    def level(self, condition: Variant, policy: str) -> str:
        """The figure of a policy; empty where it was not played."""
        return level(self.measure, self.units(condition, policy))

    def change(self, condition: Variant, policy: str) -> Contrast | None:
        """What the condition adds to the measure of a policy."""
        return self.contrast(self.units(condition, policy), self.units(IDEAL, policy))

    def order(self, pair: Pair, conditions: Sequence[Variant]) -> Order:
        """How the first policy stands to the second under every condition."""
        found = {
            each.label: Standing.of(contrast)
            for each in conditions
            if (contrast := self.contrast(*(self.units(each, policy) for policy in pair)))
        }
        return Order(self.label, pair, found)


class RealismStudy:
    """The rows of the study, of either loop."""

    def __init__(self, rows: Sequence[Row]):
        self.frame = Frame(rows)
        open_loop = bool(rows) and "source" in rows[0]
        self.title = "Open loop" if open_loop else "Closed loop"
        self.unit = "points" if open_loop else "m or points"
        self.levels_told = "%" if open_loop else "median first detection, m, or collisions avoided"
        self.blocks = [*(_film_blocks(self.frame) if open_loop else _headline_blocks(self.frame))]
        self.conditions = [
            each
            for each in (FILM_CONDITIONS if open_loop else CONDITIONS)
            if any(block.units(each, policy) for block in self.blocks for policy in block.policies)
        ]
        cameras = (FILM_CAMERA, LATE_FILM_CAMERA) if open_loop else (LATE_CAMERA,)
        self.cameras = [each for each in cameras if each in self.conditions]

    def orders(self) -> dict[str, list[Order]]:
        """The orders by measure; the measure is empty where each headline table has its own."""
        found: dict[str, list[Order]] = {}
        for block in self.blocks:
            orders = (block.order(pair, self.conditions) for pair in block.pairs)
            found.setdefault(block.group, []).extend(each for each in orders if each.standings)
        return found


def _headline_blocks(frame: Frame) -> Iterator[Block]:
    """The headline tables that were played."""
    for headline in HEADLINES:
        measure = AVOIDED if headline.by_collisions else DETECTION
        units = _units_of(frame, headline, measure)
        known = dict.fromkeys([*headline.policies, *frame.policies])
        policies = [policy for policy in known if units(IDEAL, policy)]
        # A full scan is of every table of its scenario: alone it is of one that was not played.
        if {*policies} - {FULL}:
            joined = [policy for policy in policies if policy not in headline.policies]
            yield Block(
                headline.name,
                "",
                headline.name,
                measure,
                policies,
                [*headline.pairs, *((REFERENCE, policy) for policy in joined)],
                units,
                by_cases=len(headline.places) > 1,
            )


def _units_of(
    frame: Frame, headline: Headline, measure: Measure
) -> Callable[[Variant, str], Units]:
    def units(condition: Variant, policy: str) -> Units:
        keys = [condition.key(place, policy) for place in headline.places]
        return {
            (number, seed): reading
            for number, key in enumerate(keys)
            for seed, reading in frame.units(measure, key).items()
        }

    return units


def _film_blocks(frame: Frame) -> Iterator[Block]:
    """First-sighting and overall recall at every budget."""
    row = frame.rows[0]
    shared = tuple((name, row.get(name)) for name in _OF_THE_FILM)
    policies = list(dict.fromkeys(policy for _, policy, _ in frame.groups))
    joined = [policy for policy in policies if policy not in FILM_POLICIES]
    pairs = [*FILM_PAIRS, *((REFERENCE, policy) for policy in joined)]

    def units_of(measure: Measure | Recall, budget: float) -> Callable[[Variant, str], Units]:
        place = FilmPlace(row["source"], budget, shared)
        # The full scan is found as the ceiling of every setting, whatever it feels of it.
        return lambda condition, policy: frame.units(
            measure, (condition.key(place, REFERENCE)[0], policy, budget)
        )

    for measure in OPEN_LOOP.measures:
        assert isinstance(measure, Recall)
        for budget in sorted({budget for _, policy, budget in frame.groups if policy != FULL}):
            yield Block(
                f"{measure.ratio.name}, {percent(budget)}",
                measure.ratio.name,
                percent(budget),
                measure,
                policies,
                pairs,
                units_of(measure, budget),
            )
