"""Which part of the clutter misleads a detector: full scans of held-out streets with one part of it
at a time.

    python docs/examples/sweeps/clutter_by_part.py out.md [WEIGHTS.npz ...]

WEIGHTS are files that `care-sim train detector` wrote.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

from care_sim.base.files import write_text
from care_sim.core.conditions import FilmedReturns
from care_sim.evaluation.sightings import RANGE_M
from care_sim.loops.film import Shot
from care_sim.perception.cluster.detector import ClusterDetector
from care_sim.perception.matching import UNSERVED, served_by
from care_sim.perception.pillars.detector import PillarsDetector
from care_sim.reports.table import Table
from care_sim.sensors.annotated import Cloud
from care_sim.sources import street_films
from care_sim.streets.street import Street, make_street

SEEDS = range(2032, 2048)  # Held out from training and calibration.
KEYFRAMES = slice(10, 31, 20)
RETURNS, SLOPES, REST, ALL = "losses and errors of returns", "slopes", "posts, bins, benches", "all"
KINDS = {
    "kerbs and verges": {"pavement", "verge"},
    "vegetation": {"bush", "tree"},
    "fronts": {"relief"},
}
PARTS = ("none", SLOPES, *KINDS, RETURNS, REST, ALL)


def shots(seed: int, part: str) -> Iterator[Shot]:
    """Some keyframes of a street with a part of its clutter."""
    whole = make_street(seed, clutter=True)
    strewn = [one for one in whole.clutter if one[0].name in KINDS.get(part, ())]
    if part == REST:
        others = set().union(*KINDS.values())
        strewn = [one for one in whole.clutter if one[0].name not in others]
    street = whole if part == ALL else replace(make_street(seed), clutter=tuple(strewn))
    level, lossless = part not in (SLOPES, ALL), part not in (RETURNS, ALL)
    with (
        patch.object(street_films, "slopes", flat if level else street_films.slopes),
        patch.object(
            street_films,
            "add_recorded_losses",
            same if lossless else street_films.add_recorded_losses,
        ),
    ):
        film = street_films.record(some_of(street), returns=FilmedReturns(clutter=True))
    yield from film.shots


def some_of(street: Street) -> Street:
    """The street at the keyframes that are looked at."""
    told = (getattr(street, name)[KEYFRAMES] for name in ("poses", "ego", "motion"))
    return replace(street, **dict(zip(("poses", "ego", "motion"), told, strict=True)))


def flat(ego: np.ndarray, _rng: np.random.Generator) -> np.ndarray:
    """No slopes."""
    return np.zeros((len(ego), 2))


def same(cloud: Cloud, *_: object) -> Cloud:
    """No losses."""
    return cloud


def main(out: Path, *weights: str) -> None:
    """Judge and write."""
    detectors: dict[str, ClusterDetector | PillarsDetector] = {
        "cluster": ClusterDetector(),
        "pillars": PillarsDetector(),
        "pillars, weights=clutter": PillarsDetector(weights="clutter"),
    }
    detectors |= {Path(file).stem: PillarsDetector(file) for file in weights}
    rows = []
    for part in PARTS:
        counts = dict.fromkeys(detectors, np.zeros(3, int))
        for shot in (shot for seed in SEEDS for shot in shots(seed, part)):
            there = shot.annotations
            near = np.hypot(*there.boxes[:, :2].T) <= RANGE_M
            there = there.take(near & np.isin(there.objects, shot.cloud.objects))
            for name, detector in detectors.items():
                boxes = detector.detect(shot.cloud.points, shot.sensor.z)
                boxes = boxes.take(np.hypot(*boxes.boxes[:, :2].T) <= RANGE_M)
                hits = (served_by(there, boxes) != UNSERVED).sum()
                counts[name] = counts[name] + [hits, len(there), len(boxes)]
        told = (f"{100 * h / n:.1f} / {100 * h / max(b, 1):.1f}" for h, n, b in counts.values())
        rows.append((part, *told))
    title = f"Recall of what has a return / precision, percent, on {len(SEEDS)} streets"
    write_text(out, Table(title, ("part", *detectors), tuple(rows)).markdown())
    print(out.read_text())


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
