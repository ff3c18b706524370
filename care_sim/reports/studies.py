"""The studies by name: what is shown of their rows."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from matplotlib.figure import Figure

from care_sim.base.errors import unknown
from care_sim.reports.figures.closed_loop import (
    BUDGET_FIGURES,
    FAULT_FIGURES,
    fault_figures,
    firing_figures,
    order_figures,
    sweep_figures,
    validation_figures,
    vehicle_figures,
)
from care_sim.reports.figures.open_loop import (
    PROTOCOL_FIGURES,
    open_order_figures,
    protocol_figures,
)
from care_sim.reports.figures.study_maps import (
    ablation_figures,
    crowding_figures,
    ncap_figures,
    open_ablation_figures,
    open_realism_figures,
    r157_figures,
    realism_figures,
)
from care_sim.reports.findings import (
    collisions,
    gate_tables,
    headline,
    leads_tables,
    shared_conditions,
    ties,
)
from care_sim.reports.protocol.contrasts import protocol_minus
from care_sim.reports.protocol.notes import protocol_closing
from care_sim.reports.protocol.tables import protocol_tables
from care_sim.reports.study import Study
from care_sim.reports.tables.ablations import ablation_tables, ceiling
from care_sim.reports.tables.crowding import crowding_tables
from care_sim.reports.tables.faults import fault_tables
from care_sim.reports.tables.firing import firing_tables
from care_sim.reports.tables.mechanism import mechanism_closing, mechanism_tables
from care_sim.reports.tables.ncap import ncap_headline, ncap_tables
from care_sim.reports.tables.order import order_closing, order_tables
from care_sim.reports.tables.paper_statements import in_short, statement_tables
from care_sim.reports.tables.r157 import r157_tables
from care_sim.reports.tables.realism import realism_tables
from care_sim.reports.tables.sweep import sweep_minus, sweep_tables
from care_sim.reports.tables.validate import validation_closing, validation_tables
from care_sim.reports.tables.vehicle import vehicle_tables
from care_sim.study.designs.crowding import VEHICLES_COLUMN
from care_sim.study.designs.ncap import (
    REPORTED_COLUMN,
    SPEED_COLUMN,
    TARGET_COLUMN,
    TEST_COLUMN,
)
from care_sim.study.designs.r157 import CASE_COLUMNS
from care_sim.study.results_formats import MECHANISM, PLAYS, VEHICLE
from care_sim.study.rows.parquet import read_notes
from care_sim.study.rows.schema import COUNT, FLAG, SUM, TEXT, as_optional
from care_sim.study.run_config import Row

_T = TypeVar("_T")


def _no_figures(_rows: Sequence[Row]) -> dict[str, Figure]:
    return {}


def _joined(*makers: Callable[[Sequence[Row]], list[_T]]) -> Callable[[Sequence[Row]], list[_T]]:
    """What several functions make of the rows, one after the other."""
    return lambda rows: [each for make in makers for each in make(rows)]


_ORDER_COLUMNS = {"cell_order": TEXT}
_CASE_COLUMNS = {name: TEXT if name.endswith(("kind", "side")) else SUM for name in CASE_COLUMNS}
_NCAP_COLUMNS = {
    TEST_COLUMN: TEXT,
    SPEED_COLUMN: SUM,
    TARGET_COLUMN: SUM,
    REPORTED_COLUMN: as_optional(FLAG),
}


_ALL = (
    *(
        Study(
            name,
            title,
            _joined(leads_tables, statement_tables, sweep_tables),
            sweep_figures,
            _joined(ties, in_short, collisions),
            BUDGET_FIGURES,
            minus=sweep_minus,
            headline=headline,
        )
        for name, title in (
            ("sweep", "Sweep of the closed loop"),
            ("paper", "The paper's closed-loop study"),
        )
    ),
    Study(
        "crowding",
        "Crowding in the closed loop",
        crowding_tables,
        crowding_figures,
        collisions,
        ("crowding",),
        columns={VEHICLES_COLUMN: COUNT},
    ),
    Study(
        "r157",
        "Cut-ins of UN Regulation 157",
        r157_tables,
        r157_figures,
        collisions,
        ("r157-avoided",),
        columns=_CASE_COLUMNS,
    ),
    Study(
        "ablate",
        "Ablations of the closed loop",
        ablation_tables,
        ablation_figures,
        collisions,
        ("ablations",),
    ),
    Study(
        "faults",
        "Faults in the closed loop",
        fault_tables,
        fault_figures,
        _joined(collisions, shared_conditions),
        FAULT_FIGURES,
    ),
    Study(
        "vehicle",
        "The vehicle study",
        vehicle_tables,
        vehicle_figures,
        collisions,
        ("vehicle",),
        VEHICLE,
    ),
    Study(
        "ncap",
        "Euro NCAP tests",
        ncap_tables,
        ncap_figures,
        _joined(collisions, shared_conditions),
        ("ncap",),
        columns=_NCAP_COLUMNS,
        headline=ncap_headline,
    ),
    Study(
        "order",
        "Order of cells in the closed loop",
        order_tables,
        order_figures,
        _joined(collisions, order_closing),
        ("order",),
        columns=_ORDER_COLUMNS,
    ),
    Study(
        "firing",
        "Hardware in the closed loop",
        firing_tables,
        firing_figures,
        collisions,
        ("firing",),
    ),
    Study(
        "realism",
        "Headline orders under realistic conditions, closed loop",
        realism_tables,
        realism_figures,
        collisions,
        ("realism",),
    ),
    Study(
        "validate",
        "Validation of a world",
        validation_tables,
        validation_figures,
        _joined(collisions, validation_closing),
        ("validation",),
    ),
    Study(
        "order-open-loop",
        "Order of cells in the open loop",
        order_tables,
        open_order_figures,
        _joined(protocol_closing, order_closing),
        ("order-open-loop",),
        PLAYS,
        _ORDER_COLUMNS,
    ),
    Study(
        "firing-open-loop",
        "Hardware in the open loop",
        firing_tables,
        _no_figures,
        protocol_closing,
        (),
        PLAYS,
    ),
    Study(
        "realism-open-loop",
        "Headline orders under realistic conditions, open loop",
        realism_tables,
        open_realism_figures,
        protocol_closing,
        ("realism-open-loop",),
        PLAYS,
    ),
    Study(
        "ablate-open-loop",
        "Ablations of the open loop",
        ablation_tables,
        open_ablation_figures,
        _joined(protocol_closing, ceiling),
        ("ablations-open-loop",),
        PLAYS,
    ),
    Study(
        "protocol",
        "First sightings in the open loop",
        _joined(leads_tables, gate_tables, protocol_tables),
        protocol_figures,
        _joined(ties, protocol_closing),
        PROTOCOL_FIGURES,
        PLAYS,
        minus=protocol_minus,
        headline=headline,
    ),
    Study(
        "mechanism",
        "The mechanism of first sightings",
        mechanism_tables,
        _no_figures,
        mechanism_closing,
        (),
        MECHANISM,
    ),
)
# Files of results carry these names, so that none may change.
STUDIES = {study.name: study for study in _ALL}
SWEEP = STUDIES["sweep"]


def study_of(path: Path) -> Study:
    """The study that a file of rows belongs to; a file that names none holds a sweep.

    Raises InvalidInput for the name of a study that this version does not know.
    """
    # Files of before the name was written hold sweeps.
    name = read_notes(path)[0] or SWEEP.name
    if name not in STUDIES:
        raise unknown(f"study in {path}", name, STUDIES)
    return STUDIES[name]
