"""The sentences after the tables of the studies."""

from collections.abc import Sequence

from care_sim.base.errors import counted
from care_sim.reports.findings import leads_of_episodes, leads_of_plays, ties
from care_sim.reports.protocol.closing import protocol_closing
from care_sim.reports.tables import ablations, order, validate
from care_sim.reports.tables.paper_statements import in_short
from care_sim.study.designs.faults import common_conditions
from care_sim.study.rows.reading import setting_of, stops_for_nothing
from care_sim.study.rows.settings import Setting
from care_sim.study.run_config import FULL, Row


def collisions(rows: Sequence[Row]) -> str:
    """Collisions over all rows. Names those in which a body ran into the car, and the stops for
    nothing, where there are any.
    """
    hit_by = sum(row.get("hit_at_front") is False for row in rows)
    needless = sum(map(stops_for_nothing, rows))
    return (
        f"Collisions: {sum(row['collision'] for row in rows)} in {counted(len(rows), 'episode')}"
        + (f"; in {hit_by} another body ran into the car" if hit_by else "")
        + (f"; {counted(needless, 'stop')} for nothing, which avoid none" if needless else "")
        + "."
    )


def episodes_closing(rows: Sequence[Row]) -> list[str]:
    """Collisions alone."""
    return [collisions(rows)]


def sweep_closing(rows: Sequence[Row]) -> list[str]:
    """How often a control ties, and collisions."""
    return [*ties(leads_of_episodes(rows)), collisions(rows)]


def paper_closing(rows: Sequence[Row]) -> list[str]:
    """How often a control ties where nothing fails, and which of the paper's statements hold."""
    return [*ties(leads_of_episodes(rows, conditions=False)), *in_short(rows), collisions(rows)]


def first_sighting_closing(rows: Sequence[Row]) -> list[str]:
    """How often a control ties, and the size of the study."""
    return [*ties(leads_of_plays(rows)), *protocol_closing(rows)]


def validation_closing(rows: Sequence[Row]) -> list[str]:
    """Which worlds discriminate."""
    return [collisions(rows), *validate.validation_closing(rows)]


def order_closing(rows: Sequence[Row]) -> list[str]:
    """Which statements depend on the order of cells."""
    return [collisions(rows), *order.order_closing(rows)]


def open_order_closing(rows: Sequence[Row]) -> list[str]:
    """Size of the study, and which statements depend on the order of cells."""
    return [*protocol_closing(rows), *order.order_closing(rows)]


def open_ablation_closing(rows: Sequence[Row]) -> list[str]:
    """Size of the study, and what the full scan finds."""
    return [*protocol_closing(rows), *ablations.ceiling(rows)]


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
