"""The shipped formula against what the detectors reported in the two scenes it was fitted on."""

from dataclasses import replace

import numpy as np
import pytest

from care_sim.core.types import CLASSES
from care_sim.perception.measured import recall as formula
from care_sim.perception.measured.recall import recall
from care_sim.perception.measured.tables import measurement
from tests.helpers.nuscenes_reports import objects_of

BINS = [(0, 0), (1, 1), (2, 2), (3, 3), (4, 5), (6, 8), (9, 16), (17, 32), (33, 10**6)]


@pytest.fixture(scope="module")
def reported(recorded):
    if not (folder := recorded / "nuscenes-mini").is_dir():
        pytest.skip("no nuscenes-mini in shared/data")
    return lambda detector, kind: (rows := objects_of(folder, detector))[
        rows["label"] == CLASSES.index(kind)
    ]


def differences(detector, kind, rows, score):
    """Percentage points, predicted minus measured, in each bin of returns with over 100 rows."""
    shares = recall(detector, kind, rows["returns"], rows["previous"], score, from_nothing=True)
    for least, most in BINS:
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
    ],
)
def test_recall_by_returns_is_that_of_the_card(reported, detector, kind, most):
    rows = reported(detector, kind)
    for score in (0.1, 0.2, 0.3, 0.4, 0.5, 0.6):
        assert max(map(abs, differences(detector, kind, rows, score))) < most, score


@pytest.mark.parametrize(
    ("detector", "fitted_on", "numbers", "cuts", "most"),
    # What the fit of one scene alone says of the cars of the other; the card has these differences.
    [
        (
            *("centerpoint", 0, (0.84, 0.265, 0.09)),
            *([-1.08, -0.61, -0.22, 0.12, 0.55, 1.21, 2.39, 4.02], (5.1, 7.0)),
        ),
        (
            *("centerpoint", 1, (0.93, 0.278, 0.15)),
            *([-0.99, -0.6, -0.31, 0.08, 0.44, 1.1, 2.43, 3.9], (5.1, 7.0)),
        ),
        (
            *("megvii", 0, (0.97, 0.676, 0.11)),
            *([-0.47, 0.12, 0.66, 1.02, 1.52, 2.02, 2.53, 3.26, 4.91], (10.2, 11.8)),
        ),
        (
            *("megvii", 1, (1.42, 1.343, 0.15)),
            *([0.4, 0.85, 1.32, 1.8, 2.28, 2.95, 3.64, 4.79, 6.98], (10.2, 11.8)),
        ),
    ],
)
def test_one_scene_predicts_the_other(
    reported, monkeypatch, detector, fitted_on, numbers, cuts, most
):
    rows = reported(detector, "car")
    rows = rows[rows["scene"] != fitted_on]
    whole = measurement(detector)
    slope, offset, spread = (np.full(len(CLASSES), number) for number in numbers)
    table = whole.recall._replace(
        slope=slope, offset=offset, spread_slope=spread, cuts=np.tile(cuts, (len(CLASSES), 1))
    )
    monkeypatch.setattr(formula, "measurement", lambda _: replace(whole, recall=table))
    for score, points in zip((0.3, 0.5), most, strict=True):
        assert max(map(abs, differences(detector, "car", rows, score))) < points + 0.5


@pytest.mark.parametrize("score", [0.3, 0.5])
@pytest.mark.parametrize("detector", ["centerpoint", "megvii"])
def test_newcomers_are_predicted_by_the_curve_of_all(reported, detector, score):
    """Their disadvantage follows from the sweeps before; counting the keyframe alone misses it."""
    rows = reported(detector, "car")
    rows = rows[(rows["age"] == 0) & (rows["returns"] > 0)]
    assert len(rows) > 50
    measured = (rows["score"] >= score).mean()
    steady = recall(detector, "car", rows["returns"], score=score).mean()
    new = recall(detector, "car", rows["returns"], rows["previous"], score).mean()
    error = np.sqrt(measured * (1 - measured) / len(rows))
    assert abs(new - measured) < 2 * error < abs(steady - measured)
