"""Generated streets beside recorded sweeps, before and after `clutter`; then detectors on these.

    python docs/examples/sweeps/real_sweeps.py DATA out [WEIGHTS.npz ...]

DATA holds what was recorded; what is absent is left out:
    nuscenes/*.pcd.bin                      a sweep of an HDL-32E
    argoverse2/LOG/sensors/lidar/*.feather  an annotated sweep of two VLP-32C, with its log
    nuscenes-mini/v1.0-mini                 boxes with their numbers of returns
WEIGHTS are files that `care-sim train detector` wrote. Writes out.md and out.svg.
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from care_sim.base.files import write_text
from care_sim.core.conditions import FilmedReturns
from care_sim.core.grid import AngularGrid
from care_sim.core.sensor_setup import LIDAR_POSITION
from care_sim.core.types import CLASSES
from care_sim.evaluation.sightings import RANGE_M
from care_sim.loops.film import Shot
from care_sim.perception.cluster.detector import ClusterDetector
from care_sim.perception.cluster.points import heights_above, road_plane
from care_sim.perception.matching import UNSERVED, served_by
from care_sim.perception.pillars.detector import LEAST_SCORE, PillarsDetector
from care_sim.reports.figures.styles import colours, default_style, save
from care_sim.reports.table import Table
from care_sim.sensors.annotated import Annotations
from care_sim.sensors.setups import sensor_setup
from care_sim.sources.argoverse2.recordings import (
    ARGOVERSE2_SENSOR_HEIGHT_M,
    UP_LIDAR,
    annotations_at,
)
from care_sim.sources.argoverse2.tables import read_points as argoverse2_points
from care_sim.sources.nuscenes.categories import NUSCENES_CATEGORIES
from care_sim.sources.nuscenes.sweeps import OWN_CAR_M
from care_sim.sources.nuscenes.sweeps import read_points as nuscenes_points
from care_sim.sources.street_films import record
from care_sim.streets.street import make_street

SEEDS = range(2000, 2012)  # Validation seeds: three streets of each layout.
KEYFRAMES = slice(0, 40, 13)
GRID = AngularGrid()
NUSCENES_COLUMNS = 1084  # Firings of a turn in the file.
NUSCENES_HEIGHT_M = 1.84
GRID_HEIGHT_M = LIDAR_POSITION[2]
CLEAN, CLUTTERED = "clean streets", "cluttered streets"
RANGES_M = (0, 10, 20, 30, 50)
SUSPECTED = 0.02
SWEEPS_ARGOVERSE2 = "argoverse2/*/sensors/lidar/*.feather"
EDGE_M = 0.15
UPPER_LASERS = 32
HEIGHTS_M = (-9.0, 0.25, 0.75, 1.25, 2.0, 3.0, 4.5, 99.0)


class Sweep(NamedTuple):
    """A recorded sweep: `points` (P, 3) in the sensor frame, what is annotated, if anything, and
    the row of the grid (P,) that each point was fired in, where it has the same rows.
    """

    name: str
    points: np.ndarray
    height_m: float
    there: Annotations | None = None
    rows: np.ndarray | None = None


def recorded(data: Path) -> Iterator[Sweep]:
    """The sweeps in a folder."""
    for path in sorted(data.glob(SWEEPS_ARGOVERSE2)):
        points = argoverse2_points(path)[:, :3] - UP_LIDAR
        there = annotations_at(path.parents[2], int(path.stem))
        yield Sweep("Argoverse 2", points, ARGOVERSE2_SENSOR_HEIGHT_M, there)
    for path in sorted(data.glob("nuscenes/*.pcd.bin")):
        points = nuscenes_points(path)
        points = points[np.linalg.norm(points[:, :3], axis=1) > OWN_CAR_M]
        rows = GRID.rows - 1 - points[:, 4].astype(int)
        yield Sweep("nuScenes", points[:, :3], NUSCENES_HEIGHT_M, rows=rows)


def past_boxes(path: Path) -> Table:
    """Tabulate the returns of the upper LiDAR's rays that meet a labelled box within range first. A
    return lies on the box, up to EDGE_M off it; behind it; before it, where something hides it; or
    there is none. The rays are those of the grid, which has as many as the LiDAR.
    """
    read = argoverse2_points(path)
    points = read[read[:, 4] < UPPER_LASERS, :3] - UP_LIDAR
    there = annotations_at(path.parents[2], int(path.stem))
    there = there.take(np.hypot(*there.boxes[:, :2].T) <= RANGE_M)
    grid = sensor_setup("argoverse-2").grid.heads[0].grid
    ranges = np.linalg.norm(points, axis=1)
    _, _, cast = met_boxes(grid.directions, there.boxes)
    near, far, returned = met_boxes(points / ranges[:, None], there.boxes)
    rows = []
    for label in np.unique(there.classes):
        (own,) = np.nonzero(there.classes == label)
        rays, on = np.isin(cast, own).sum(), np.isin(returned, own)
        before = (on & (ranges < near - EDGE_M)).sum()
        behind = (on & (ranges > far + EDGE_M)).sum()
        shares = [on.sum() - before - behind, behind, rays - on.sum()]
        told = (f"{100 * one / (rays - before):.0f}" for one in shares)
        rows.append((CLASSES[label], str(len(own)), str(rays), str(before), *told))
    columns = "class", "objects", "rays", "before", "in the box, %", "behind, %", "nothing, %"
    return Table("Rays of the upper LiDAR of Argoverse 2 through labelled boxes", columns, (*rows,))


def met_boxes(ways: np.ndarray, boxes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where rays along unit vectors (n, 3) enter (n,) and leave (n,) the first of boxes (m, 7) that
    they meet, and which it is (n,), -1 for none.
    """
    near, far = np.full(len(ways), np.inf), np.zeros(len(ways))
    which = np.full(len(ways), -1)
    for number, (*centre, length, width, height, yaw) in enumerate(boxes.tolist()):
        cos, sin = np.cos(yaw), np.sin(yaw)
        axes = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
        along, middle = ways @ axes.T, axes @ centre
        half = np.array([length, width, height]) / 2
        with np.errstate(divide="ignore"):
            sides = np.stack([(middle - half) / along, (middle + half) / along])
        enters, leaves = sides.min(axis=0).max(axis=1), sides.max(axis=0).min(axis=1)
        first = (enters <= leaves) & (enters > 0) & (enters < near)
        near[first], far[first], which[first] = enters[first], leaves[first], number
    return near, far, which


