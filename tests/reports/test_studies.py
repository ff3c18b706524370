import json
import re
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from rich.console import Console

from care_sim.base.errors import InvalidInput
from care_sim.commands.shared.run_study import run_study
from care_sim.reports import studies
from care_sim.reports.report import StudyReport, print_report
from care_sim.reports.studies import STUDIES, study_of
from care_sim.study.designs import (
    ablations,
    faults,
    firing,
    paper,
    realism,
    standards,
    validate,
    vehicle,
)
from care_sim.study.episode_config import grid
from care_sim.study.rows.parquet import read_rows, write_rows
from care_sim.study.rows.reading import with_added_columns
from tests.helpers import made_worlds
from tests.helpers.made_rows import CROWD, CUT_INS, STUDY, row, vehicle_row

EPISODES = {
    "sweep": STUDY,
    "paper": STUDY,
    "crowding": CROWD,
    "ablate": STUDY,
    "faults": STUDY,
    "r157": [each for each in CUT_INS if not each["collision"]],
    "validate": made_worlds.world(made_worlds.SATURATED, {"care": (15.0, 0), "fan": (14.0, 0)}),
    "ncap": [
        row(config, 9.0) for config in standards.ncap_study([0, 1], ["care", "full"], ["CPNCO-50"])
    ],
    "order": [row(config, 9.0) for config in firing.order_study([0]) if config.scenario == "dense"],
    "firing": [row(config, 9.0) for config in firing.firing_study([0])],
    "realism": [row(config, 9.0) for config in realism.realism_study([0])],
    "vehicle": [vehicle_row(config, 9.0) for config in vehicle.vehicle_study([0])],
}


def test_a_column_that_no_row_fills_may_be_missing(tmp_path):
    """Only tests with cars that hide the target have the reading of Euro NCAP's."""
    bare = [row(config, 9.0) for config in standards.ncap_study([0], ["full"], ["CCFtap"])]
    study = STUDIES["ncap"]
    write_rows(bare, tmp_path / "episodes.parquet", "ncap")
    read = read_rows(tmp_path / "episodes.parquet", study.schema)
    assert study.tables(read) == study.tables(bare)
    # Where it is there, it is checked.
    wrong = [{**one, standards.REPORTED_COLUMN: "yes"} for one in bare]
    write_rows(wrong, tmp_path / "episodes.parquet", "ncap")
    with pytest.raises(InvalidInput, match=f"its column {standards.REPORTED_COLUMN} must hold"):
        read_rows(tmp_path / "episodes.parquet", study.schema)


def test_figures_that_are_named_by_text_are_there():
    """Studies import what draws them late, so that a wrong name shows only when it is drawn."""
    places = re.findall(r'_drawn\("(\w+):(\w+)"\)', Path(studies.__file__).read_text())
    assert len(places) == len({name for _, name in places}) == 15
    for module, name in places:
        assert callable(getattr(import_module(f"care_sim.reports.figures.{module}"), name))


@pytest.mark.parametrize(("name", "rows"), EPISODES.items())
def test_every_study_shows_its_rows_in_three_forms(name, rows, tmp_path, capsys):
    study = STUDIES[name]
    figures = study.figures(rows)
    assert set(figures) <= set(study.figures_of())
    # To write a figure at the resolution of print takes a second. All are drawn coarsely, which
    # takes the same code; one is written.
    for figure in figures.values():
        figure.set_dpi(20)
        FigureCanvasAgg(figure).draw()
    first = dict([*figures.items()][:1])
    study = replace(study, figures=lambda rows: first)
    StudyReport.of(rows, study).write(tmp_path)
    assert all((tmp_path / f"{figure}.png").is_file() for figure in first)
    print_report(rows, Console(width=80), study, verbose=True)
    printed, markdown, latex = (
        capsys.readouterr().out,
        *((tmp_path / f).read_text() for f in ("tables.md", "tables.tex")),
    )
    assert all("Collisions: 0 in" in text for text in (printed, markdown, latex))
    assert markdown.startswith("How to read the tables: `docs/reading.md`.\n")
    tables = study.tables(rows)
    assert latex.count(r"\begin{table}") == len(tables)
    assert all(f"## {table.title}\n" in markdown for table in tables)
    assert all(table.title in " ".join(printed.split()) for table in tables)


def test_a_file_changes_nothing_in_the_tables(tmp_path):
    """Numbers that differ in type alone, and columns that only some rows have, come back from
    Parquet changed.
    """
    played = {
        "ablate": ablations.ablation_study(range(2)),
        "faults": faults.fault_study(range(2)),
        "firing": firing.firing_study(range(2)),
        "ncap": standards.ncap_study(range(2), ["care", "fan", "full"], ["CPNA-25", "CCRs"]),
        "paper": paper.paper_study(range(2)),
        "validate": validate.validation_study("cutin", [(("mirrored", "drawn"),)], [0.1], [0], 1),
    }
    for name, configs in played.items():
        rows = with_added_columns(
            [row(config, 10.0 + number % 7) for number, config in enumerate(configs)]
        )
        write_rows(rows, tmp_path / "episodes.parquet", name)
        read = read_rows(tmp_path / "episodes.parquet")
        tables = STUDIES[name].tables(read)
        assert tables == STUDIES[name].tables(rows)
        # The usual level of an ablation is compared with nothing.
        if name not in ("paper", "ablate"):
            assert all(all(line[:3]) for table in tables for line in table.rows)


def test_a_study_leaves_its_name_and_its_columns_in_the_folder(tmp_path):
    short = (("vehicles", 1), ("duration_s", 0.2))
    configs = grid(["dense"], ["random", "full"], [0.1], [0], scenario_parameters=short)
    assert run_study(configs, tmp_path, workers=1, study=STUDIES["crowding"]) == []
    assert json.loads((tmp_path / "config.json").read_text())["study"] == "crowding"
    assert study_of(tmp_path / "episodes.parquet").name == "crowding"
    assert {"tags", "regret_m", "censored"} <= set(read_rows(tmp_path / "episodes.parquet")[0])
