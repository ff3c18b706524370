"""How detection, braking and clearance hold up as every fault grows, and where the order of
policies changes.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise

from care_sim.reports.cells import Cell, StudyCells
from care_sim.reports.contrasts import Contrast
from care_sim.reports.formatting import interval, median
from care_sim.reports.table import Bold, Table
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
_ORDER = (
    "How the first named stands to the second at the first strength, and from which strength on "
    "otherwise. > : it detects earlier, interval without zero and gate met; < : it detects later, "
    "likewise; = : neither."
)


def pairs_of(study: StudyCells) -> list[tuple[str, str]]:
    """The pairs of policies whose order is followed."""
    return [
        *_PAIRS,
        *(("care", policy) for policy in study.policies if policy not in FAULT_POLICIES),
    ]


def policies_of(study: StudyCells) -> list[str]:
    """The policies of the study, then those that joined in."""
    return list(dict.fromkeys([*FAULT_POLICIES, *study.policies]))


def fault_tables(rows: Sequence[Row]) -> list[Table]:
    """Where the order changes, then one table per fault with levels and paired differences."""
    study = StudyCells(faults_alone(rows))
    return [_order_table(study), *(_fault_table(fault, study) for fault in FAULTS)]


def order(pair: tuple[str, str], fault: Fault, place: Place, study: StudyCells) -> str:
    """How two policies stand as the fault grows, bold when that changes.

    '>' where the first detects earlier by a difference that counts, '<' where the second does, '='
    elsewhere. Strengths that were not played are passed over.
    """
    found = [(level.label, _difference(pair, level, place, study)) for level in fault.levels]
    # The sign of the first strength that was played, then each strength at which it turns.
    signs = [(label, _sign(difference)) for label, difference in found if difference]
    changes = [
        f"{sign} from {label}" for (_, before), (label, sign) in pairwise(signs) if sign != before
    ]
    text = ", ".join([*(sign for _, sign in signs[:1]), *changes])
    return Bold(text) if changes else text


def _difference(
    pair: tuple[str, str], level: Variant, place: Place, study: StudyCells
) -> Contrast | None:
    ours, theirs = (level.key(place, policy) for policy in pair)
    return study.difference(ours, theirs)


def _sign(difference: Contrast) -> str:
    # By the gate, not by the interval alone: a sure difference of a few centimetres is no order.
    return "=" if not difference.counts else ">" if difference.mean > 0 else "<"


def _order_table(study: StudyCells) -> Table:
    pairs = pairs_of(study)
    lines: list[tuple[str, ...]] = []
    for place in FAULT_PLACES:
        lines.append((str(place),))
        lines += [
            (fault.label, *(order(pair, fault, place, study) for pair in pairs)) for fault in FAULTS
        ]
    columns = ("fault", *(" : ".join(map(study.marked, pair)) for pair in pairs))
    return Table(
        "Where the order of policies changes",
        columns,
        tuple(lines),
        (_ORDER, *study.notes(study.policies)),
    )


def _fault_table(fault: Fault, study: StudyCells) -> Table:
    columns = (fault.unit, *(level.label for level in fault.levels))
    lines = [line for place in FAULT_PLACES for line in _blocks(fault, place, study)]
    notes = (*fault.notes, *study.notes(study.policies))
    return Table(fault.title, columns, tuple(lines), notes, terminal=False)


def _blocks(fault: Fault, place: Place, study: StudyCells) -> Iterator[tuple[str, ...]]:
    """A block of policies for each measure, and one of paired differences."""
    # All measures of a place before the next place: they are read together.
    for name, entry in (
        ("first detection, m", _detection),
        ("braked", _braked),
        ("clearance, m", _clearance),
    ):
        yield (f"{place}: {name}",)
        for policy in policies_of(study):
            cells = (study.cell(level.key(place, policy)) for level in fault.levels)
            yield (study.marked(policy), *(entry(cell) if cell else "" for cell in cells))
    yield (f"{place}: first detection of care minus, m",)
    for policy in policies_of(study):
        if policy != "care":
            differences = (
                _difference(("care", policy), level, place, study) for level in fault.levels
            )
            yield (study.marked(policy), *map(interval, differences))


def _detection(cell: Cell) -> str:
    return median(cell.detection)


def _braked(cell: Cell) -> str:
    return f"{cell.braked}/{cell.episodes}"


def _clearance(cell: Cell) -> str:
    return median(cell.clearance)
