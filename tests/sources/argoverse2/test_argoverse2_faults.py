import numpy as np
import pyarrow as pa
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.sources.argoverse2.recordings import argoverse2_film, sweep_files
from tests.helpers.av2_log import CAR_AHEAD, box, parked, replaced, rewrite, stamp

BOXES, POSES = "annotations.feather", "city_SE3_egovehicle.feather"


def told(name, values):
    """Another column of a table."""
    return lambda table: replaced(table, name, values)


def twice(table):
    return pa.concat_tables([table, table.slice(1, 1)])


def rows(count):
    return lambda table: table.slice(0, count)


def upright(table):
    """Poses of a car that points straight up."""
    half = [0.5**0.5] * len(table)
    return replaced(replaced(table, "qw", half), "qy", half)


CHANGED = [
    (BOXES, lambda table: table.drop_columns(["width_m"]), "lacks the column 'width_m'"),
    (BOXES, lambda table: table.append_column("tx_m", table["tx_m"]), "has 2 columns 'tx_m'"),
    (BOXES, told("num_interior_pts", [1.5, 1.5]), "'num_interior_pts' must hold int values"),
    (BOXES, told("tx_m", [True, True]), "column 'tx_m' must hold float values, has bool"),
    (BOXES, told("track_uuid", [7, 7]), "column 'track_uuid' must hold str values, has int64"),
    (BOXES, told("timestamp_ns", [0, 10**17]), r"its times span 1e\+08 s"),
    (BOXES, rows(0), "no annotations"),
    (BOXES, twice, f"the track 'a' at {stamp(1)} is annotated twice"),
    (POSES, twice, f"two poses at {stamp(1)}"),
    (POSES, told("qw", [1.0, 0.0]), f"the pose at {stamp(1)} has a quaternion that is not of"),
    (POSES, upright, f"the pose at {stamp(0)} has a pitch beyond 80 degrees"),
    (POSES, told("ty_m", [0.0, -(2.0**62)]), r"'ty_m' must lie in \[-1e\+08, 1e\+08\], got"),
    (POSES, told("timestamp_ns", [-1, 2]), r"'timestamp_ns' must lie in .* got -1 in row 0"),
    (POSES, rows(1), f"no pose for the timestamp {stamp(1)} of annotations.feather"),
    (POSES, rows(0), f"no pose for the timestamp {stamp(0)} of annotations.feather"),
]


def assert_named(log, message):
    # A study asks for the files of a film before the film.
    for read in (argoverse2_film, sweep_files):
        with pytest.raises(InvalidInput, match=message) as caught:
            read(log)
        assert "\n" not in str(caught.value)
        assert str(log) in str(caught.value)


@pytest.mark.parametrize(("file", "change", "message"), CHANGED)
def test_what_is_wrong_with_a_table_is_said_in_one_line(tmp_path, file, change, message):
    log = parked(tmp_path / "log", CAR_AHEAD, sweeps=2)
    rewrite(log / file, change)
    assert_named(log, f"{file}: .*{message}")


@pytest.mark.parametrize("file", [BOXES, POSES])
def test_a_file_that_is_missing_or_damaged_is_said_in_one_line(tmp_path, file):
    log = parked(tmp_path / "log", CAR_AHEAD, sweeps=2)
    whole = (log / file).read_bytes()
    for content in (whole[:300], b"", whole.replace(b"tx_m", b"tx_\xed")):
        (log / file).write_bytes(content)
        assert_named(log, f"{file}: no readable Feather file")
    (log / file).unlink()
    assert_named(log, "feather: no such file")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (box("SPACESHIP", (9, 0, 0)), "unknown category 'SPACESHIP'; known: ANIMAL, "),
        (box("BUS", (9, 0, 0), (4, 0, 2)), r"'width_m' must lie in \[0.01, 200\], got 0 in row 1"),
        (box("BUS", (9, 1e308, 0)), r"'ty_m' must lie in \[-10000, 10000\], got 1e\+308 in row 1"),
        (box("BUS", (9, 0, 0), pitch=-1.5), f"'BUS' at {stamp(0)} has a pitch beyond 80 degrees"),
        (box("BUS", (9, 0, 0)) | {"qw": 1e308}, "has a quaternion that is not of length"),
        (box("BUS", (9, np.nan, 0)), "column 'ty_m' has a value that is not finite, in row 1"),
        (box("BUS", (9, 0, 0)) | {"qx": None}, "column 'qx' has 1 empty values"),
    ],
)
def test_a_wrong_box_is_named(tmp_path, wrong, message):
    with pytest.raises(InvalidInput, match=message):
        argoverse2_film(parked(tmp_path, CAR_AHEAD, wrong))
