"""The tables of the paper's ablations (Sec. 5.4) in the closed loop: one table per ablation."""

from collections.abc import Iterator, Sequence
from itertools import product

from care_sim.reports.cells import Cell, StudyCells
from care_sim.reports.formatting import interval, median, quarters
from care_sim.reports.table import Table
from care_sim.study.designs.ablations import ABLATION_PLACES, ABLATIONS, Ablation
from care_sim.study.designs.variants import USUAL_VARIANT, Place, Variant
from care_sim.study.run_config import Row

_LEVEL_COLUMNS = ("level", "first detection m", "quartiles m", "braked")
_FILES_ONLY = _LEVEL_COLUMNS[2:]


def ablation_tables(rows: Sequence[Row]) -> list[Table]:
    """One table per ablation: levels and paired differences, place by place."""
    study = StudyCells(rows)
    return [_table(ablation, study) for ablation in ABLATIONS]


def _table(ablation: Ablation, study: StudyCells) -> Table:
    beside = _beside(ablation, study)
    columns = (
        *_LEVEL_COLUMNS,
        "minus usual",
        *(f"minus {study.marked(policy)}" for policy in beside),
    )
    lines = [line for place in ABLATION_PLACES for line in _block(ablation, place, beside, study)]
    notes = (*ablation.notes, *study.notes(beside))
    return Table(
        f"{ablation.policy}: {ablation.title}",
        columns,
        tuple(lines),
        notes,
        (),
        _FILES_ONLY,
        _LEVEL_COLUMNS,
    )


def _block(
    ablation: Ablation, place: Place, beside: Sequence[str], study: StudyCells
) -> Iterator[tuple[str, ...]]:
    yield (str(place),)
    usual = USUAL_VARIANT.key(place, ablation.policy)
    for level in ablation.levels:
        ours = level.key(place, ablation.policy)
        # The others feel the conditions of a level and not its parameters, which are the own ones
        # of the policy.
        others = (level.for_others().key(place, policy) for policy in beside)
        # The usual level is played once and stands in every ablation, compared with nothing.
        name = f"{level.label} (usual)" if ours == usual else level.label
        change = "" if ours == usual else interval(study.difference(ours, usual))
        yield (
            name,
            *_levels(study.cell(ours)),
            change,
            *(interval(study.difference(ours, o)) for o in others),
        )


def _beside(ablation: Ablation, study: StudyCells) -> list[str]:
    """The references, and the further policies that were played where conditions depart from the
    usual.
    """
    # A policy that was played under usual conditions alone belongs to no ablation. One that was
    # played where some condition departs was asked for.
    known = (ablation.policy, *ablation.references, "full")
    usual = USUAL_VARIANT.key(ABLATION_PLACES[0], "care")
    levels = [
        other
        for other in map(Variant.for_others, ablation.levels)
        if other.key(ABLATION_PLACES[0], "care") != usual
    ]
    joined = [
        policy
        for policy in study.policies
        if policy not in known
        and any(study.has(o.key(p, policy)) for o, p in product(levels, ABLATION_PLACES))
    ]
    return [*ablation.references, *joined]


def _levels(cell: Cell | None) -> tuple[str, str, str]:
    if cell is None:
        return "", "", ""
    return median(cell.detection), quarters(cell.detection), f"{cell.braked}/{cell.episodes}"
