"""Tables of a study, as pure functions of its rows; printed on a terminal or written as Markdown."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

from rich.table import Table as RichTable
from rich.text import Text

from care_sim.evaluation.bootstrap import Interval
from care_sim.study import crowding
from care_sim.study.episode import Row
from care_sim.study.paper import NO_COLLISION, Published, configurations, published
from care_sim.study.summary import (
    Cell,
    Quartiles,
    Setting,
    detection_distance,
    difference,
    policy_of,
    quartiles,
    setting_of,
    summarise,
)

CAPTION = (
    "First detection: planar distance in metres from the sensor to the first-sighting actor at the first keyframe it "
    "is detected; median [quartiles]. An actor never detected ranks as 0 m, later than any detection, and is counted "
    "under 'never'. Pass: least distance of the centres, clearance: hull to hull, both from the moment it is in view; "
    "medians. k/n: k of n episodes, one a seed. 'vs full' and 'vs care': mean first-detection distance of this policy "
    "minus that one, in metres, paired by seed, with 95% percentile bootstrap intervals (10,000 resamples); positive: "
    "this policy detects earlier. The ego covers 0.8 m of road a keyframe, so differences come in such steps; with "
    "fewer than 10 seeds an interval shows the spread of the seeds rather than certainty."
)
COLUMNS = (
    "budget",
    "policy",
    "first detection m",
    "never",
    "braked",
    "pass m",
    "clearance m",
    "collisions",
    "vs full m",
    "vs care m",
    "paper",
)
WIDE_ONLY = ("clearance m", "collisions", "vs full m")
"""Columns that 80 characters of a terminal leave no room for."""
COLLAPSE_M = 3.0
"""All-camera counts as collapsed where CARE detects this much earlier."""


@dataclass(frozen=True)
class Table:
    """Cells of text under a title, with notes below; `quotes` are for files only."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    quotes: tuple[str, ...] = ()

    def rich(self) -> RichTable:
        """For a terminal of 80 characters: without the columns that are for files or that say nothing."""
        caption = Text("\n".join(self.notes))
        table = RichTable(box=None, padding=(0, 1, 0, 0), title=Text(self.title), title_justify="left")
        table.caption, table.caption_justify = caption, "left"
        shown = [n for n, name in enumerate(self.columns) if name not in WIDE_ONLY and self._says_something(n)]
        for n in shown:
            name = self.columns[n]
            heading = name.replace("pass m", "pass\nm").replace("budget", "at")
            table.add_column(
                Text(heading), no_wrap=name in COLUMNS and name != "policy", overflow="fold", vertical="bottom"
            )
        for row in self.rows:
            table.add_row(*(Text(row[n]) for n in shown))
        return table

    def _says_something(self, column: int) -> bool:
        return any(
            row[column] and not (self.columns[column] == "never" and row[column][:2] == "0/") for row in self.rows
        )

    def markdown(self) -> str:
        """For a file."""
        lines = [self.columns, tuple("---" for _ in self.columns), *self.rows]
        body = "\n".join("| " + " | ".join(line) + " |" for line in lines)
        return "\n\n".join([f"## {self.title}", body, *self.notes, *self.quotes]) + "\n"


def study_tables(rows: Sequence[Row]) -> list[Table]:
    """One table a setting, or the table of the crowding study when the rows vary the number of vehicles."""
    if len({row.get(crowding.COLUMN) for row in rows}) > 1:
        return [crowding_table(rows)]
    cells = summarise(rows)
    settings = list(dict.fromkeys(cell.setting for cell in cells))
    return [_setting_table(setting, [cell for cell in cells if cell.setting == setting]) for setting in settings]


def _setting_table(setting: Setting, cells: Sequence[Cell]) -> Table:
    sayings = [_published(cell) for cell in cells]
    sentences = dict.fromkeys(f'Paper: "{saying.sentence}"' for saying in sayings if saying)
    lines = (_line(cell, saying) for cell, saying in zip(cells, sayings, strict=True))
    notes = () if any(cell.vs_full for cell in cells) else ("vs full: full not run.",)
    return Table(setting.label, COLUMNS, tuple(lines), notes, tuple(sentences))


