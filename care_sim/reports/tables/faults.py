"""Detection, braking and clearance under growing faults, and changes in the order of policies."""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.levels import Cell, level_of
from care_sim.reports.engine.measures import DETECTION
from care_sim.reports.engine.tables import under_headings
from care_sim.reports.formatting import interval, median
from care_sim.reports.table import Bold, Table, TableRow
from care_sim.study.designs.faults import (
    FAULT_PLACES,
    FAULT_POLICIES,
    FAULTS,
    Fault,
    faults_alone,
)
from care_sim.study.designs.variants import Place, Variant
from care_sim.study.run_config import Row

_PAIRS = (("care", "history"), ("care", "all-camera"), ("all-camera", "history"))
_ORDER = "First strength, then changes. >: detects earlier by the gate; <: later; =: neither."
_MEASURES: Mapping[str, Callable[[Cell], str]] = {
    "first detection, m": lambda cell: median(cell.detection),
    "braked": lambda cell: f"{cell.braked}/{cell.episodes}",
    "clearance, m": lambda cell: median(cell.clearance),
}


def pairs_of(study: Frame) -> list[tuple[str, str]]:
    """The pairs of policies whose order is followed."""
    return [
        *_PAIRS,
        *(("care", policy) for policy in study.policies if policy not in FAULT_POLICIES),
    ]


def policies_of(study: Frame) -> list[str]:
    """The policies of the study, then those that joined in."""
    return list(dict.fromkeys([*FAULT_POLICIES, *study.policies]))


def fault_tables(rows: Sequence[Row]) -> list[Table]:
    """Where the order changes, then one table per fault with levels and paired differences."""
    study = Frame(faults_alone(rows))
    marks = study.notes(study.policies)
    pairs = pairs_of(study)
    orders = {
        str(place): [
            (fault.label, *(order(pair, fault, place, study) for pair in pairs)) for fault in FAULTS
        ]
        for place in FAULT_PLACES
    }
    columns = ("fault", *(" : ".join(map(study.marked, pair)) for pair in pairs))
    title = "Where the order of policies changes"
    return [
        Table(title, columns, under_headings(orders), (_ORDER, *marks)),
        *(
            Table(
                fault.title,
                (fault.unit, *(level.label for level in fault.levels)),
                under_headings(_blocks(fault, study)),
                (*fault.notes, *marks),
                terminal=False,
            )
            for fault in FAULTS
        ),
    ]


def order(pair: tuple[str, str], fault: Fault, place: Place, study: Frame) -> str:
    """Return the order of two policies under a growing fault, bold if it changes.

    '>' if the first detects earlier by a difference that counts, '<' if the second does, '='
    otherwise. Strengths that were not played are skipped.
    """
    found = [(level.label, _difference(pair, level, place, study)) for level in fault.levels]
    # The sign of the first strength that was played, then each strength at which it turns. By the
    # gate, not by the interval alone: a sure difference of a few centimetres is no order.
    signs = [
        (label, "=" if not each.counts else ">" if each.mean > 0 else "<")
        for label, each in found
        if each
    ]
    changes = [
        f"{sign} from {label}" for (_, before), (label, sign) in pairwise(signs) if sign != before
    ]
    text = ", ".join([*(sign for _, sign in signs[:1]), *changes])
    return Bold(text) if changes else text


def _difference(
    pair: tuple[str, str], level: Variant, place: Place, study: Frame
) -> Contrast | None:
    ours, theirs = (level.key(place, policy) for policy in pair)
    return study.contrast(DETECTION, ours, theirs)


def _blocks(fault: Fault, study: Frame) -> dict[str, list[TableRow]]:
    """Return per place a block of policies for each measure, and one of paired differences."""
    policies = policies_of(study)
    blocks: dict[str, list[TableRow]] = {}
    # All measures of a place before the next place: they are read together.
    for place in FAULT_PLACES:
        for name, entry in _MEASURES.items():
            blocks[f"{place}: {name}"] = own = []
            for policy in policies:
                cells = (level_of(study, level.key(place, policy)) for level in fault.levels)
                own.append((study.marked(policy), *(entry(c) if c else "" for c in cells)))
        blocks[f"{place}: first detection of care minus, m"] = own = []
        for policy in (each for each in policies if each != "care"):
            found = (_difference(("care", policy), level, place, study) for level in fault.levels)
            own.append((study.marked(policy), *map(interval, found)))
    return blocks
