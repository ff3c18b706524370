"""Tables of a sweep: in every setting the levels of all policies, what CARE and the learned
policies have over each, and what each has over the best control.
"""

from collections.abc import Sequence

from care_sim.base.errors import percent
from care_sim.evaluation.censoring import Quartiles
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.levels import Cell, levels
from care_sim.reports.engine.measures import BRAKED, DETECTED, DETECTION
from care_sim.reports.engine.parts import Part, parts
from care_sim.reports.engine.tables import control_tables, minus_tables
from care_sim.reports.engine.varied import Varied
from care_sim.reports.formatting import ends, marked, spread, unsigned
from care_sim.reports.table import Table
from care_sim.study.designs.firing import AWARE, rows_by_firing
from care_sim.study.designs.paper import (
    PAPER_EPISODES,
    PublishedResult,
    paper_cells,
    published_result,
)
from care_sim.study.run_config import FULL, REFERENCE, Row

_FILES_ONLY = ("pass m", "clearance m", "interval", "as full")
"""Columns that 80 characters of a terminal leave no room for."""


def sweep_tables(rows: Sequence[Row]) -> list[Table]:
    """Levels and contrasts, one setting after the other."""
    tables = []
    for part in parts(rows):
        cells = levels(part.frame, part.setting)
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
    return [
        table
        for part in parts(rows)
        if policy in part.tags
        for table in _minus(part, policy, levels(part.frame, part.setting))
    ]


def _minus(part: Part, base: str, cells: Sequence[Cell]) -> list[Table]:
    """The base minus every other policy and the full scan, in detections and collisions where any
    policy has some.
    """
    played = [*dict.fromkeys(cell.policy for cell in cells if cell.policy != FULL)]
    others = [policy for policy in (*played, *([FULL] if part.full else [])) if policy != base]
    further = {
        DETECTED: any(cell.never for cell in cells),
        part.avoided: any(cell.collisions for cell in cells),
    }
    measures = [DETECTION, BRAKED, *(measure for measure, differs in further.items() if differs)]
    return minus_tables(part, base, others, measures)


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
    quotes = dict.fromkeys(f'Paper: "{result.sentence}"' for result in published if result)
    lines = [_line(cell, result) for cell, result in zip(cells, published, strict=True)]
    columns = tuple(lines[0])
    missing = "" if part.full else "Regret: full not run."
    # A terminal has no room for columns of zeros.
    zeros = [
        column
        for column, counts in (
            ("never", [cell.never for cell in cells]),
            ("collisions", [cell.collisions for cell in cells]),
        )
        if not any(counts)
    ]
    return Table(
        part.setting.label,
        columns,
        tuple(tuple(line.values()) for line in lines),
        (f"{missing} {_nobody_note(cells)}".strip(),),
        tuple(quotes),
        files_only=(*_FILES_ONLY, *zeros),
        whole=tuple(column for column in columns if column not in ("policy", "paper")),
    )


def _published(cell: Cell) -> PublishedResult | None:
    # Other physics or conditions than the paper's are no cell of its study, even where the
    # scenario, policy and budget are.
    if cell.key not in paper_cells():
        return None
    return published_result(cell.setting.world, cell.policy, cell.budget, cell.setting.faults)


def _line(cell: Cell, published: PublishedResult | None) -> dict[str, str]:
    """The entries of a row by column."""
    regret = cell.regret
    return {
        "budget": percent(cell.budget),
        "policy": marked(cell.policy, cell.tags),
        "first detection m": spread(cell.detection),
        "never": f"{cell.never}/{cell.met}",
        "braked": f"{cell.braked}/{cell.episodes}",
        "pass m": _median(cell.closest_pass, cell),
        "clearance m": _median(cell.clearance, cell),
        "collisions": f"{cell.collisions}/{cell.episodes}",
        "regret m": unsigned(regret),
        "interval": ends(regret),
        "as full": f"{cell.as_full}/{regret.difference.pairs}" if regret else "",
        "paper": _paper(published) if published else "",
    }


def _paper(result: PublishedResult) -> str:
    """The paper's words where it gives no number; else its first detection, and how many episodes
    braked where it tells.
    """
    if result.relation:
        return result.relation.value
    braked = "" if result.braked is None else f", {result.braked}/{PAPER_EPISODES}"
    return f"{result.detection_m:g}{braked}"


def _nobody_note(cells: Sequence[Cell]) -> str:
    """How many episodes first detections leave out, where there are any."""
    left_out = sorted({(cell.episodes - cell.met, cell.episodes) for cell in cells})
    named = ", ".join(f"{count} of {all_of}" for count, all_of in left_out if count)
    rest = "episodes have no first-sighting actor: first detection, never and regret leave them out"
    return f"{named} {rest}." if named else ""


def _median(values: Quartiles | None, cell: Cell) -> str:
    if values is None:
        return "never in view"
    # Fewer values than episodes: the actor never came into view in the others.
    of = f" (of {values.count})" if values.count < cell.episodes else ""
    return f"{values.median:.1f}{of}"


def firing_tables(rows: Sequence[Row]) -> list[Table]:
    """The levels of all cells by hardware, and the lead of the policy that knows its hardware over
    the other policies at the same budget.
    """
    frames = {firing: Frame(own) for firing, own in rows_by_firing(rows).items()}
    varied = Varied("hardware", frames)
    return [varied.levels(), *varied.leads(AWARE)]