def generated(clutter: bool) -> list[Shot]:
    """Keyframes of generated streets."""
    shots: list[Shot] = []
    for seed in SEEDS:
        street = make_street(seed, clutter)
        some = replace(
            street,
            poses=street.poses[KEYFRAMES],
            ego=street.ego[KEYFRAMES],
            motion=street.motion[KEYFRAMES],
        )
        shots += record(some, returns=FilmedReturns(clutter=clutter)).shots
    return shots


def thinned(sweep: Sweep) -> Sweep:
    """The nearest return of every cell of the paper's grid: as dense as generated sweeps are."""
    ranges = np.linalg.norm(sweep.points, axis=1)
    cells = GRID.cells_of(sweep.points)
    kept = np.flatnonzero((cells >= 0) & (ranges <= GRID.range_m))
    kept = kept[np.lexsort((ranges[kept], cells[kept]))]
    _, firsts = np.unique(cells[kept], return_index=True)
    name = f"{sweep.name}, a return per cell"
    return sweep._replace(name=name, points=sweep.points[kept[firsts]])


def silent_rows(rows: np.ndarray, columns: int) -> np.ndarray:
    """(rows,) the share of the firings of each row without a return within reach."""
    return 1 - np.bincount(rows, minlength=GRID.rows) / columns


def heights(points: np.ndarray, height_m: float) -> np.ndarray:
    """(P,) heights above the fitted road of the returns from 5 to 30 m."""
    away = np.hypot(points[:, 0], points[:, 1])
    return heights_above(points, road_plane(points, height_m))[(away > 5) & (away < 30)]


def slope(points: np.ndarray, height_m: float) -> float:
    """Steepest slope of the fitted road against the sensor, percent."""
    return 100 * float(np.hypot(*road_plane(points, height_m)[:2]))


Rows = dict[str, np.ndarray]
Counts = dict[tuple[str, int], list[float]]
"""Returns per object, by class and the place of its range in RANGES_M."""


