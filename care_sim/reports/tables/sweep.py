"""Tables of a sweep: in every setting the levels of all policies, what CARE and the learned
policies have over each, and what each has over the best control.
"""

from collections.abc import Sequence

from care_sim.base.errors import percent
from care_sim.evaluation.censoring import Quartiles
from care_sim.reports.cells import Cell, summarise
from care_sim.reports.contrasts import (
    AVOIDED,
    BRAKED,
    DETECTED,
    DETECTION,
    Contrast,
    Measure,
    contrast,
    preventable,
)
from care_sim.reports.formatting import ends, interval, marked, spread, tag_notes, unsigned
from care_sim.reports.table import Table
from care_sim.reports.tables.controls import control_tables
from care_sim.study.designs.paper import (
    PAPER_EPISODES,
    PublishedResult,
    paper_cells,
    published_result,
)
from care_sim.study.rows.reading import Groups, Key, full_of, grouped
from care_sim.study.rows.settings import Setting
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
    cells = summarise(rows)
    groups = grouped(rows)
    tables = []
    for setting in dict.fromkeys(cell.setting for cell in cells):
        own = [cell for cell in cells if cell.setting == setting]
        tables += [
            levels_table(setting, own, groups),
            *sweep_contrast_tables(setting, own, groups),
            *control_tables(setting, own, groups),
        ]
    return tables


def sweep_minus(rows: Sequence[Row], policy: str) -> list[Table]:
    """One policy, named with its parameters, less every other, in every setting that has it."""
    cells = summarise(rows)
    groups = grouped(rows)
    tables = []
    for setting in dict.fromkeys(cell.setting for cell in cells if cell.policy == policy):
        own = [cell for cell in cells if cell.setting == setting]
        tags = _tags(setting, own, groups)
        if len(tags) > 1:
            tables.append(_contrast_table(setting, policy, own, groups, tags))
    return tables


def levels_table(setting: Setting, cells: Sequence[Cell], groups: Groups) -> Table:
    """Medians, counts and regret, one row per cell."""
    published = [_published(cell) for cell in cells]
    sentences = dict.fromkeys(f'Paper: "{result.sentence}"' for result in published if result)
    lines = (_line(cell, result) for cell, result in zip(cells, published, strict=True))
    missing = [] if full_of(groups, setting) else ["Regret: full not run."]
    notes = [*tag_notes(cell.tags for cell in cells), *missing, *_nobody_notes(setting, cells)]
    # A terminal has no room for columns of zeros.
    counted = {"never": [cell.never for cell in cells], "collisions": [c.collisions for c in cells]}
    hidden = (*_FILES_ONLY, *(column for column, counts in counted.items() if not any(counts)))
    return Table(
        setting.label,
        SWEEP_COLUMNS,
        tuple(lines),
        tuple(notes),
        tuple(sentences),
        hidden,
        _WHOLE,
    )


def sweep_contrast_tables(setting: Setting, cells: Sequence[Cell], groups: Groups) -> list[Table]:
    """CARE minus every other policy, then the same of every learned one; none for a policy that ran
    alone.
    """
    tags = _tags(setting, cells, groups)
    # A map that serves as a control is held against the others in the table of controls.
    learned = [name for name in tags if "learned" in tags[name] and "control" not in tags[name]]
    named = [policy for policy in (REFERENCE, *learned) if policy in tags and len(tags) > 1]
    return [_contrast_table(setting, policy, cells, groups, tags) for policy in named]


def _tags(setting: Setting, cells: Sequence[Cell], groups: Groups) -> dict[str, tuple[str, ...]]:
    """The policies of a setting with their tags, and the full scan."""
    # The full scan of the same worlds may stand in another setting, of which it feels the same.
    full: dict[str, tuple[str, ...]] = {FULL: ()} if full_of(groups, setting) else {}
    return {cell.policy: cell.tags for cell in cells} | full


def _contrast_table(
    setting: Setting,
    reference: str,
    cells: Sequence[Cell],
    groups: Groups,
    tags: dict[str, tuple[str, ...]],
) -> Table:
    """The reference minus the others: policies by budgets, one block per measure."""
    # The budgets of the reference: at others there is nothing to compare with.
    budgets = sorted({cell.budget for cell in cells if cell.policy == reference})
    lines: list[tuple[str, ...]] = []
    for measure in _measures(cells):
        lines.append((f"{_name(measure, setting, groups)}, {measure.unit}",))
        for policy in (policy for policy in tags if policy != reference):
            pairs = [
                ((setting, reference, budget), (setting, policy, budget)) for budget in budgets
            ]
            lines.append(
                (
                    marked(policy, tags[policy]),
                    *(interval(_ahead(measure, *pair, groups)) for pair in pairs),
                )
            )
    columns = (f"{reference} minus", *map(percent, budgets))
    title = f"{setting.label}: {reference} minus each policy"
    return Table(
        title, columns, tuple(lines), tag_notes(cell.tags for cell in cells), whole=columns[:1]
    )


def _measures(cells: Sequence[Cell]) -> list[Measure]:
    """What is compared: detections and collisions where any policy has some."""
    further = (
        (DETECTED, any(cell.never for cell in cells)),
        (AVOIDED, any(cell.collisions for cell in cells)),
    )
    return [DETECTION, BRAKED, *(measure for measure, differs in further if differs)]


def _name(measure: Measure, setting: Setting, groups: Groups) -> str:
    """The name of a measure; that of collisions tells whether it counts the preventable alone."""
    if measure is AVOIDED and full_of(groups, setting):
        return f"Preventable {measure.name.lower()}"
    return measure.name


def _ahead(measure: Measure, ours: Key, theirs: Key, groups: Groups) -> Contrast | None:
    """What a policy has over another at the same budget, or over the full scan; of collisions, on
    the seeds on which the full scan has none, if it was played.
    """
    setting, policy, _ = theirs
    full = full_of(groups, setting)
    # The full scan has one budget, and is held against every budget of the others.
    rows = groups.get(ours, ()), full or () if policy == FULL else groups.get(theirs, ())
    if measure is AVOIDED and full:
        rows = preventable(full, rows[0]), preventable(full, rows[1])
    return contrast(measure, *rows)


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


def _nobody_notes(setting: Setting, cells: Sequence[Cell]) -> list[str]:
    """How many episodes first detections leave out, where there are any."""
    left_out = sorted({(cell.episodes - cell.met, cell.episodes) for cell in cells})
    named = [f"{count} of {all_of}" for count, all_of in left_out if count]
    if not named:
        return []
    # Rows of other worlds lack the actor for reasons of their own.
    why = ", since the drive meets nobody" if setting.world == "drive" else ""
    return [
        f"{', '.join(named)} episodes have no first-sighting actor{why}: first detection, never "
        "and regret leave them out."
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
