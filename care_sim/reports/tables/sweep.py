"""Tables of a sweep: in every setting the levels of all policies, what CARE and the learned
policies have over each, and what each has over the best control.
"""

from collections.abc import Sequence

from care_sim.base.errors import percent
from care_sim.evaluation.censoring import Quartiles
from care_sim.reports.engine.levels import Cell, level_of
from care_sim.reports.engine.measures import BRAKED, DETECTED, DETECTION, Measure
from care_sim.reports.engine.parts import Part, parts
from care_sim.reports.engine.tables import control_tables, minus_tables
from care_sim.reports.formatting import ends, marked, spread, unsigned
from care_sim.reports.table import Table
from care_sim.study.designs.paper import (
    PAPER_EPISODES,
    PublishedResult,
    paper_cells,
    published_result,
)
from care_sim.study.run_config import FULL, REFERENCE, Row

SWEEP_COLUMNS = (
    "budget",
    "policy",
    "first detection m",
    "never",
    "braked",
    "pass m",
    "clearance m",
    "collisions",
    "regret m",
    "interval",
    "as full",
    "paper",
)
_FILES_ONLY = ("pass m", "clearance m", "interval", "as full")
"""Columns that 80 characters of a terminal leave no room for."""
_WHOLE = tuple(column for column in SWEEP_COLUMNS if column not in ("policy", "paper"))


def sweep_tables(rows: Sequence[Row]) -> list[Table]:
    """Levels and contrasts, one setting after the other."""
    tables = []
    for part in parts(rows):
        cells = _cells(part)
        # A map that serves as a control is held against the others in the table of controls.
        learned = [
            p for p, tags in part.tags.items() if "learned" in tags and "control" not in tags
        ]
        named = [policy for policy in (REFERENCE, *learned) if policy in part.tags]
        tables += [
            _levels_table(part, cells),
            *(table for policy in named for table in _minus(part, policy, cells)),
            *_over_controls(part),
        ]
    return tables


def sweep_minus(rows: Sequence[Row], policy: str) -> list[Table]:
    """One policy, named with its parameters, less every other, in every setting that has it."""
    own = [part for part in parts(rows) if policy in part.tags]
    return [table for part in own for table in _minus(part, policy, _cells(part))]


def _cells(part: Part) -> list[Cell]:
    """The cells of the setting by budget; its full scan comes last."""
    keys = sorted(
        (key for key in part.frame.groups if key[0] == part.setting), key=lambda key: key[2]
    )
    return [cell for key in keys if (cell := level_of(part.frame, key))]


def _minus(part: Part, base: str, cells: Sequence[Cell]) -> list[Table]:
    """The base minus every other policy and the full scan; none of a policy that ran alone."""
    played = dict.fromkeys([*(cell.policy for cell in cells), *([FULL] if part.full else [])])
    others = [policy for policy in played if policy != base]
    return minus_tables(part, base, others, _measures(part, cells))


def _measures(part: Part, cells: Sequence[Cell]) -> list[Measure]:
    """What is compared: detections and collisions where any policy has some."""
    further = (
        (DETECTED, any(cell.never for cell in cells)),
        (part.avoided, any(cell.collisions for cell in cells)),
    )
    return [DETECTION, BRAKED, *(measure for measure, differs in further if differs)]


def _over_controls(part: Part) -> list[Table]:
    """First detection of every other policy and of the full scan less that of the best control;
    none without a control or another policy.
    """
    rivals = [policy for policy in part.policies if policy not in part.controls]
    others = [*rivals, *([FULL] if part.full else [])]
    if not part.controls or not others:
        return []
    return control_tables(part, [part.over_control(DETECTION, others)])


def _levels_table(part: Part, cells: Sequence[Cell]) -> Table:
    """Medians, counts and regret, one row per cell."""
    published = [_published(cell) for cell in cells]
    sentences = dict.fromkeys(f'Paper: "{result.sentence}"' for result in published if result)
    lines = (_line(cell, result) for cell, result in zip(cells, published, strict=True))
    missing = [] if part.full else ["Regret: full not run."]
    told = " ".join([*missing, *_nobody_notes(cells)])
    # A terminal has no room for columns of zeros.
    counted = {"never": [cell.never for cell in cells], "collisions": [c.collisions for c in cells]}
    hidden = (*_FILES_ONLY, *(column for column, counts in counted.items() if not any(counts)))
    return Table(
        part.setting.label,
        SWEEP_COLUMNS,
        tuple(lines),
        (*part.notes, *([told] if told else [])),
        tuple(sentences),
        hidden,
        _WHOLE,
    )


def _published(cell: Cell) -> PublishedResult | None:
    # Other physics or conditions than the paper's are no cell of its study, even where the
    # scenario, policy and budget are.
    if (cell.setting, cell.policy, cell.budget) not in paper_cells():
        return None
    return published_result(cell.setting.world, cell.policy, cell.budget, cell.setting.faults)


def _line(cell: Cell, published: PublishedResult | None) -> tuple[str, ...]:
    return (
        percent(cell.budget),
        marked(cell.policy, cell.tags),
        spread(cell.detection),
        f"{cell.never}/{cell.met}",
        _share(cell.braked, cell),
        _median(cell.closest_pass, cell),
        _median(cell.clearance, cell),
        _share(cell.collisions, cell),
        unsigned(cell.regret),
        ends(cell.regret) if cell.regret else "",
        f"{cell.as_full}/{cell.regret.difference.pairs}" if cell.regret else "",
        _paper(published) if published else "",
    )


def _paper(result: PublishedResult) -> str:
    """The paper's words where it gives no number; else its first detection, and how many episodes
    braked where it tells.
    """
    if result.relation:
        return result.relation.value
    braked = "" if result.braked is None else f", {result.braked}/{PAPER_EPISODES}"
    return f"{result.detection_m:g}{braked}"


def _nobody_notes(cells: Sequence[Cell]) -> list[str]:
    """How many episodes first detections leave out, where there are any."""
    left_out = sorted({(cell.episodes - cell.met, cell.episodes) for cell in cells})
    named = [f"{count} of {all_of}" for count, all_of in left_out if count]
    if not named:
        return []
    return [
        f"{', '.join(named)} episodes have no first-sighting actor: first detection, never and "
        "regret leave them out."
    ]


def _share(count: int, cell: Cell) -> str:
    return f"{count}/{cell.episodes}"


def _median(values: Quartiles | None, cell: Cell) -> str:
    if values is None:
        return "never in view"
    # Fewer values than episodes: the actor never came into view in the others.
    return f"{values.median:.1f}" + (
        f" (of {values.count})" if values.count < cell.episodes else ""
    )
