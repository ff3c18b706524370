"""The fitted numbers of the measured detectors, read from `shipped/NAME.json`."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from care_sim.base.checks import check_known
from care_sim.core.arrays import Floats, Mask
from care_sim.core.types import CLASSES

SHIPPED = Path(__file__).parent / "shipped"
MEASURED = ("centerpoint", "megvii", "pointrcnn")
"""The names of the detectors that were measured."""
LOGISTIC = "logistic"
"""A `score_scale`: raw scores r are reported as 1 / (1 + exp(-r)), since scores are 0 to 1."""
SIDES = ("length", "width", "height")
CENTRE = ("radial", "tangential")
ERRORS = (*CENTRE, *SIDES, "yaw")
"""The channels of a box error, in the order of all tables."""
SIGNALS = ("luck", "turned", *ERRORS)
"""Lasting numbers of an object: its luck, whether its box is reversed, errors of its box."""
WIDEST_NORMAL = 4.0
_STEPS = 161
NORMALS = np.linspace(-WIDEST_NORMAL, WIDEST_NORMAL, _STEPS)
"""Standard normals at which the quantiles of errors are tabulated."""


class Recall(NamedTuple):
    """The recall formula of all classes, for compiled code. Every array has a row or a number per
    class. See `care_sim.perception.measured.recall`.
    """

    known: Mask
    """Classes that the detector reports at all."""
    worth: Floats
    """Returns of the detector's own sensor per return of our full scan."""
    slope: Floats
    offset: Floats
    spread_slope: Floats
    spread_at: Floats
    fall: Floats
    """Weight of a return that was there a keyframe ago and is not now."""
    most: Floats
    """Largest number of effective returns."""
    shift: Floats
    cuts: Floats
    """(classes, k) the latent score at each of `scores`, infinite where the class has none."""
    scores: Floats
    """(k,) ascending."""


class Luck(NamedTuple):
    """Persistence of `SIGNALS`, all (classes, 8): the shares that stay and that decay, and the time
    of the decay in seconds.
    """

    stays: Floats
    decays: Floats
    decay_s: Floats


class Errors(NamedTuple):
    """Errors of boxes. (classes, 6, n) quantiles at `NORMALS`: centre in metres for one return,
    logarithms of sizes, radians. (classes, 2) the power of returns by which errors of the centre
    shrink. (classes,) the normal below which a box is reversed.
    """

    quantiles: Floats
    powers: Floats
    turned_below: Floats

    def without(self) -> "Errors":
        """Return a table without errors."""
        nobody = np.full_like(self.turned_below, -np.inf)
        return self._replace(quantiles=np.zeros_like(self.quantiles), turned_below=nobody)


class FalseBoxes(NamedTuple):
    """False boxes of one class. `rates` (k, 2) are scores and the boxes per keyframe within 50 m
    from that score on. Then shares by ten metres of distance, the share of lasting ones and their
    time in seconds, and (3, 2) mean and spread of the logarithms of length, width, height.
    """

    label: int
    rates: Floats
    distances: Floats
    lasting: float
    lasts_s: float
    log_sizes: Floats


@dataclass(frozen=True)
class Measurement:
    """All measured numbers of a detector. Scores are the detector's own, before `score_scale`."""

    sweeps: int
    """Sweeps that it gathers."""
    step_s: float
    """Seconds between the keyframes at which it was measured."""
    score_scale: str
    least_score: float
    """Lowest measured score; lower ones are not reported."""
    most_score: float
    track_score: float
    flash_s: float
    """Assumed time of luck, errors and false boxes that are new at every measured keyframe."""
    view_deg: float
    """The horizontal field of view in which false boxes were counted."""
    kept_ahead: float
    """Share of evenly spread false boxes that were found on the road ahead
    (`care_sim.perception.measured.false_boxes`)."""
    recall: Recall
    luck: Luck
    errors: Errors
    false_boxes: tuple[FalseBoxes, ...]

    def reported(self, scores: Floats) -> Floats:
        """(n,) scores from 0 to 1, as detections carry them."""
        return 1.0 / (1.0 + np.exp(-scores)) if self.score_scale == LOGISTIC else scores


