"""Realism, the same in both loops: which orders of the headline tables hold under every condition,
which change, and the figures of all policies.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial

from care_sim.base.errors import percent
from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.reports.engine.contrasts import Contrast, contrast
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.levels import level
from care_sim.reports.engine.measures import AVOIDED, DETECTION, OPEN_LOOP, Measure, Recall, Units
from care_sim.reports.formatting import interval
from care_sim.reports.table import Table, TableRow
from care_sim.study.designs import realism as design
from care_sim.study.designs.defaults import FILM_POLICIES
from care_sim.study.designs.realism import IDEAL, Pair
from care_sim.study.designs.variants import FilmPlace, Place, Variant
from care_sim.study.rows.reading import READ_WITH
from care_sim.study.run_config import FULL, REFERENCE, Row

_OF_THE_FILM = ("sensor", "sensor_hash", *READ_WITH)
"""Columns of a source, which are no conditions."""


class Verdict(StrEnum):
    """Verdict on an order under a condition: a lead that holds, is lost or flips; a tie that stays
    tied, or from which a lead arises.
    """

    HOLDS = "holds"
    FLIPS = "flips"
    LOST = "lost"
    ARISES = "arises"
    TIED = "tied"


@dataclass(frozen=True)
class Order:
    """Two policies in a headline table, by the labels of the conditions that were played."""

    headline: str
    pair: Pair
    standings: Mapping[str, Contrast]

    @property
    def label(self) -> str:
        """The headline table and the two policies."""
        return f"{self.headline}: {' : '.join(self.pair)}"

    def verdict(self, condition: str) -> Verdict | None:
        """None where one of the two was not played, or rests on too few pairs."""
        before, here = (
            found.sign if found and found.difference.pairs >= FEWEST_PAIRS else None
            for found in map(self.standings.get, (IDEAL.label, condition))
        )
        if condition == IDEAL.label or before is None or here is None:
            return None
        if not before:
            return Verdict.ARISES if here else Verdict.TIED
        if not here:
            return Verdict.LOST
        return Verdict.HOLDS if here == before else Verdict.FLIPS


class _Block:
    """A headline table, or a measure of the open loop at a budget, with the policies that were
    played, and CARE beside each that joined in.

    `label` names its orders, below a heading with the measure where there are several. If there are
    several places, intervals resample the places, not their seeds.
    """

    def __init__(
        self,
        frame: Frame,
        measure: Measure | Recall,
        places: Sequence[Place | FilmPlace],
        policies: Sequence[str],
        pairs: Sequence[Pair],
    ):
        self.frame, self.measure, self.places = frame, measure, places
        every = dict.fromkeys([*policies, *(policy for _, policy, _ in frame.groups)])
        self.policies = [policy for policy in every if self.units(policy, IDEAL)]
        joined = (policy for policy in self.policies if policy not in policies)
        self.pairs = [*pairs, *((REFERENCE, policy) for policy in joined)]
        film = isinstance(measure, Recall)
        self.heading = measure.heading if film else ""
        self.label = percent(places[0].budget) if film else str(places[0])

    def units(self, policy: str, condition: Variant) -> Units:
        """Return the measurements of a policy, by place, and by seed or scene."""
        # The full scan is found from every setting, whatever it feels of it.
        keys = [(place.budget, condition.key(place, REFERENCE)[0]) for place in self.places]
        return {
            (number, unit): value
            for number, (budget, setting) in enumerate(keys)
            for unit, value in self.frame.units(self.measure, (setting, policy, budget)).items()
        }

    def level(self, policy: str, condition: Variant) -> str:
        """The figure of a policy; empty where it was not played."""
        return level(self.measure, self.units(policy, condition))

    def change(self, policy: str, condition: Variant) -> str:
        """Return the change that the condition makes to the figure of a policy."""
        return interval(self._contrast((policy, condition), (policy, IDEAL)))

    def order(self, pair: Pair, conditions: Sequence[Variant]) -> Order:
        """How the first policy stands to the second under every condition."""
        found = ((each.label, self._contrast(*((p, each) for p in pair))) for each in conditions)
        return Order(self.label, pair, {name: one for name, one in found if one})

    def _contrast(self, ours: tuple[str, Variant], theirs: tuple[str, Variant]) -> Contrast | None:
        by_cases = len(self.places) > 1
        return contrast(self.measure, self.units(*ours), self.units(*theirs), by_cases)


class RealismStudy:
    """The rows of the study, of either loop."""

    def __init__(self, rows: Sequence[Row]):
        self.frame = Frame(rows)
        open_loop = bool(rows) and "source" in rows[0]
        self.title = "Open loop" if open_loop else "Closed loop"
        self.unit = "points" if open_loop else "m or points"
        self.shown = "%" if open_loop else "median first detection, m, or collisions avoided"
        made = _film_blocks(self.frame) if open_loop else _headline_blocks(self.frame)
        # A full scan alone is of every table of its scenario.
        self.blocks = [block for block in made if {*block.policies} - {FULL}]
        self.conditions = [
            each
            for each in (design.FILM_CONDITIONS if open_loop else design.CONDITIONS)
            if any(block.units(policy, each) for block in self.blocks for policy in block.policies)
        ]
        cameras = (
            (design.FILM_CAMERA, design.LATE_FILM_CAMERA) if open_loop else (design.LATE_CAMERA,)
        )
        self.cameras = [each for each in cameras if each in self.conditions]

    def orders(self) -> dict[str, list[Order]]:
        """The orders by measure; the measure is empty where each headline table has its own."""
        found: dict[str, list[Order]] = {}
        for block in self.blocks:
            orders = (block.order(pair, self.conditions) for pair in block.pairs)
            found.setdefault(block.heading, []).extend(each for each in orders if each.standings)
        return found


def _headline_blocks(frame: Frame) -> Iterator[_Block]:
    for each in design.HEADLINES:
        measure = AVOIDED if each.by_collisions else DETECTION
        yield _Block(frame, measure, each.places, each.policies, each.pairs)


def _film_blocks(frame: Frame) -> Iterator[_Block]:
    """First-sighting and overall recall at every budget."""
    row = frame.rows[0]
    shared = tuple((name, row.get(name)) for name in _OF_THE_FILM)
    for measure in OPEN_LOOP.measures:
        for budget in sorted({budget for _, policy, budget in frame.groups if policy != FULL}):
            place = FilmPlace(row["source"], budget, shared)
            yield _Block(frame, measure, [place], FILM_POLICIES, design.FILM_PAIRS)


def realism_tables(rows: Sequence[Row]) -> list[Table]:
    """Verdicts, orders, the realistic camera, and the figures under every condition."""
    study = RealismStudy(rows)
    ideal = (IDEAL.label, partial(_Block.level, condition=IDEAL))
    beside = [
        column
        for camera in study.cameras
        for column in (
            (camera.label, partial(_Block.level, condition=camera)),
            (f"change, {study.unit}", partial(_Block.change, condition=camera)),
        )
    ]
    every = [(each.label, partial(_Block.level, condition=each)) for each in study.conditions]
    tables = [
        *_order_tables(study),
        _level_table(study, "the ideal and a realistic camera", [ideal, *beside]),
        _level_table(study, "every condition", every, terminal=False),
    ]
    return [table for table in tables if table.rows]


def _order_tables(study: RealismStudy) -> Iterator[Table]:
    """How many orders hold, the ones that change, and all under every condition."""
    counts: list[TableRow] = []
    changed: list[TableRow] = []
    lines: list[TableRow] = []
    labels = [each.label for each in study.conditions]
    for measure, orders in study.orders().items():
        told = [
            (verdict, order, label)
            for order in orders
            for label in labels
            if (verdict := order.verdict(label))
        ]
        counter = Counter(verdict for verdict, _, _ in told)
        counts += [(measure, *(str(counter[each]) for each in Verdict))] if told else []
        # First what flips, then what is lost, then leads where there was a tie.
        changes: list[TableRow] = [
            (order.label, label, *(_difference(order, at) for at in (IDEAL.label, label)), verdict)
            for wanted in (Verdict.FLIPS, Verdict.LOST, Verdict.ARISES)
            for verdict, order, label in told
            if verdict is wanted
        ]
        heading: list[TableRow] = [(measure,)] if measure else []
        changed += [*heading, *changes] if changes else []
        lines += heading
        lines += [(order.label, *(_entry(order, label) for label in labels)) for order in orders]
    title = f"{study.title}: orders"
    yield Table(f"{title} by verdict", ("measure", *Verdict), tuple(counts))
    yield Table(
        f"{title} that change, {study.unit}",
        ("order", "condition", IDEAL.label, "under the condition", "verdict"),
        tuple(changed),
        names=2,
    )
    yield Table(
        f"{title} of the headline tables by condition, {study.unit}",
        ("order", *labels),
        tuple(lines),
        terminal=False,
    )


def _difference(order: Order, condition: str) -> str:
    return interval(order.standings.get(condition))


def _entry(order: Order, condition: str) -> str:
    """The difference with its interval, and the verdict."""
    text = _difference(order, condition)
    verdict = order.verdict(condition)
    # Bold is a type of text: the entry keeps that of the difference.
    return type(text)(f"{text} {verdict}") if verdict else text


def _level_table(
    study: RealismStudy,
    title: str,
    columns: Sequence[tuple[str, Callable[[_Block, str], str]]],
    terminal: bool = True,
) -> Table:
    """A column per heading and entry, a line per policy below its headline table."""
    lines: list[TableRow] = []
    for block in study.blocks:
        lines.append((", ".join(filter(None, (block.heading, block.label))),))
        lines += [
            (study.frame.marked(policy), *(entry(block, policy) for _, entry in columns))
            for policy in block.policies
        ]
    return Table(
        f"{study.title}: {title}, {study.shown}",
        ("policy", *(heading for heading, _ in columns)),
        tuple(lines),
        study.frame.notes(study.frame.tags),
        whole=("policy",),
        terminal=terminal,
    )