def _published(cell: Cell) -> Published | None:
    if (cell.setting, cell.policy, cell.budget) not in paper_cells():
        return None
    return published(cell.setting.scenario, cell.policy, cell.budget, cell.setting.faults)


@cache
def paper_cells() -> frozenset[tuple[Setting, str, float]]:
    """Setting, policy and budget of every cell of the paper's study."""
    rows = [config.row() for config in configurations([0])]
    return frozenset((setting_of(row), policy_of(row), row["budget"]) for row in rows)


def _line(cell: Cell, saying: Published | None) -> tuple[str, ...]:
    return (
        percent(cell.budget),
        cell.policy,
        f"{cell.detection.median:.1f} [{cell.detection.low:.1f}, {cell.detection.high:.1f}]",
        _share(cell.never, cell),
        _share(cell.braked, cell),
        _median(cell.closest_pass, cell),
        _median(cell.clearance, cell),
        _share(cell.collisions, cell),
        _interval(cell.vs_full),
        _interval(cell.vs_care),
        saying.figure if saying else "",
    )


def percent(budget: float) -> str:
    """A budget as people read it."""
    return f"{100 * budget:.3g}%"


def _share(count: int, cell: Cell) -> str:
    return f"{count}/{cell.episodes}"


def _median(values: Quartiles | None, cell: Cell) -> str:
    if values is None:
        return "never in view"
    return f"{values.median:.1f}" + (f" (of {values.count})" if values.count < cell.episodes else "")


def _interval(interval: Interval | None) -> str:
    return f"{interval.mean:+z.1f} [{interval.low:+z.1f}, {interval.high:+z.1f}]" if interval else ""


def collision_note(rows: Sequence[Row]) -> str:
    """Collisions over all rows, beside what the paper says of them."""
    return f'Collisions: {sum(row["collision"] for row in rows)} in {len(rows)} episodes. Paper: "{NO_COLLISION}"'


def crowding_table(rows: Sequence[Row]) -> Table:
    """Median first detection of care and all-camera by standing vehicles and budget, and their difference."""
    by_cell = _by_vehicles(rows)
    budgets = sorted({budget for _, policy, budget in by_cell if policy != "full"})
    counts = sorted({vehicles for vehicles, _, _ in by_cell})
    lines = [
        (str(n), _plain_median(by_cell.get((n, "full", 1.0))), *(_contrast(by_cell, n, budget) for budget in budgets))
        for n in counts
    ]
    columns = ("vehicles", "full m", *map(percent, budgets))
    collapsed = [f"{percent(budget)}: {_collapsed(by_cell, counts, budget)}" for budget in budgets]
    reading = "At each budget: medians of care/all-camera in metres, and all-camera vs care."
    note = (
        f"All-camera at least {COLLAPSE_M:.0f} m later than care on average, by budget, at these numbers of vehicles: "
    )
    return Table("dense, by standing vehicles", columns, tuple(lines), (reading, note + "; ".join(collapsed) + "."))


CrowdingCells = dict[tuple[int, str, float], list[Row]]


def _by_vehicles(rows: Sequence[Row]) -> CrowdingCells:
    cells: CrowdingCells = {}
    for row in rows:
        cells.setdefault((crowding.vehicles_of(row), row["policy"], row["budget"]), []).append(row)
    return cells


def _plain_median(rows: Sequence[Row] | None) -> str:
    values = quartiles([detection_distance(row) for row in rows or ()])
    return f"{values.median:.1f}" if values else "-"


def _contrast(cells: CrowdingCells, vehicles: int, budget: float) -> str:
    care, camera = cells.get((vehicles, "care", budget)), cells.get((vehicles, "all-camera", budget))
    return f"{_plain_median(care)}/{_plain_median(camera)} {_interval(difference(camera, care))}".rstrip()


def _collapsed(cells: CrowdingCells, counts: Sequence[int], budget: float) -> str:
    gaps = {n: difference(cells.get((n, "all-camera", budget)), cells.get((n, "care", budget))) for n in counts}
    return ", ".join(str(n) for n, gap in gaps.items() if gap and gap.mean <= -COLLAPSE_M) or "none"
