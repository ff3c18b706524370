"""The study of realism in either loop: what a headline table holds, under every condition."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from care_sim.base.errors import percent
from care_sim.reports.engine.contrasts import Contrast, contrast
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.levels import level
from care_sim.reports.engine.measures import AVOIDED, DETECTION, OPEN_LOOP, Measure, Recall, Units
from care_sim.reports.realism.orders import Order, Standing
from care_sim.study.designs.defaults import FILM_POLICIES
from care_sim.study.designs.realism import (
    CONDITIONS,
    FILM_CAMERA,
    FILM_CONDITIONS,
    FILM_PAIRS,
    HEADLINES,
    IDEAL,
    LATE_CAMERA,
    LATE_FILM_CAMERA,
    Pair,
)
from care_sim.study.designs.variants import FilmPlace, Place, Variant
from care_sim.study.rows.reading import READ_WITH
from care_sim.study.run_config import FULL, REFERENCE, Row

_OF_THE_FILM = ("sensor", "sensor_hash", *READ_WITH)
"""Columns of a source, which are no conditions."""


@dataclass(frozen=True)
class Block:
    """A headline table, or a measure of the open loop at a budget: its policies, and the pairs
    whose order it tells.

    `name` is the heading of its levels, `label` names its orders; `group` is the measure where
    several are told. Of several places these are drawn, and not their seeds.
    """

    frame: Frame
    name: str
    group: str
    label: str
    measure: Measure | Recall
    places: Sequence[Place | FilmPlace]
    policies: Sequence[str]
    pairs: Sequence[Pair]

    def units(self, condition: Variant, policy: str) -> Units:
        """What was measured of a policy, by place, and by seed or scene."""
        # The full scan is found from every setting, whatever it feels of it.
        keys = [(place.budget, condition.key(place, REFERENCE)[0]) for place in self.places]
        return {
            (number, unit): value
            for number, (budget, setting) in enumerate(keys)
            for unit, value in self.frame.units(self.measure, (setting, policy, budget)).items()
        }

    def contrast(self, ours: Units, theirs: Units) -> Contrast | None:
        """`ours` minus `theirs`; None where one of them was not played."""
        return contrast(self.measure, ours, theirs, by_cases=len(self.places) > 1)

    def level(self, condition: Variant, policy: str) -> str:
        """The figure of a policy; empty where it was not played."""
        return level(self.measure, self.units(condition, policy))

    def change(self, condition: Variant, policy: str) -> Contrast | None:
        """What the condition adds to the measure of a policy."""
        return self.contrast(self.units(condition, policy), self.units(IDEAL, policy))

    def order(self, pair: Pair, conditions: Sequence[Variant]) -> Order:
        """How the first policy stands to the second under every condition."""
        found = {
            each.label: Standing.of(one)
            for each in conditions
            if (one := self.contrast(*(self.units(each, policy) for policy in pair)))
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
        blocks = _film_blocks(self.frame) if open_loop else _headline_blocks(self.frame)
        self.blocks = [block for each in blocks if (block := _as_played(each))]
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


def _as_played(block: Block) -> Block | None:
    """The block with the policies that were played, and CARE beside each that joined in; None of a
    full scan alone, which is of every table of its scenario.
    """
    every = dict.fromkeys([*block.policies, *(policy for _, policy, _ in block.frame.groups)])
    policies = [policy for policy in every if block.units(IDEAL, policy)]
    joined = [policy for policy in policies if policy not in block.policies]
    pairs = [*block.pairs, *((REFERENCE, policy) for policy in joined)]
    return replace(block, policies=policies, pairs=pairs) if {*policies} - {FULL} else None


def _headline_blocks(frame: Frame) -> Iterator[Block]:
    for each in HEADLINES:
        measure = AVOIDED if each.by_collisions else DETECTION
        yield Block(
            frame, each.name, "", each.name, measure, each.places, each.policies, each.pairs
        )


def _film_blocks(frame: Frame) -> Iterator[Block]:
    """First-sighting and overall recall at every budget."""
    row = frame.rows[0]
    shared = tuple((name, row.get(name)) for name in _OF_THE_FILM)
    budgets = sorted({budget for _, policy, budget in frame.groups if policy != FULL})
    for measure in OPEN_LOOP.measures:
        for budget in budgets:
            place, label = FilmPlace(row["source"], budget, shared), percent(budget)
            yield Block(
                frame,
                f"{measure.heading}, {label}",
                measure.heading,
                label,
                measure,
                [place],
                FILM_POLICIES,
                FILM_PAIRS,
            )
