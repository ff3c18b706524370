"""The studies by name, with the reports of their rows."""

from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from care_sim.base.errors import unknown
from care_sim.reports.findings import (
    collisions,
    gate_tables,
    headline,
    leads_tables,
    shared_conditions,
    ties,
)
from care_sim.reports.protocol.contrasts import protocol_minus
from care_sim.reports.protocol.formatting import protocol_closing
from care_sim.reports.protocol.tables import protocol_tables
from care_sim.reports.study import Study
from care_sim.reports.tables.ablations import ablation_tables, ceiling
from care_sim.reports.tables.crowding import crowding_tables
from care_sim.reports.tables.faults import fault_tables
from care_sim.reports.tables.mechanism import mechanism_closing, mechanism_tables
from care_sim.reports.tables.ncap import ncap_headline, ncap_tables
from care_sim.reports.tables.order import order_closing, order_tables
from care_sim.reports.tables.paper_statements import in_short, statement_tables
from care_sim.reports.tables.r157 import r157_tables
from care_sim.reports.tables.realism import realism_tables
from care_sim.reports.tables.sweep import firing_tables, sweep_minus, sweep_tables
from care_sim.reports.tables.validate import validation_closing, validation_tables
from care_sim.reports.tables.vehicle import vehicle_tables
from care_sim.study.designs.faults import FAULT_PLACES
from care_sim.study.designs.paper import VEHICLES_COLUMN
from care_sim.study.designs.standards import (
    CASE_COLUMNS,
    REPORTED_COLUMN,
    SPEED_COLUMN,
    TARGET_COLUMN,
    TEST_COLUMN,
)
from care_sim.study.results_formats import MECHANISM, PLAYS, VEHICLE
from care_sim.study.rows.parquet import read_notes
from care_sim.study.rows.schema import COUNT, FLAG, SUM, TEXT, as_optional
from care_sim.study.run_config import Row

_T = TypeVar("_T")


if TYPE_CHECKING:
    from matplotlib.figure import Figure

_Figures = Callable[[Sequence[Row]], dict[str, "Figure"]]


def _no_figures(_rows: Sequence[Row]) -> dict[str, "Figure"]:
    return {}


def _drawn(place: str) -> _Figures:
    """The function MODULE:NAME of `care_sim.reports.figures`. Its module loads Matplotlib, a third
    of a second, and is imported when it is called.
    """
    module, _, name = place.partition(":")

    def draw(rows: Sequence[Row]) -> dict[str, "Figure"]:
        own: _Figures = getattr(import_module(f"care_sim.reports.figures.{module}"), name)
        return own(rows)

    return draw


def _joined(*makers: Callable[[Sequence[Row]], list[_T]]) -> Callable[[Sequence[Row]], list[_T]]:
    """Return a function that joins what several functions make of the rows, one after the other."""
    return lambda rows: [each for make in makers for each in make(rows)]


_ORDER_COLUMNS = {"cell_order": TEXT}
_CASE_COLUMNS = {name: TEXT if name.endswith(("kind", "side")) else SUM for name in CASE_COLUMNS}
_NCAP_COLUMNS = {
    TEST_COLUMN: TEXT,
    SPEED_COLUMN: SUM,
    TARGET_COLUMN: SUM,
    REPORTED_COLUMN: as_optional(FLAG),
}


_FAULT_FIGURES = tuple(
    f"faults-{place.scenario}-{name}"
    for place in FAULT_PLACES
    for name in ("detection", "braked", "clearance")
)
_PROTOCOL_FIGURES = tuple(
    f"{kind}-{{world}}{rest}" for kind in ("pareto", "levels", "controls") for rest in ("", "-*")
)
"""Every figure that a folder may hold of a source, as patterns: behind the source stands what is
not usual in detector and conditions. Earlier versions drew `pareto`, which is removed.
"""

_ALL = (
    *(
        Study(
            name,
            title,
            tables,
            _drawn("closed_loop:sweep_figures"),
            closing,
            ("{world}-budget",),
            minus=sweep_minus,
            headline=headline,
        )
        for name, title, tables, closing in (
            (
                "sweep",
                "Sweep of the closed loop",
                _joined(leads_tables, sweep_tables),
                _joined(ties, collisions),
            ),
            (
                "paper",
                "The paper's closed-loop study",
                _joined(partial(leads_tables, plain=True), statement_tables, sweep_tables),
                _joined(partial(ties, plain=True), in_short, collisions),
            ),
        )
    ),
    Study(
        "crowding",
        "Crowding in the closed loop",
        crowding_tables,
        _drawn("study_maps:crowding_figures"),
        collisions,
        ("crowding",),
        columns={VEHICLES_COLUMN: COUNT},
    ),
    Study(
        "r157",
        "Cut-ins of UN Regulation 157",
        r157_tables,
        _drawn("study_maps:r157_figures"),
        collisions,
        ("r157-avoided",),
        columns=_CASE_COLUMNS,
    ),
    Study(
        "ablate",
        "Ablations of the closed loop",
        ablation_tables,
        _drawn("study_maps:ablation_figures"),
        collisions,
        ("ablations",),
    ),
    Study(
        "faults",
        "Faults in the closed loop",
        fault_tables,
        _drawn("closed_loop:fault_figures"),
        _joined(collisions, shared_conditions),
        _FAULT_FIGURES,
    ),
    Study(
        "vehicle",
        "The vehicle study",
        vehicle_tables,
        _drawn("closed_loop:vehicle_figures"),
        collisions,
        ("vehicle",),
        VEHICLE,
    ),
    Study(
        "ncap",
        "Euro NCAP tests",
        ncap_tables,
        _drawn("study_maps:ncap_figures"),
        _joined(collisions, shared_conditions),
        ("ncap",),
        columns=_NCAP_COLUMNS,
        headline=ncap_headline,
    ),
    Study(
        "order",
        "Order of cells in the closed loop",
        order_tables,
        _drawn("closed_loop:order_figures"),
        _joined(collisions, order_closing),
        ("order",),
        columns=_ORDER_COLUMNS,
    ),
    Study(
        "firing",
        "Hardware in the closed loop",
        firing_tables,
        _drawn("closed_loop:firing_figures"),
        collisions,
        ("firing",),
    ),
    Study(
        "realism",
        "Headline orders under realistic conditions, closed loop",
        realism_tables,
        _drawn("study_maps:realism_figures"),
        collisions,
        ("realism",),
    ),
    Study(
        "validate",
        "Validation of a world",
        validation_tables,
        _drawn("closed_loop:validation_figures"),
        _joined(collisions, validation_closing),
        ("validation",),
    ),
    Study(
        "order-open-loop",
        "Order of cells in the open loop",
        order_tables,
        _drawn("open_loop:open_order_figures"),
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
        _drawn("study_maps:open_realism_figures"),
        protocol_closing,
        ("realism-open-loop",),
        PLAYS,
    ),
    Study(
        "ablate-open-loop",
        "Ablations of the open loop",
        ablation_tables,
        _drawn("study_maps:open_ablation_figures"),
        _joined(protocol_closing, ceiling),
        ("ablations-open-loop",),
        PLAYS,
    ),
    Study(
        "protocol",
        "First sightings in the open loop",
        _joined(leads_tables, gate_tables, protocol_tables),
        _drawn("open_loop:protocol_figures"),
        _joined(ties, protocol_closing),
        _PROTOCOL_FIGURES,
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
    # Older files without a name hold sweeps.
    name = read_notes(path)[0] or SWEEP.name
    if name not in STUDIES:
        raise unknown(f"study in {path}", name, STUDIES)
    return STUDIES[name]
