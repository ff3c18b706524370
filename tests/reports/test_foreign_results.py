"""Results that something else wrote, or that were damaged, are refused in one line where they are
opened.
"""

import io
import random
import warnings
from dataclasses import replace

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from rich.console import Console

from care_sim.base.errors import InvalidInput
from care_sim.cli import main
from care_sim.reports.report import StudyReport, print_report, read_results
from care_sim.reports.studies import STUDIES
from care_sim.study.rows.parquet import LEFT_OUT_NOTE, STUDY_NOTE, read_rows, write_rows
from tests.helpers import made_plays
from tests.helpers.made_rows import CROWD, STUDY

PLAYS = made_plays.study(
    {"care": (3, 4), "history": (2, 3), "full": (4, 5)}, scenes=2, budgets=(0.1,), events=5
)
ROWS = {"sweep": STUDY, "crowding": CROWD, "faults": STUDY, "protocol": PLAYS}
DEEP = b"[" * 100_000


def table(name, folder):
    write_rows(ROWS[name], folder / STUDIES[name].results.file, name)
    return pq.read_table(folder / STUDIES[name].results.file)


def put(content, name, folder):
    pq.write_table(content, folder / STUDIES[name].results.file)


def of_value(content, column, value):
    return content.set_column(
        content.column_names.index(column), column, pa.array([value] * content.num_rows)
    )


def shown(folder):
    rows, study, left_out = read_results(folder)
    with warnings.catch_warnings(action="ignore"):
        StudyReport.of(rows, replace(study, figures=lambda _rows: {}), left_out)
        print_report(rows, Console(file=io.StringIO()), study, left_out)


def complaint(folder):
    with pytest.raises(InvalidInput) as refused:
        read_results(folder)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 1000
    return str(refused.value)


@pytest.mark.parametrize(
    ("name", "column", "value", "fault"),
    [
        ("sweep", "budget", 0.0, "column budget must hold numbers from 1e-09 to 1"),
        ("sweep", "seed", 0.5, "column seed must hold whole numbers, got double"),
        ("sweep", "policy", None, "column policy must hold text, got null"),
        ("sweep", "braked", 1, "column braked must hold true or false, got int64"),
        ("sweep", "detection_distance_m", float("nan"), "must hold numbers from 0 to"),
        ("sweep", "lidar_dead_rows", ["a"], "must hold lists of whole numbers"),
        ("crowding", "scenario.vehicles", "many", "must hold whole numbers"),
        ("protocol", "ttfds", [1, None], "column ttfds must hold whole lists"),
        ("protocol", "ttfds", [], "has 0 TTFD of 5 events"),
        ("protocol", "differing_cells", -1, "must hold whole numbers from 0"),
        ("protocol", "entry/ring/found", 1000, "must be at most entry/ring/frames in every row"),
    ],
)
def test_a_column_of_another_type_or_range_is_named(tmp_path, name, column, value, fault):
    put(of_value(table(name, tmp_path), column, value), name, tmp_path)
    with pytest.raises(InvalidInput) as refused:
        shown(tmp_path)
    assert fault in str(refused.value)


def test_no_flipped_bit_changes_rows_in_silence(tmp_path):
    table("sweep", tmp_path)
    path = tmp_path / "episodes.parquet"
    sound = path.read_bytes()
    rows, study, _ = read_results(tmp_path)
    draws = random.Random(1)
    for _ in range(200):
        content = bytearray(sound)
        content[draws.randrange(len(content))] ^= 1 << draws.randrange(8)
        path.write_bytes(content)
        try:
            found, of, left_out = read_results(tmp_path)
        except InvalidInput:
            continue
        assert left_out or (found, of) == (rows, study)


@pytest.mark.parametrize("column", ["class/bus/delay", "film_hash", "events"])
def test_a_missing_column_of_a_play_is_named(tmp_path, column):
    put(table("protocol", tmp_path).drop_columns(column), "protocol", tmp_path)
    assert f"it lacks {column}" in complaint(tmp_path)


