"""Several folders of one study as one: rows side by side, so that tables compare them pair by pair.

New plays then stand beside published ones, which need not be played again. Equal rows of one task
become one row. If they differ, something other than the policy has changed, and the two folders may
not be compared.
"""

import json
from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from care_sim.base.errors import InvalidInput, counted
from care_sim.base.files import write_text
from care_sim.reports.report import CONFIG, StudyReport, described, read_results
from care_sim.reports.study import Study
from care_sim.study.results_formats import EPISODES, PLAYS, VEHICLE
from care_sim.study.rows.checks import RowChecks, check_worlds
from care_sim.study.rows.parquet import (
    read_notes,
    read_rows,
    read_table,
    write_columns,
    write_rows,
)
from care_sim.study.rows.reading import key_of, with_regret
from care_sim.study.run_config import Row

_EVENTS = "events.parquet"


@dataclass(frozen=True)
class Merged:
    """Rows of several folders. `twice` counts the tasks that more than one folder holds. `apart`
    are folders whose worlds may differ from the first's: they share neither code, nor a task or a
    film.
    """

    study: Study
    rows: Sequence[Row]
    events: Mapping[str, Any] | None
    left_out: Sequence[str]
    descriptions: Mapping[str, dict[str, Any]]
    twice: int
    apart: Sequence[Path]

    @property
    def uneven(self) -> bool:
        """Whether policies of one setting and budget were played in different worlds."""
        worlds: dict[Hashable, dict[str, set[Hashable]]] = {}
        for row in self.rows:
            setting, policy, budget = key_of(row)
            world = row.get("scene"), row.get("seed"), row.get("floor_seed")
            worlds.setdefault((setting, budget), {}).setdefault(policy, set()).add(world)
        return any(own != next(iter(of.values())) for of in worlds.values() for own in of.values())

    def write(self, folder: Path) -> None:
        """Write a folder of results as a study does, without a journal."""
        report = StudyReport.of(self.rows, self.study, self.left_out)
        kind = self.study.results
        if self.events is not None:
            write_columns(self.events, folder / _EVENTS)
        write_rows(self.rows, folder / kind.file, self.study.name, self.left_out, self.study.schema)
        told = {
            "study": self.study.name,
            "command": "care-sim report FOLDER... --out FOLDER",
            "versions": _joined(self.descriptions.values(), "versions"),
            "machine": _joined(self.descriptions.values(), "machine"),
            "failed": [],
            "merged": self.descriptions,
        }
        write_text(folder / CONFIG, json.dumps(told, indent=1) + "\n")
        report.write(folder)


def merged(folders: Sequence[Path]) -> Merged:
    """Return the rows of several folders together, in their order.

    Raises InvalidInput as `read_results` does, and for folders of different studies. Also raises it
    if a task differs between two folders, a scene has two films, or columns have different types.
    """
    study = read_results(folders[0])[1]
    for folder in folders[1:]:
        other = read_results(folder)[1]
        if other.name != study.name:
            raise InvalidInput(
                f"{folders[0]} holds the study {study.name} and {folder} the study {other.name}: "
                "only folders of one study can be merged"
            )
    rows: list[Row] = []
    events: list[pa.Table] = []
    seen = RowChecks()
    firsts = []
    noted = []
    for folder in folders:
        # All columns, those too that no report reads.
        own = read_rows(folder / study.results.file)
        firsts.append(own[0])
        noted += read_notes(folder / study.results.file)[1]
        is_new = [seen.is_new(row, folder) for row in own]
        rows += [row for row, new in zip(own, is_new, strict=True) if new]
        if study.results is PLAYS:
            events += _events(folder, own, is_new)
    check_worlds(rows)
    rows = _in_one_table(rows, firsts)
    told = _descriptions(folders)
    # A folder that was merged before tells the code of all its parts.
    codes = {
        folder: {*_joined([own], "versions").get("code", "").split(", ")} - {""}
        for folder, own in zip(folders, told.values(), strict=True)
    }
    return Merged(
        study,
        with_regret(rows) if study.results in (EPISODES, VEHICLE) else rows,
        # Events of some plays alone would pass for those of all.
        _events_of_all(events) if len(events) == len(folders) else None,
        [*dict.fromkeys([*noted, *seen.unknown([*rows[0]], study.schema)])],
        told,
        seen.twice,
        _apart(codes, seen.shared),
    )


def _in_one_table(rows: Sequence[Row], firsts: Sequence[Row]) -> list[Row]:
    """The rows with the columns in one order; `firsts` have the columns of every folder. Raises
    where one column cannot hold the values of all.
    """
    names = dict.fromkeys(name for first in firsts for name in first)
    # Sums of a kind of strata are needed of every row, where one has them.
    kinds = {name.partition("/")[0] for name in names if not all(name in one for one in firsts)}
    kept = [name for name in names if "/" not in name or name.partition("/")[0] not in kinds]
    made = [{name: row.get(name) for name in kept} for row in rows]
    for name in kept:
        try:
            pa.array([row[name] for row in made])
        except pa.ArrowException as error:
            raise _types_differ(f"the column {name} has values") from error
    return made


def _apart(
    codes: Mapping[Path, Collection[str]], shared: Collection[frozenset[Path]]
) -> list[Path]:
    """The folders that nothing links to the first, by way of others or not."""
    reached = {next(iter(codes))}
    known: set[str] = set()
    for _ in codes:
        known |= {code for folder in reached for code in codes[folder]}
        reached |= {folder for folder, own in codes.items() if known & {*own}}
        reached |= {folder for pair in shared if pair & reached for folder in pair}
    return [folder for folder in codes if folder not in reached]


def _events(folder: Path, rows: Sequence[Row], kept: Sequence[bool]) -> list[pa.Table]:
    """The events of the rows that are kept: a play has as many as `ttfds`, play after play."""
    path = folder / _EVENTS
    if not path.is_file():
        return []
    table = read_table(path)
    of_rows = np.repeat(kept, [len(row["ttfds"]) for row in rows])
    if len(of_rows) != table.num_rows:
        raise InvalidInput(
            f"{path} holds {counted(table.num_rows, 'event')}, its plays {len(of_rows)}: the two "
            "files are not of one study"
        )
    return [table.filter(pa.array(of_rows))]


def _events_of_all(tables: Sequence[pa.Table]) -> dict[str, Any]:
    try:
        table = pa.concat_tables(tables, promote_options="permissive")
    except pa.ArrowException as error:
        raise _types_differ(f"{_EVENTS} has columns") from error
    return {name: table[name].combine_chunks() for name in table.column_names}


def _types_differ(what: str) -> InvalidInput:
    return InvalidInput(f"{what} of different types in the folders: they cannot be one table")


def _descriptions(folders: Sequence[Path]) -> dict[str, dict[str, Any]]:
    """Return the description of every folder, by its name; none for a folder without one."""
    told: dict[str, dict[str, Any]] = {}
    for folder in folders:
        name = folder.resolve().name
        # Folders with the same name are numbered.
        while name in told:
            name += "'"
        told[name] = described(folder)
    return told


def _joined(descriptions: Iterable[dict[str, Any]], name: str) -> dict[str, str]:
    """The values that the folders tell under a name, by key, each once."""
    found: dict[str, dict[str, None]] = {}
    for each in descriptions:
        told = each.get(name)
        for key, value in (told if isinstance(told, dict) else {}).items():
            found.setdefault(key, {})[str(value)] = None
    return {key: ", ".join(values) for key, values in found.items()}
