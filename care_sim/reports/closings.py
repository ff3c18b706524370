"""The sentences after the tables of the studies."""

from collections.abc import Sequence

from care_sim.base.errors import counted
from care_sim.reports.findings.closed_loop import sweep_findings
from care_sim.reports.findings.open_loop import protocol_findings
from care_sim.reports.protocol.closing import protocol_closing
from care_sim.reports.tables import order, validate
from care_sim.reports.tables.paper_statements import statements
from care_sim.study.designs.faults import common_conditions
from care_sim.study.designs.paper import NO_COLLISION
from care_sim.study.rows.reading import setting_of, stops_for_nothing
from care_sim.study.rows.settings import Setting
from care_sim.study.run_config import FULL, Row

_BESIDE_PAPER = (
    "Beside the paper, distances as medians in metres; why some differ stands in "
    "results/paper-closed-loop.md:"
)

_NEEDLESS = (
    "with a brake for nothing before the actor was in view: they count as not detected and not "
    "avoided."
)


def collisions(rows: Sequence[Row]) -> str:
    """Collisions over all rows. Names those in which a body ran into the car, and the stops for
    nothing, where there are any.
    """
    hit_by = sum(row.get("hit_at_front") is False for row in rows)
    needless = sum(map(stops_for_nothing, rows))
    return (
        f"Collisions: {sum(row['collision'] for row in rows)} in {counted(len(rows), 'episode')}"
        + (f"; in {hit_by} of them another body ran into the car" if hit_by else "")
        + "."
        + (f" {counted(needless, 'episode')} {_NEEDLESS}" if needless else "")
    )


def episodes_closing(rows: Sequence[Row]) -> list[str]:
    """Collisions alone."""
    return [collisions(rows)]


def sweep_closing(rows: Sequence[Row]) -> list[str]:
    """Who leads where, and collisions."""
    return [*sweep_findings(rows), collisions(rows)]


def paper_closing(rows: Sequence[Row]) -> list[str]:
    """Who leads where nothing fails, and what the paper says beside what was measured."""
    said = [*map(str, statements(rows))]
    return [
        *sweep_findings(rows, conditions=False),
        f'{collisions(rows)} Paper: "{NO_COLLISION}"',
        *([_BESIDE_PAPER] if said else []),
        *said,
    ]


def first_sighting_closing(rows: Sequence[Row]) -> list[str]:
    """Who leads where, the size of the study and the paper's gate."""
    # Both may say what an interval over events is.
    return [*dict.fromkeys([*protocol_findings(rows), *protocol_closing(rows)])]


def validation_closing(rows: Sequence[Row]) -> list[str]:
    """The verdicts on the worlds."""
    return [collisions(rows), *validate.validation_closing(rows)]


def order_closing(rows: Sequence[Row]) -> list[str]:
    """What hangs on the order of cells."""
    return [collisions(rows), *order.order_closing(rows)]


def fault_closing(rows: Sequence[Row]) -> list[str]:
    """What all episodes share beside the faults."""
    return [collisions(rows), *_told(common_conditions(rows))]


def ncap_closing(rows: Sequence[Row]) -> list[str]:
    """What all episodes share beside the tests."""
    row = next((each for each in rows if each["policy"] != FULL), rows[0])
    plain = {name: value for name, value in row.items() if not name.startswith("scenario.")}
    return [collisions(rows), *_told(setting_of(plain))]


def _told(setting: Setting) -> list[str]:
    """A sentence where conditions are not the default."""
    changed = setting.label.removeprefix(f"{setting.world}, ")
    return [f"Conditions of all episodes: {changed}."] if setting.conditions else []