def counted(classes: np.ndarray, ranges: np.ndarray, returns: np.ndarray) -> Counts:
    """The returns of objects that have any."""
    made: Counts = {}
    bins = np.searchsorted(RANGES_M, ranges, side="right") - 1
    for label, place, many in zip(classes.tolist(), bins.tolist(), returns.tolist(), strict=True):
        if many >= 1 and place < len(RANGES_M) - 1:
            made.setdefault((CLASSES[label], place), []).append(many)
    return made


def of_shots(shots: list[Shot]) -> Counts:
    """The returns of objects in generated streets."""
    columns = []
    for shot in shots:
        objects = shot.annotations.objects
        returns = [(shot.cloud.objects == one).sum() for one in objects]
        away = np.hypot(*shot.annotations.boxes[:, :2].T)
        columns.append((shot.annotations.classes, away, np.array(returns)))
    return counted(*map(np.concatenate, zip(*columns, strict=True)))


def of_nuscenes(folder: Path) -> Counts:
    """The returns that nuScenes counted, as if its turn had the grid's columns."""
    read = {
        name: {row["token"]: row for row in json.loads((folder / f"{name}.json").read_text())}
        for name in ("sample_annotation", "instance", "category", "sample_data", "ego_pose")
    }
    cars = {
        row["sample_token"]: read["ego_pose"][row["ego_pose_token"]]["translation"]
        for row in read["sample_data"].values()
        if "LIDAR_TOP" in row["filename"] and row["is_key_frame"]
    }
    classes, away, returns = [], [], []
    for row in read["sample_annotation"].values():
        instance = read["instance"][row["instance_token"]]
        label = NUSCENES_CATEGORIES.get(read["category"][instance["category_token"]]["name"])
        if label in CLASSES:
            classes.append(CLASSES.index(label))
            away.append(np.hypot(*np.subtract(row["translation"], cars[row["sample_token"]])[:2]))
            returns.append(row["num_lidar_pts"] * GRID.columns / NUSCENES_COLUMNS)
    return counted(np.array(classes), np.array(away), np.ceil(returns))


def judged(
    detector: ClusterDetector | PillarsDetector, sweep: Sweep, least: float
) -> tuple[dict[str, str], float]:
    """Boxes of a detector within range and what they find; and its precision on cars. The last
    count takes all suspected boxes: cars found while a share `least` of the boxes of cars is right.
    """
    suspected = detector.detect(sweep.points, sweep.height_m)
    suspected = suspected.take(np.hypot(*suspected.boxes[:, :2].T) <= RANGE_M)
    sure = isinstance(detector, ClusterDetector) | (suspected.scores >= LEAST_SCORE)
    report = suspected.take(np.broadcast_to(sure, len(suspected)))
    made = {"boxes": str(len(report))}
    made |= {name: str((report.classes == n).sum()) for n, name in enumerate(CLASSES)}
    if sweep.there is None:
        return made, 0.0
    near = np.hypot(*sweep.there.boxes[:, :2].T) <= RANGE_M
    car = CLASSES.index("car")
    found = served_by(sweep.there, report) != UNSERVED
    cars = near & (sweep.there.classes == car)
    boxes = suspected.take(suspected.classes == car)
    boxes = boxes.take(np.argsort(-boxes.scores, kind="stable"))
    server = served_by(sweep.there.take(cars), boxes)
    right = np.isin(np.arange(len(boxes)), server[server != UNSERVED])
    hits = np.cumsum(right)
    precise = hits / np.arange(1, len(boxes) + 1) >= least
    made |= {
        f"found of {near.sum()}": str((near & found).sum()),
        f"cars of {cars.sum()}": str((cars & found).sum()),
        "cars as precisely as cluster": str(hits[precise].max(initial=0)),
    }
    return made, float(right[: (report.classes == car).sum()].mean())


