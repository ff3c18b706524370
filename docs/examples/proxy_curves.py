"""Recall by returns: proxies, detectors that run on points, and detectors as they were measured.

    python docs/examples/proxy_curves.py --streets 4

plays full scans of generated streets, prints tables and draws `proxy-recall.svg`. Detectors on
points also get two thinned scans: one with every cell at a chance of a quarter, one with the
quarter of each object's returns that lies nearest to its middle, the ground in full.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from care_sim.core.types import CLASSES
from care_sim.perception.detectors import make_detector
from care_sim.perception.matching import found_objects
from care_sim.perception.measured.recall import FIRST_HIT, recall
from care_sim.perception.measured.tables import MEASURED, measurement
from care_sim.perception.proxy import chance
from care_sim.reports.figures.styles import (
    BLUE,
    GREEN,
    INK,
    ORANGE,
    YELLOW,
    default_style,
    name_ends,
    svg_text,
)
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.sources.street_films import street_film

KINDS = {"cars": "car", "people": "pedestrian"}
BINS = ((1, 1), (2, 2), (3, 3), (4, 5), (6, 8), (9, 16), (17, 32), (33, 10**6))
FIRST_STREET, EVERY = 1000, 4
"""The streets are those of the calibration, of every fourth keyframe."""
REACH_M = 50.0
POINTS = ("cluster", "pillars")
TICKS = (1, 2, 3, 5, 10, 20, 50)
HUES = (INK, YELLOW, BLUE, ORANGE, GREEN, "#7468C0", "#C2478A")


def whole(cloud, _, __):
    """The full scan."""
    return np.ones(len(cloud), bool)


def thinned(cloud, _, rng):
    """Every cell with a chance of a quarter."""
    return rng.random(len(cloud)) < 0.25


def bunched(cloud, annotations, _):
    """The quarter of each object's returns that is nearest to its middle."""
    kept = cloud.objects == NO_OBJECT
    for number, box in zip(annotations.objects, annotations.boxes, strict=True):
        rows = np.flatnonzero(cloud.objects == number)
        away = np.linalg.norm(cloud.points[rows] - box[:3], axis=1)
        kept[rows[np.argsort(away)[: -(-len(rows) // 4)]]] = True
    return kept


SCANS = {"full": whole, "thinned": thinned, "bunched": bunched}


def measure(streets):
    """{(detector, scan): rows of class, returns and whether the object is found}."""
    detectors = {name: make_detector(name, 1.84) for name in POINTS}
    rows = {(name, scan): [] for name in POINTS for scan in SCANS}
    rng = np.random.default_rng(0)
    for seed in range(FIRST_STREET, FIRST_STREET + streets):
        for shot in street_film(seed).shots[::EVERY]:
            near = np.hypot(*shot.annotations.boxes[:, :2].T) <= REACH_M
            for scan, chosen in SCANS.items():
                cloud = shot.cloud.take(chosen(shot.cloud, shot.annotations, rng))
                returns = (cloud.objects[:, None] == shot.annotations.objects).sum(axis=0)
                for name, detector in detectors.items():
                    report, _ = detector.detect(cloud, shot.annotations)
                    found = found_objects(shot.annotations, report)
                    columns = shot.annotations.classes, returns, found
                    rows[name, scan].append(np.column_stack(columns)[near])
    return {key: np.concatenate(own) for key, own in rows.items()}


def by_returns(rows, kind):
    """(bins, 2) percent found, and how many objects there were."""
    own = rows[rows[:, 0] == CLASSES.index(kind)]
    told = []
    for least, most in BINS:
        found = own[(own[:, 1] >= least) & (own[:, 1] <= most), 2]
        told.append((100 * found.mean() if len(found) else np.nan, len(found)))
    return np.array(told)


def half(name, kind, share):
    """Returns of ours with which a measured detector finds half, where each counts a `share`."""
    returns = np.geomspace(0.05, 2000, 20000)
    found = recall(name, kind, returns) >= 0.5
    worth = measurement(name).recall.worth[CLASSES.index(kind)]
    return returns[found.argmax()] / worth / share if found.any() else np.inf


@default_style()
def draw(rows, path):
    """Draw the recall of all by the returns of our full scan, with names at the right."""
    returns = np.arange(1, 65)
    places = [np.sqrt(least * min(most, 64)) for least, most in BINS]
    shown = "returns, the proxy", "graded", *MEASURED, *POINTS
    hues = dict(zip(shown, HUES, strict=True))
    figure = Figure(figsize=(9.2, 3.6), layout="constrained")
    for axes, (title, kind) in zip(figure.subplots(1, 2, sharey=True), KINDS.items(), strict=True):
        curves = {
            "returns, the proxy": ([1, 3, 3, 64], [0, 0, 100, 100], "-"),
            "graded": (returns, 100 * chance(kind, returns), "--"),
        }
        for name in MEASURED:
            worth = measurement(name).recall.worth[CLASSES.index(kind)]
            curves[name] = returns, 100 * recall(name, kind, worth * returns), "-"
            if measurement(name).sweeps > 1:
                newcomers = 100 * recall(name, kind, worth * returns, 0)
                axes.plot(returns, newcomers, ":", color=hues[name])
        for name, marker in zip(POINTS, "o^", strict=True):
            curves[name] = places, by_returns(rows[name, "full"], kind)[:, 0], marker
        for name, curve in curves.items():
            axes.plot(*curve, color=hues[name], markersize=5)
        axes.set(title=title, xscale="log", xlabel="returns of the full scan", ylim=(0, 102))
        axes.set_xticks(TICKS, [str(tick) for tick in TICKS])
        axes.minorticks_off()
    figure.axes[0].set_ylabel("detected, percent (dotted: newcomers)")
    name_ends(figure, {axes: {name: (own[1][-1], hues[name]) for name, own in curves.items()}})
    path.write_text(svg_text(figure, path.stem), encoding="utf-8")


def main():
    """Measure, print and draw."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--streets", type=int, default=4)
    parser.add_argument("--out", type=Path, default=Path("proxy-recall.svg"))
    options = parser.parse_args()
    rows = measure(options.streets)
    for title, kind in KINDS.items():
        print(f"\n{title}, percent found by returns (objects)")
        print("| | " + " | ".join(f"{a}-{b}" if a < b else f"{a}" for a, b in BINS) + " |")
        for (name, scan), own in rows.items():
            cells = [f"{share:.0f} ({count:.0f})" for share, count in by_returns(own, kind)]
            print(f"| {name}, {scan} | " + " | ".join(cells) + " |")
        steps = np.array([least for least, _ in BINS])
        print("| graded | " + " | ".join(f"{100 * chance(kind, n):.0f}" for n in steps) + " |")
        for name in MEASURED:
            worth = measurement(name).recall.worth[CLASSES.index(kind)]
            for label, before in (("steady", None), ("newcomers", 0)):
                shares = 100 * recall(name, kind, worth * steps, before)
                print(f"| {name}, {label} | " + " | ".join(f"{one:.0f}" for one in shares) + " |")
    print("\nreturns of ours with which half is found: steady, first keyframe of a film")
    for name in MEASURED:
        known = np.array(CLASSES)[measurement(name).recall.known]
        for kind in known:
            new = FIRST_HIT if measurement(name).sweeps > 1 else 1.0
            print(f"{name} {kind}: {half(name, kind, 1.0):.2f} {half(name, kind, new):.2f}")
    draw(rows, options.out)


if __name__ == "__main__":
    main()
