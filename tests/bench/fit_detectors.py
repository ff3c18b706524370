"""Fits the recall of the measured detectors from the recorded data.

    python -m tests.bench.fit_detectors ../shared/data
    python -m tests.bench.fit_detectors ../shared/data --write

prints the recall of each half of the data by returns: as measured, and as the fit of the other half
predicts. Halves are the two scenes of nuScenes, and the even and odd drives of KITTI. `--write`
puts the fit of all data into `care_sim/perception/measured/shipped`. It takes three minutes.

The fit is ordinal: an object has the formula's probability (`care_sim.perception.measured.recall`)
of a score within the band of its score. Rows count as independent.
"""

import argparse
import json
import re
from pathlib import Path

import numpy as np
from scipy.optimize import minimize
from scipy.special import ndtr

from care_sim.core.types import CLASSES
from care_sim.perception.measured.recall import FIRST_HIT
from care_sim.perception.measured.tables import MEASURED, SHIPPED, measurement
from tests.helpers import kitti_reports, nuscenes_reports

BINS = ((0, 0), (1, 1), (2, 2), (3, 3), (4, 5), (6, 8), (9, 16), (17, 32), (33, 10**6))
RAY_BINS = ((0, 16), (17, 32), (33, 64), (65, 128), (129, 256), (257, 10**6))
KINDS = ("car", "pedestrian", "truck", "bicycle")
"""The classes. One that is `as` another in the shipped table has its curve, but for a shift: there
are too few of it."""


def rows_of(data, detector):
    """Rows of `OBJECT` of the objects within 50 m."""
    if detector == "pointrcnn":
        return kitti_reports.objects_of(data / "kitti-tracking")
    return nuscenes_reports.objects_of(data / "nuscenes-mini", detector)


def of_class(rows, kind):
    """The rows of one class."""
    return rows[rows["label"] == CLASSES.index(kind)]


def bins_of(detector):
    """The bins of returns, each with its least and its most."""
    return RAY_BINS if detector == "pointrcnn" else BINS


def shares(rows, curve):
    """(n, cuts) the probabilities that each row scores at least as much as at each of the cuts."""
    now = rows["returns"]
    average = FIRST_HIT * now + (1 - FIRST_HIT) * rows["previous"]
    lost = now + curve["fall"] / (1 - FIRST_HIT) * (average - now)
    returns = np.minimum(np.where(average > now, lost, average), curve["most_returns"] or np.inf)
    x = np.log(curve["offset"] + returns)
    spread = np.exp(curve["spread_slope"] * (x - curve["spread_at"]))
    cuts = np.array([cut for _, cut in curve["cuts"]])
    mean = curve["slope"] * x + curve["shift"]
    return ndtr((mean[:, None] - cuts) / spread[:, None])


def deviance(rows, curve):
    """Minus the logarithm of the likelihood of the bands in which the rows scored."""
    above = np.column_stack([np.ones(len(rows)), shares(rows, curve), np.zeros(len(rows))])
    scores = [score for score, _ in curve["cuts"]]
    band, row = np.searchsorted(scores, rows["score"], side="right"), np.arange(len(rows))
    return -np.log(np.maximum(above[row, band] - above[row, band + 1], 1e-9)).sum()


def shipped(detector, kind):
    """The curve of the shipped table."""
    rows = json.loads((SHIPPED / f"{detector}.json").read_text())["classes"]
    return rows.get(rows[kind].get("as"), {}) | rows[kind]


def fit(rows, detector, kind):
    """The curve of one class from its own `rows`; the number of cuts, `spread_at` and
    `most_returns` were chosen by hand.
    """
    begun = shipped(detector, kind)
    scores = [score for score, _ in begun["cuts"]]
    gathers = measurement(detector).sweeps > 1

    def curve(numbers):
        slope, offset, spread_slope, fall, first, *steps = numbers
        cuts = first + np.concatenate([[0.0], np.cumsum(np.exp(steps))])
        own = {"slope": slope, "offset": np.exp(offset), "spread_slope": spread_slope}
        return begun | own | {"fall": fall, "cuts": list(zip(scores, cuts, strict=True))}

    start = [1.0, 0.0 if gathers else 3.0, 0.1, 0.0, 0.0 if gathers else 4.0]
    start += [-1.0] * (len(scores) - 1)
    falls = (0, 1 - FIRST_HIT) if gathers else (0, 0)
    bounds = [(0.1, 5), (-4, 5), (-0.5, 1), falls, (-20, 20)] + [(-8, 3)] * (len(scores) - 1)
    return curve(least(lambda n: deviance(rows, curve(n)), start, bounds))


def least(loss, start, bounds=None):
    """Where a loss is least. Raises RuntimeError if the search fails."""
    found = minimize(loss, start, bounds=bounds)
    if not found.success:
        raise RuntimeError(f"no fit: {found.message}")
    return found.x


def fits(rows, detector):
    """The curve of every class."""
    curves = {}
    for kind in KINDS:
        if not measurement(detector).recall.known[CLASSES.index(kind)]:
            continue
        own = of_class(rows, kind)
        if other := shipped(detector, kind).get("as"):
            curve = curves[other]
            (shift,) = least(lambda n: deviance(own, curve | {"shift": n[0]}), [0.0])  # noqa: B023
            curves[kind] = {"shift": shift}
        else:
            curves[kind] = fit(own, detector, kind)
    return curves


def held_out(rows, detector, kind):
    """For each half, by bin: the half, least returns, rows, percent measured, and percent predicted
    by the fit of the other half, at the `track_score`.
    """
    own, score = of_class(rows, kind), measurement(detector).track_score
    place = [each for each, _ in shipped(detector, kind)["cuts"]].index(score)
    for half in (0, 1):
        is_tested = own["scene"] % 2 == half
        tested, curve = own[is_tested], fit(own[~is_tested], detector, kind)
        predicted, measured = shares(tested, curve)[:, place], tested["score"] >= score
        for least, most in bins_of(detector):
            bin_ = (tested["returns"] >= least) & (tested["returns"] <= most)
            if bin_.any():
                percent = (100 * each[bin_].mean() for each in (measured, predicted))
                yield half, least, int(bin_.sum()), *percent


def write(detector, curves):
    """Put the numbers into the shipped table, and leave the rest of the file as it is."""
    path = SHIPPED / f"{detector}.json"
    text = path.read_text()
    for kind, curve in curves.items():
        start = text.index(f'"{kind}": {{')
        end = text.index("\n", start)
        line = text[start:end]
        for name in ("slope", "offset", "spread_slope", "fall", "shift"):
            told = f'"{name}": {curve.get(name, 0.0):.3f}'
            line = re.sub(rf'"{name}": [^,}}]+', told, line)
        cuts = json.dumps([[score, round(float(cut), 3)] for score, cut in curve.get("cuts", ())])
        line = re.sub(r'"cuts": \[\[.*?\]\]', lambda _: f'"cuts": {cuts}', line)  # noqa: B023
        text = text[:start] + line + text[end:]
    path.write_text(text)


def main():
    """Fit, print and write."""
    parser = argparse.ArgumentParser()
    parser.add_argument("data", type=Path)
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    for detector in MEASURED:
        rows = rows_of(options.data, detector)
        for kind in ("car", "pedestrian"):
            print(f"{detector}, {kind}s: half, returns from, rows, measured, predicted")
            for bin_ in held_out(rows, detector, kind):
                print("  {} {:4} {:5} {:5.1f} {:5.1f}".format(*bin_))
        curves = fits(rows, detector)
        print(json.dumps(curves, default=float))
        if options.write:
            write(detector, curves)


if __name__ == "__main__":
    main()