def test_files_of_other_people_are_one_line_and_further_columns_do_no_harm(tmp_path):
    path = tmp_path / "episodes.parquet"
    pq.write_table(pa.table({"when": pa.array([2**62], pa.timestamp("ms"))}), path)
    assert "it lacks " in complaint(tmp_path)
    with pytest.raises(InvalidInput, match="not a readable Parquet file"):
        read_rows(path)
    content = table("sweep", tmp_path)
    put(
        content.append_column("when", pa.array([2**62] * content.num_rows, pa.timestamp("ms"))),
        "sweep",
        tmp_path,
    )
    assert len(read_results(tmp_path)[0]) == content.num_rows


@pytest.mark.parametrize(
    ("notes", "fault"),
    [
        ({STUDY_NOTE: b"\xff"}, "has notes that cannot be read"),
        ({LEFT_OUT_NOTE: DEEP}, "nested too deep"),
        ({LEFT_OUT_NOTE: b"[1]"}, "what is left out must be a list of texts"),
        ({STUDY_NOTE: b"gardening"}, "unknown study"),
        (
            {STUDY_NOTE: b"protocol"},
            "holds no rows of the study protocol, which are in plays.parquet",
        ),
        ({STUDY_NOTE: b"crowding"}, "it lacks scenario.vehicles"),
    ],
)
def test_notes_of_another_kind_are_one_line(tmp_path, notes, fault):
    put(table("sweep", tmp_path).replace_schema_metadata(notes), "sweep", tmp_path)
    assert fault in complaint(tmp_path)


VALUES = [
    *(None, float("nan"), -1.0, 0.0, 1e300, "text", "$x^$ <b>|`", True, -1, 2**62),
    *([], [1], [None], {"a": 1}, b"x"),
]


def mutated(content, random):
    """The table with a column dropped, moved, or with another value in it."""
    name = random.choice(content.column_names)
    place, column = content.column_names.index(name), content[name]
    try:
        match random.randrange(5):
            case 0:
                return content.remove_column(place)
            case 1:
                return of_value(content, name, random.choice(VALUES))
            case 2:
                values = column.to_pylist()
                values[random.randrange(len(values))] = random.choice(VALUES)
                return content.set_column(place, name, pa.array(values, column.type))
            case 3:
                return content.set_column(place, name, content[random.choice(content.column_names)])
            case _:
                return content.set_column(
                    place,
                    name,
                    column.take(pa.array(random.sample(range(len(column)), len(column)))),
                )
    except (pa.ArrowException, TypeError, ValueError, OverflowError):
        return content


@pytest.mark.parametrize("name", ["crowding", "protocol"])
def test_damaged_results_are_shown_or_refused(tmp_path, name):
    """Seeded damage; figures are drawn of few."""
    rolls = random.Random(name)
    content, refused = table(name, tmp_path), []
    for _ in range(60):
        put(mutated(mutated(content, rolls), rolls), name, tmp_path)
        try:
            shown(tmp_path)
        except InvalidInput as error:
            refused.append(str(error))
    assert 10 < len(refused) < 60
    assert not any("\n" in line for line in refused)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ["sweep", "protocol"])
def test_a_name_of_signs_is_shown_everywhere(tmp_path, name, capsys):
    odd = "my $x^$ |`<b>_\\ \x1b[31m \u5b66"
    rows = [
        row | {"policy": odd if row["policy"] == "history" else row["policy"]} for row in ROWS[name]
    ]
    write_rows(rows, tmp_path / STUDIES[name].results.file, name, ["what \x1b[31m failed"])
    (tmp_path / "config.json").write_text('{"machine": {"system": "\\ud800"}}')
    for command in (
        ["report", str(tmp_path)],
        ["report", str(tmp_path), "-o", str(tmp_path / "a.html"), "--episodes", "0"],
    ):
        with pytest.raises(SystemExit) as end:
            main(command)
        assert end.value.code == 0, capsys.readouterr().err
    said = capsys.readouterr()
    for text in (
        said.out,
        said.err,
        *((tmp_path / file).read_text() for file in ("tables.md", "tables.tex")),
    ):
        assert "\x1b" not in text
    assert "<b>_" not in (tmp_path / "a.html").read_text()