@default_style()
def figure_of(silent: Rows, profiles: Rows, cars: Rows) -> Figure:
    """Three panels: silence by row, heights, returns of cars by range."""
    figure = Figure(figsize=(11.0, 3.6), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    rows = np.degrees(GRID.elevations)
    edges = [f"{low:g} to {high:g}" for low, high in pairwise(HEIGHTS_M)]
    edges[0], edges[-1] = f"below {HEIGHTS_M[1]:g}", f"above {HEIGHTS_M[-2]:g}"
    spans = [f"{low} to {high}" for low, high in pairwise(RANGES_M)]
    for name, colour in colours(silent | profiles | cars).items():
        if name in silent:
            left.plot(rows, 100 * silent[name], color=colour, label=name)
        if name in profiles:
            middle.plot(edges, 100 * profiles[name], "o-", color=colour, label=name)
        if name in cars:
            right.plot(spans, cars[name], "o-", color=colour, label=name)
    left.set(xlabel="elevation of the row (degrees)", ylabel="rays without return (%)")
    middle.set(xlabel="height above the road (m)", ylabel="returns from 5 to 30 m (%)")
    right.set(xlabel="range (m)", ylabel="returns of a car, median", yscale="log")
    middle.tick_params("x", rotation=45)
    for axes in (left, middle, right):
        axes.legend()
    return figure


def main(data: Path, out: Path, *weights: str) -> None:
    """Compare, judge, write."""
    sweeps = [*recorded(data)]
    streets = {name: generated(name == CLUTTERED) for name in (CLEAN, CLUTTERED)}
    silent, profiles, counts, slopes = {}, {}, {}, []
    for name, shots in streets.items():
        clouds = [shot.cloud.points for shot in shots]
        rows = [shot.cloud.cells // GRID.columns for shot in shots]
        silent[name] = np.mean([silent_rows(one, GRID.columns) for one in rows], axis=0)
        profiles[name] = profile(np.concatenate([heights(one, GRID_HEIGHT_M) for one in clouds]))
        steep = [slope(one, GRID_HEIGHT_M) for one in clouds]
        slopes.append((name, f"{np.median(steep):.1f}", f"{max(steep):.1f}"))
        counts[name] = of_shots(shots)
    for sweep in sweeps:
        if sweep.rows is not None:
            within = np.linalg.norm(sweep.points, axis=1) <= GRID.range_m
            silent[sweep.name] = silent_rows(sweep.rows[within], NUSCENES_COLUMNS)
        profiles[sweep.name] = profile(heights(sweep.points, sweep.height_m))
        slopes.append((sweep.name, f"{slope(sweep.points, sweep.height_m):.1f}", ""))
    if (tables := data / "nuscenes-mini" / "v1.0-mini").is_dir():
        counts["nuScenes"] = of_nuscenes(tables)
    spans = [f"{low} to {high} m" for low, high in pairwise(RANGES_M)]
    told = [
        Table("Slope of the road against the sensor, %", ("", "median", "most"), tuple(slopes)),
        Table(
            "Returns of an object that has any, median (objects), on 512 columns",
            ("", "class", *spans),
            tuple(
                (name, label, *spread(own, label))
                for name, own in counts.items()
                for label in CLASSES
            ),
            names=2,
        ),
    ]
    told += map(past_boxes, sorted(data.glob(SWEEPS_ARGOVERSE2)))
    detectors: dict[str, ClusterDetector | PillarsDetector] = {
        "cluster": ClusterDetector(),
        "pillars": PillarsDetector(least_score=SUSPECTED),
        "pillars, weights=clutter": PillarsDetector(weights="clutter", least_score=SUSPECTED),
    }
    for file in weights:
        detectors[f"pillars, {Path(file).stem}"] = PillarsDetector(file, SUSPECTED)
    for sweep in [one for each in sweeps for one in (each, thinned(each))]:
        _, least = judged(detectors["cluster"], sweep, 0.0)
        rows = {name: judged(one, sweep, least)[0] for name, one in detectors.items()}
        columns = next(iter(rows.values()))
        lines = ((name, *row.values()) for name, row in rows.items())
        told.append(Table(f"Boxes on {sweep.name}", ("detector", *columns), tuple(lines)))
    write_text(out.with_suffix(".md"), "\n".join(table.markdown() for table in told))
    cars = {
        name: np.array(
            [np.median(own.get(("car", place), [np.nan])) for place in range(len(spans))]
        )
        for name, own in counts.items()
    }
    save(figure_of(silent, profiles, cars), out)
    print(out.with_suffix(".md").read_text())


def profile(above: np.ndarray) -> np.ndarray:
    """The shares of heights between HEIGHTS_M."""
    return np.histogram(above, HEIGHTS_M)[0] / len(above)


def spread(counts: Counts, label: str) -> list[str]:
    """Median and number by range."""
    own = [counts.get((label, place), []) for place in range(len(RANGES_M) - 1)]
    return [f"{np.median(one):.0f} ({len(one)})" if one else "-" for one in own]


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), *sys.argv[3:])
