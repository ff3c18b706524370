"""The recall of the measured detectors against what they reported in the data they were fitted on.

Each half of the data is also predicted by a fit of the other half alone.
"""

import numpy as np
import pytest

from care_sim.core.types import CLASSES
from care_sim.perception.measured.recall import recall
from care_sim.perception.measured.tables import MEASURED, measurement
from tests.bench import fit_detectors
from tests.helpers.nuscenes_reports import OBJECT

KINDS = ("car", "pedestrian")


@pytest.fixture(scope="module")
def reported(recorded):
    if not ((recorded / "nuscenes-mini").is_dir() and (recorded / "kitti-tracking").is_dir()):
        pytest.skip("no nuscenes-mini and kitti-tracking in shared/data")
    return lambda detector: fit_detectors.rows_of(recorded, detector)


def differences(detector, kind, rows, score):
    """Percentage points, predicted minus measured, in each bin of returns with over 100 rows."""
    shares = recall(detector, kind, rows["returns"], rows["previous"], score, from_nothing=True)
    for least, most in fit_detectors.bins_of(detector):
        own = (rows["returns"] >= least) & (rows["returns"] <= most)
        if own.sum() > 100:
            yield 100 * (shares[own].mean() - (rows["score"][own] >= score).mean())


@pytest.mark.parametrize(
    ("detector", "kind", "most"),
    # The card: the worst bin over all scores.
    [
        ("centerpoint", "car", 9.5),
        ("centerpoint", "pedestrian", 8.6),
        ("megvii", "car", 8),
        ("megvii", "pedestrian", 8),
        ("pointrcnn", "car", 7.5),
        ("pointrcnn", "pedestrian", 9),
        ("pointrcnn", "bicycle", 7.5),
    ],
)
def test_recall_by_returns_is_that_of_the_card(reported, detector, kind, most):
    rows = fit_detectors.of_class(reported(detector), kind)
    scores = (1, 2, 3, 4) if detector == "pointrcnn" else (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
    worst = [max(map(abs, differences(detector, kind, rows, score))) for score in scores]
    assert max(worst) < most


def test_bicycles_of_few_rays_are_as_rare_as_measured(reported):
    """PointRCNN detected one of twenty; the curve of people had 13 there."""
    rows = fit_detectors.of_class(reported("pointrcnn"), "bicycle")
    rows = rows[rows["returns"] < 33]
    score = measurement("pointrcnn").track_score
    assert (len(rows), (rows["score"] >= score).sum()) == (20, 1)
    assert recall("pointrcnn", "bicycle", rows["returns"]).sum() < 5


@pytest.mark.parametrize("detector", MEASURED)
def test_the_shipped_numbers_are_those_of_the_fit(reported, detector):
    rows = reported(detector)
    for kind, curve in fit_detectors.fits(rows, detector).items():
        shipped = fit_detectors.shipped(detector, kind)
        own = fit_detectors.of_class(rows, kind)
        best = fit_detectors.deviance(own, shipped | curve)
        assert fit_detectors.deviance(own, shipped) == pytest.approx(best, abs=0.5)


@pytest.mark.parametrize(
    ("detector", "kind", "most"),
    # The card: the worst bin of over 100 rows, either half by the fit of the other half.
    [
        ("centerpoint", "car", 7),
        ("centerpoint", "pedestrian", 14),
        ("megvii", "car", 5),
        ("megvii", "pedestrian", 21),
        ("pointrcnn", "car", 14),
        ("pointrcnn", "pedestrian", 15),
    ],
)
def test_one_half_predicts_the_other(reported, detector, kind, most):
    bins = list(fit_detectors.held_out(reported(detector), detector, kind))
    worst = [abs(seen - told) for _, _, count, seen, told in bins if count > 100]
    assert len(worst) >= 3
    assert max(worst) < most


@pytest.mark.parametrize("score", [0.3, 0.5])
@pytest.mark.parametrize("detector", ["centerpoint", "megvii"])
def test_newcomers_are_predicted_by_the_curve_of_all(reported, detector, score):
    """Their disadvantage follows from the sweeps before; counting the keyframe alone misses it."""
    rows = fit_detectors.of_class(reported(detector), "car")
    rows = rows[(rows["age"] == 0) & (rows["returns"] > 0)]
    assert len(rows) > 50
    measured = (rows["score"] >= score).mean()
    steady = recall(detector, "car", rows["returns"], score=score).mean()
    new = recall(detector, "car", rows["returns"], rows["previous"], score).mean()
    error = np.sqrt(measured * (1 - measured) / len(rows))
    assert abs(new - measured) < 2 * error < abs(steady - measured)


@pytest.mark.parametrize("detector", MEASURED)
def test_the_script_has_the_formula_of_the_package(detector):
    now, before = np.array([0, 1, 3, 9, 30]), np.array([2, 0, 5, 9, 1])
    rows = np.zeros(5, OBJECT)
    rows["returns"], rows["previous"] = now, before
    score = measurement(detector).track_score
    for kind in fit_detectors.KINDS:
        if measurement(detector).recall.known[CLASSES.index(kind)]:
            curve = fit_detectors.shipped(detector, kind)
            place = [own for own, _ in curve["cuts"]].index(score)
            expected = recall(detector, kind, now, before, from_nothing=True)
            if detector == "pointrcnn":
                rows["previous"] = now
            assert fit_detectors.shares(rows, curve)[:, place] == pytest.approx(expected)
