import numpy as np
import pyarrow as pa
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.sources.argoverse2.recordings import argoverse2_film, sweep_files
from tests.helpers.av2_log import CAR_AHEAD, box, parked, replaced, rewrite, stamp


def damaged(table, name):
    """A column of text whose bytes are none."""
    letters = pa.py_buffer(b"\xff" * len(table))
    ends = pa.py_buffer(np.arange(len(table) + 1, dtype=np.int32))
    column = pa.StringArray.from_buffers(len(table), ends, letters)
    return table.set_column(table.column_names.index(name), name, column)


def upright(table):
    """Poses of a car that points straight up."""
    half = [0.5**0.5] * len(table)
    return replaced(replaced(table, "qw", half), "qy", half)


BREAKS = {
    "no annotations": (
        lambda log: (log / "annotations.feather").unlink(),
        r"annotations\*\.feather: no such file",
    ),
    "no poses": (
        lambda log: (log / "city_SE3_egovehicle.feather").unlink(),
        "city_SE3_egovehicle.feather: no such",
    ),
    "truncated": (
        lambda log: (log / "annotations.feather").write_bytes(
            (log / "annotations.feather").read_bytes()[:300]
        ),
        "annotations.feather: no readable Feather file",
    ),
    "empty file": (
        lambda log: (log / "annotations.feather").write_bytes(b""),
        "no readable Feather file",
    ),
    "no column": (
        lambda log: rewrite(log / "annotations.feather", lambda t: t.drop_columns(["width_m"])),
        "annotations.feather: lacks the column 'width_m'; needed: timestamp_ns",
    ),
    "two columns": (
        lambda log: rewrite(
            log / "annotations.feather", lambda t: t.append_column("tx_m", t["tx_m"])
        ),
        "annotations.feather: has 2 columns 'tx_m'; needed: timestamp_ns",
    ),
    "half points": (
        lambda log: rewrite(
            log / "annotations.feather", lambda t: replaced(t, "num_interior_pts", [1.5] * len(t))
        ),
        "annotations.feather: column 'num_interior_pts' must hold int values, has double",
    ),
    "numbers as text": (
        lambda log: rewrite(
            log / "annotations.feather", lambda t: replaced(t, "tx_m", ["1.5"] * len(t))
        ),
        "annotations.feather: column 'tx_m' must hold float values, has string",
    ),
    "flags": (
        lambda log: rewrite(
            log / "annotations.feather", lambda t: replaced(t, "tx_m", [True] * len(t))
        ),
        "annotations.feather: column 'tx_m' must hold float values, has bool",
    ),
    "text as numbers": (
        lambda log: rewrite(
            log / "annotations.feather", lambda t: replaced(t, "track_uuid", [7] * len(t))
        ),
        "annotations.feather: column 'track_uuid' must hold str values, has int64",
    ),
    "no text": (
        lambda log: rewrite(log / "annotations.feather", lambda t: damaged(t, "category")),
        "annotations.feather: no readable Feather file",
    ),
    "a folder": (
        lambda log: ((log / "annotations.feather").unlink(), (log / "annotations.feather").mkdir()),
        "annotations.feather: no readable Feather file",
    ),
    "an object twice": (
        lambda log: rewrite(
            log / "annotations.feather", lambda t: pa.concat_tables([t, t.slice(1, 1)])
        ),
        f"annotations.feather: the track 'a' at {stamp(1)} is annotated twice",
    ),
    "two poses": (
        lambda log: rewrite(
            log / "city_SE3_egovehicle.feather", lambda t: pa.concat_tables([t, t.slice(1, 1)])
        ),
        f"city_SE3_egovehicle.feather: two poses at {stamp(1)}",
    ),
    "no turn": (
        lambda log: rewrite(
            log / "city_SE3_egovehicle.feather", lambda t: replaced(t, "qw", [1.0, 0.0])
        ),
        f"city_SE3_egovehicle.feather: the pose at {stamp(1)} has a quaternion that is not of "
        "length 1",
    ),
    "upright": (
        lambda log: rewrite(log / "city_SE3_egovehicle.feather", upright),
        f"city_SE3_egovehicle.feather: the pose at {stamp(0)} has a pitch beyond 80 degrees",
    ),
    "a giant leap": (
        lambda log: rewrite(
            log / "city_SE3_egovehicle.feather", lambda t: replaced(t, "ty_m", [0.0, -(2.0**62)])
        ),
        r"city_SE3_egovehicle.feather: column 'ty_m' must lie in \[-1e\+08, 1e\+08\], got "
        r"-4.61169e\+18 in row 1",
    ),
    "before 1970": (
        lambda log: rewrite(
            log / "city_SE3_egovehicle.feather", lambda t: replaced(t, "timestamp_ns", [-1, 2])
        ),
        r"city_SE3_egovehicle.feather: column 'timestamp_ns' must lie in \[0, 4.61169e\+18\], "
        r"got -1 in row 0",
    ),
    "for years": (
        lambda log: rewrite(
            log / "annotations.feather", lambda t: replaced(t, "timestamp_ns", [0, 10**17])
        ),
        r"annotations.feather: its times span 1e\+08 s, and a drive may last 86400 s",
    ),
    "a name of no text": (
        lambda log: (log / "annotations.feather").write_bytes(
            (log / "annotations.feather").read_bytes().replace(b"width_m", b"width_\xed")
        ),
        "annotations.feather: no readable Feather file",
    ),
    "no rows": (
        lambda log: rewrite(log / "annotations.feather", lambda t: t.slice(0, 0)),
        "no annotations",
    ),
    "no pose": (
        lambda log: rewrite(log / "city_SE3_egovehicle.feather", lambda t: t.slice(0, 1)),
        f"city_SE3_egovehicle.feather: no pose for the timestamp {stamp(1)} of annotations.feather",
    ),
    "no poses at all": (
        lambda log: rewrite(log / "city_SE3_egovehicle.feather", lambda t: t.slice(0, 0)),
        f"city_SE3_egovehicle.feather: no pose for the timestamp {stamp(0)} of annotations.feather",
    ),
}


