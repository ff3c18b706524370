"""Folders of sweeps with the poses of the car."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats
from care_sim.sources.film_checks import FULL_TURN
from care_sim.sources.sweeps.logs import Log
from care_sim.sources.sweeps.points import READERS, read_sweep
from care_sim.sources.sweeps.tables import columns_of, in_seconds, read_csv

SWEEPS_FOLDER, POSES_FILE, TIMES_FILE = "sweeps", "poses.csv", "times.csv"
_TURN = ("qx", "qy", "qz", "qw")
_LEAST_NAME = 1e9
"""A whole number below this may be the number of a sweep, and is no time."""


def log_of_folder(folder: Path) -> Log:
    """Return the log in a folder: `sweeps/`, files of one kind, `poses.csv`, and `times.csv` where
    the names of the sweeps are not their times.

    Raises InvalidInput for what is missing or ambiguous.
    """
    sweeps = _sweep_files(folder / SWEEPS_FOLDER)
    times = _times(folder, sweeps)
    order = np.argsort(times, kind="stable")
    files = [sweeps[row] for row in order.tolist()]
    path = folder / POSES_FILE
    return Log(
        folder.name,
        str(folder / SWEEPS_FOLDER),
        times[order],
        lambda number: read_sweep(files[number]),
        _poses(path),
        str(path),
    )


def _sweep_files(folder: Path) -> list[Path]:
    found = sorted(path for path in folder.glob("*") if path.suffix in READERS)
    kinds = sorted({path.suffix for path in found})
    if len(kinds) != 1:
        raise InvalidInput(
            f"{folder}: sweeps must be files of one kind, {', '.join(READERS)}, got "
            f"{' and '.join(kinds) or 'none'}"
        )
    return found


def _times(folder: Path, sweeps: list[Path]) -> Floats:
    """Return (n,) the seconds of the sweeps, by `times.csv`, else by their names."""
    path = folder / TIMES_FILE
    if path.exists():
        table = read_csv(path)
        times = in_seconds(columns_of(path, table, ["time"])[:, 0])
        names = map(str, table["file"].to_pylist() if "file" in table.column_names else ())
        told = dict(zip(names, times.tolist(), strict=False))
        for sweep in sweeps:
            if sweep.name not in told:
                raise InvalidInput(f"{path}: no row of columns file and time for {sweep.name}")
        return np.array([told[sweep.name] for sweep in sweeps])
    for sweep in sweeps:
        whole, point, part = sweep.stem.partition(".")
        is_time = whole.isdecimal() and (part.isdecimal() if point else True)
        if not is_time or not (point or float(whole[:40]) >= _LEAST_NAME):
            raise InvalidInput(
                f"{sweep}: its name is no time: nano-, micro- or milliseconds since 1970, or "
                f"seconds with a decimal point; write {TIMES_FILE} with the columns file and time"
            )
    return in_seconds(np.array([float(sweep.stem[:40]) for sweep in sweeps]))


def _poses(path: Path) -> Floats:
    """Return (m, 8) seconds, x, y, z and quaternion x, y, z, w of the car."""
    if not path.is_file():
        raise InvalidInput(
            f"{path}: no such file; it holds the poses of the car, columns time, x, y, z (metres) "
            "and yaw (radians) or qx, qy, qz, qw; a single row where the car stands"
        )
    table = read_csv(path)
    place = columns_of(path, table, ("time", "x", "y", "z"))
    if "yaw" in table.column_names:
        (yaws,) = columns_of(path, table, ["yaw"]).T
        wrong = ~(np.abs(yaws) <= FULL_TURN)
        if wrong.any():
            got = shown(float(yaws[wrong.argmax()]))
            raise InvalidInput(f"{path}: yaw must be radians within a full turn, got {got}")
        turns = Rotation.from_euler("Z", yaws[:, None]).as_quat()
    else:
        turns = columns_of(path, table, _TURN)
    return np.column_stack([in_seconds(place[:, 0]), place[:, 1:], turns])