@cache
def measurement(name: str) -> Measurement:
    """Read the measurement of a detector. Raises InvalidInput for another name."""
    check_known("measured detector", name, MEASURED)
    table = json.loads((SHIPPED / f"{name}.json").read_text())
    classes, errors = (_lent(table[part]) for part in ("classes", "errors"))
    plain = {key: value for key, value in table.items() if not isinstance(value, dict)}
    return Measurement(
        **plain,
        recall=_recall(classes),
        luck=_luck(classes, errors),
        errors=_errors(errors),
        false_boxes=tuple(_false(*item) for item in table["false_boxes"].items()),
    )


def _lent(table: dict[str, Any]) -> dict[str, Any]:
    """Return the rows by class; a class with `as` takes missing numbers from that class."""
    return {name: table.get(row.get("as"), {}) | row for name, row in table.items()}


def _by_class(rows: dict[str, Any], key: str, missing: float = 0.0) -> Floats:
    values = [rows[name].get(key) if name in rows else missing for name in CLASSES]
    return np.array([missing if value is None else value for value in values], float)


def _recall(rows: dict[str, Any]) -> Recall:
    scores = sorted({score for row in rows.values() for score, _ in row["cuts"]})
    cuts = np.full((len(CLASSES), len(scores)), np.inf)
    for name, row in rows.items():
        for score, cut in row["cuts"]:
            cuts[CLASSES.index(name), scores.index(score)] = cut
    return Recall(
        known=np.array([name in rows for name in CLASSES]),
        worth=_by_class(rows, "returns_per_ours"),
        slope=_by_class(rows, "slope"),
        offset=_by_class(rows, "offset", 1.0),
        spread_slope=_by_class(rows, "spread_slope"),
        spread_at=_by_class(rows, "spread_at"),
        fall=_by_class(rows, "fall"),
        most=_by_class(rows, "most_returns", np.inf),
        shift=_by_class(rows, "shift"),
        cuts=cuts,
        scores=np.array(scores, float),
    )


def _luck(rows: dict[str, Any], errors: dict[str, Any]) -> Luck:
    # A reversed box lasts as its yaw does.
    parts = [rows] + [
        {name: row[error] for name, row in errors.items()} for error in ("yaw", *ERRORS)
    ]
    return Luck(
        *(
            np.column_stack([_by_class(part, key, missing) for part in parts])
            for key, missing in (("stays", 0.0), ("decays", 0.0), ("decay_s", 1.0))
        )
    )


def _errors(rows: dict[str, Any]) -> Errors:
    from scipy.special import ndtr, ndtri, stdtrit

    levels = ndtr(NORMALS)
    quantiles = np.zeros((len(CLASSES), len(ERRORS), _STEPS))
    powers = np.zeros((len(CLASSES), len(CENTRE)))
    turned = np.full(len(CLASSES), -np.inf)
    for name, row in rows.items():
        number = CLASSES.index(name)
        for place, error in enumerate(ERRORS):
            own = row[error]
            shape = stdtrit(own["df"], levels)
            if error in CENTRE:
                # The median size of an error is the 75% quantile of a symmetric distribution.
                scale = own["median_at_1"] / stdtrit(own["df"], 0.75)
                powers[number, place] = own["power"]
            else:
                scale = own["scale"] if error in SIDES else np.deg2rad(own["scale_deg"])
            quantiles[number, place] = own.get("loc", 0.0) + scale * shape
        turned[number] = ndtri(row["yaw"]["turned"])
    return Errors(quantiles, powers, turned)


def _false(name: str, row: dict[str, Any]) -> FalseBoxes:
    return FalseBoxes(
        CLASSES.index(name),
        np.array(row["rates"], float),
        np.array(row["distances"], float) / sum(row["distances"]),
        row["lasting"],
        row["lasts_s"],
        np.array(row["log_sizes"], float),
    )