@pytest.mark.parametrize("name", BREAKS)
def test_what_is_wrong_with_a_log_is_said_in_one_line(tmp_path, name):
    breaks, message = BREAKS[name]
    log = parked(tmp_path / "log", CAR_AHEAD, sweeps=2)
    breaks(log)
    # A study asks for the files of a film before the film.
    for read in (argoverse2_film, sweep_files):
        with pytest.raises(InvalidInput, match=message) as caught:
            read(log)
        assert "\n" not in str(caught.value)
        assert str(log) in str(caught.value)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (box("SPACESHIP", (9, 0, 0)), "unknown category 'SPACESHIP'; known: ANIMAL, "),
        (
            box("BUS", (9, 0, 0), (4, 0, 2)),
            r"column 'width_m' must lie in \[0.01, 200\], got 0 in row 1",
        ),
        (
            box("BUS", (9, 0, 0), (5e-324, 2, 2)),
            r"column 'length_m' must lie in \[0.01, 200\], got 4.94066e-324 in",
        ),
        (
            box("BUS", (9, 0, 0), (4, 2, 2.0**62)),
            r"column 'height_m' must lie in \[0.01, 200\], got 4.61169e\+18 in",
        ),
        (
            box("BUS", (9, 1e308, 0)),
            r"column 'ty_m' must lie in \[-10000, 10000\], got 1e\+308 in row 1",
        ),
        (
            box("BUS", (9, 0, 0), pitch=-1.5),
            f"the track 'BUS' at {stamp(0)} has a pitch beyond 80 degrees",
        ),
        (
            box("BUS", (9, 0, 0)) | {"qw": 1e308},
            f"the track 'BUS' at {stamp(0)} has a quaternion that is not of length",
        ),
        (box("BUS", (9, np.nan, 0)), "column 'ty_m' has a value that is not finite, in row 1"),
        (
            box("BUS", (9, 0, 0)) | {"qw": 0.0, "qz": 0.0},
            "has a quaternion that is not of length 1",
        ),
        (box("BUS", (9, 0, 0)) | {"qx": None}, "column 'qx' has 1 empty values"),
    ],
)
def test_a_wrong_box_is_named(tmp_path, wrong, message):
    with pytest.raises(InvalidInput, match=message):
        argoverse2_film(parked(tmp_path, CAR_AHEAD, wrong))
