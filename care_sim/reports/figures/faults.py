"""The figures of the fault study: what a measure does as every fault grows."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from matplotlib.figure import Figure

from care_sim.base.errors import counted
from care_sim.reports.cells import Cell, StudyCells
from care_sim.reports.figures.curves import Heights, Panel, curves_figure
from care_sim.reports.tables.faults import policies_of
from care_sim.study.designs.faults import FAULT_PLACES, FAULTS, faults_alone
from care_sim.study.designs.variants import Place
from care_sim.study.run_config import Row

_FLAT = 0.02
"""A panel in which no curve moves by more than this share of the largest value of the figure shows
nothing but its level.
"""


@dataclass(frozen=True)
class CurveMeasure:
    """What a figure shows of a cell; `read` gives None where there is nothing to show."""

    name: str
    label: str
    read: Callable[[Cell], float | None]

    def value(self, cell: Cell | None) -> float | None:
        """None for a cell that was not played, nan for one without a value."""
        if cell is None:
            return None
        found = self.read(cell)
        return math.nan if found is None else found


MEASURES = (
    CurveMeasure("detection", "first detection, median, m", lambda cell: cell.detection.median),
    CurveMeasure(
        "braked", "episodes with braking, %", lambda cell: 100.0 * cell.braked / cell.episodes
    ),
    CurveMeasure(
        "clearance",
        "clearance, median, m",
        lambda cell: cell.clearance.median if cell.clearance else None,
    ),
)
Curves = Mapping[str, Heights]
"""Of each policy its value at every strength; None was not played, nan has no median."""
FAULT_FIGURES = tuple(
    f"faults-{place.scenario}-{measure.name}" for place in FAULT_PLACES for measure in MEASURES
)
"""Every figure that the study can draw."""


def fault_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """A figure for every place and measure, by name, with a panel for every fault."""
    study = StudyCells(faults_alone(rows))
    made = [_figure(study, place, measure) for place, measure in product(FAULT_PLACES, MEASURES)]
    return dict(zip(FAULT_FIGURES, made, strict=True))


def _figure(study: StudyCells, place: Place, measure: CurveMeasure) -> Figure:
    panels = {
        fault.title: Panel(
            fault.title,
            [level.label for level in fault.levels],
            {
                policy: [
                    measure.value(study.cell(level.key(place, policy))) for level in fault.levels
                ]
                for policy in policies_of(study)
            },
            unit=fault.unit,
        )
        for fault in FAULTS
    }
    flat = flat_faults({title: panel.heights for title, panel in panels.items()})
    return curves_figure(
        f"{place}, {counted(len({row['seed'] for row in study.rows}), 'seed')}: {measure.label}",
        [panel for title, panel in panels.items() if title not in flat],
        study.tags,
        [flat_line(flat)] if flat else [],
        share=True,
    )


def flat_faults(curves: Mapping[str, Curves]) -> list[str]:
    """The titles of the faults, of the curves of each, that move no curve of a figure. Where that
    is so of all, the first is left out of them: it shows the levels.
    """
    heights = [height for own in curves.values() for each in own.values() for height in each]
    known = [height for height in heights if height is not None and not math.isnan(height)]
    least = _FLAT * max(known, default=0.0)
    flat = [
        title
        for title, own in curves.items()
        if not any(_moves(heights, least) for heights in own.values())
    ]
    return flat if len(flat) < len(curves) else flat[1:]


def flat_line(flat: Sequence[str]) -> str:
    """The line in the place of panels that would be flat."""
    return f"Moving no curve by more than {_FLAT:.0%} of the largest value: {', '.join(flat)}."


def _moves(heights: Heights, least: float) -> bool:
    played = [height for height in heights if height is not None]
    found = [height for height in played if not math.isnan(height)]
    # A median that is lost at some strength moves to where nobody is detected.
    if len(found) not in (0, len(played)):
        return True
    return bool(found) and max(found) - min(found) > least
