"""The fitted numbers of `measured.json` as arrays for compiled code."""

import json
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.types import CLASSES

FOCAL_PX = 721.5
"""Focal length of KITTI's pictures: all lengths are in pixels of it."""
CAR, PERSON, CYCLIST = range(3)
"""The kinds of objects that were measured, in the order of `measured.json`."""
KIND_OF = {"car": CAR, "truck": CAR, "bus": CAR, "bicycle": CYCLIST, "pedestrian": PERSON}
"""The measured kind that stands for each class. The real detector knew no trucks and buses. Here
they are found as a car of the same height in pixels is, and reported as what they are.
"""
CLASS_OF = tuple(CLASSES.index(name) for name in ("car", "pedestrian", "bicycle"))
"""The class that each kind is reported as."""

FEATURES = (
    *("one", "height1", "height2", "height3", "height4", "height5", "height6"),
    *("occ1", "occ2", "occ3", "trunc", "trunc^2", "occ1*log(h/40)", "occ2*log(h/40)"),
    *("shape", "shape^2", "occ1*shape", "occ2*shape", "metres", "metres^2", "cover", "cover^2"),
)
"""Inputs of recall, in the order of `Numbers.recall` (`care_sim.sensors.kitti.recall`)."""

FARTHEST = 6.0
"""Normal scores beyond this, one in 500 million, count as this."""
_STEPS = 240


class Numbers(NamedTuple):
    """All fitted numbers. The first axis is the kind, unless another is named."""

    knots: Floats
    """(3, 7) logarithms of the heights between which recall is interpolated, inf beyond them."""
    thresholds: Floats
    """(10,) logits of scores; the last one ends the extrapolation."""
    recall: Floats
    """(3, 9, 22) coefficients of FEATURES at all thresholds but the last."""
    least_score: float
    """Boxes that are less sure are not reported."""
    edge_means: Floats
    """(3, 4) mean errors of left, top, right and bottom, relative to the size."""
    edge_spreads: Floats
    """(3, 4, 6) their logarithmic spreads: coefficients of
    `care_sim.sensors.kitti.errors._spread`.
    """
    edge_roots: Floats
    """(3, 4, 4) lower Cholesky factors of the correlations between edges."""
    cut_errors: Floats
    """(4, 2) means and spreads of the edges that the picture cuts, in pixels."""
    tails: Floats
    """(4, 4, n) errors in units of their spread at n normal scores from -FARTHEST to FARTHEST:
    rows are the kinds and, last, cut edges.
    """
    pairs: Integers
    """(5, 2) the kind of an object and that of the false box beside it."""
    pair_rates: Floats
    """(5, 8) logarithmic numbers of false boxes per object: coefficients of
    `care_sim.sensors.kitti.beside._rate`.
    """
    pair_mixtures: Floats
    """(5, 10, 13) components: weight, six means, six spreads; weight 0 pads."""
    pair_scores: Floats
    """(5, 7) logits of scores at the shares `score_shares`."""
    scene_counts: Floats
    """(3, 3) chances that another false box of the background follows 0, 1, 2 of them."""
    scene_mixtures: Floats
    """(3, 2, 6, 11) components of whole and of cut boxes: weight, five means, five spreads."""
    scene_cuts: Floats
    """(3,) shares of boxes that the picture cuts."""
    scene_scores: Floats
    """(3, 7) as `pair_scores`."""
    usual_lows: Floats
    """(3,) means of `care_sim.sensors.kitti.invented.low_of` on KITTI's pictures."""
    score_shares: Floats
    """(7,)."""
    score_share: float
    """Share of the variance of a false box's normal score that stays as long as the box does."""
    edges_share: float
    """Share of the variance of its errors that stays as long."""
    suppression_iou: float
    """Overlap above which only one of two boxes of a class is reported."""


class Times(NamedTuple):
    """How long errors last, in seconds. A normal luck has the correlation
    `luck_share` exp(-t / `luck_s`), the errors of edges
    `edges_lasting` + `edges_share` exp(-t / `edges_s`). A false box stays with the chance
    exp(-t / `false_s`).
    """

    luck_share: float
    luck_s: float
    edges_lasting: float
    edges_share: float
    edges_s: float
    false_s: float


class Measured(NamedTuple):
    """The content of `measured.json`."""

    numbers: Numbers
    times: Times


@cache
def measured() -> Measured:
    """Read the fitted numbers that are shipped."""
    return read_measured(json.loads(Path(__file__).with_name("measured.json").read_text()))


def read_measured(told: dict[str, Any]) -> Measured:
    """The arrays of a file of the form of `measured.json`."""
    luck, edges = told["luck"], told["jitter_time"]
    times = Times(
        luck["a"], luck["T_s"], edges["c"], edges["a"], edges["T_s"], told["false_time"]["T_s"]
    )
    beside, scene = told["beside"], told["background"]
    kinds = told["classes"]
    numbers = Numbers(
        knots=np.array([_padded(np.log(one["knots"]), 7, np.inf) for one in told["recall"]]),
        thresholds=_logit(np.array([*told["thresholds"], 0.99997])),
        recall=np.stack([_coefficients(one) for one in told["recall"]]),
        least_score=told["least_score"],
        edge_means=np.array([[edge["mean"] for edge in one["edges"]] for one in told["jitter"]]),
        edge_spreads=np.array(
            [[edge["log_spread"] for edge in one["edges"]] for one in told["jitter"]]
        ),
        edge_roots=np.stack([np.linalg.cholesky(one["correlation"]) for one in told["jitter"]]),
        cut_errors=np.array(told["cut_px"])[:, :2],
        tails=_tails(told),
        pairs=np.array([[kinds.index(one["label"]), kinds.index(one["box"])] for one in beside]),
        pair_rates=np.array([one["rate"] for one in beside]),
        pair_mixtures=np.stack([_mixture(one["mixture"], 10) for one in beside]),
        pair_scores=np.array([one["scores"] for one in beside]),
        scene_counts=np.stack([_further(one["per_picture"], one["variance"]) for one in scene]),
        scene_mixtures=np.stack(
            [[_mixture(one["mixture"], 6), _mixture(one["cut_mixture"], 6)] for one in scene]
        ),
        scene_cuts=np.array([one["cut_share"] for one in scene]),
        scene_scores=np.array([one["scores"] for one in scene]),
        usual_lows=np.array([one["usual_low"] for one in scene]),
        score_shares=np.array(told["score_shares"], float),
        score_share=told["false_time"]["score_share"],
        edges_share=told["false_time"]["edges_share"],
        suppression_iou=told["suppression_iou"],
    )
    return Measured(numbers, times)


def _coefficients(fitted: dict[str, Any]) -> Floats:
    """(9, 22) of one kind, 0 for the FEATURES that it does not have."""
    rows = np.zeros((len(fitted["coefficients"]), len(FEATURES)))
    rows[:, [FEATURES.index(name) for name in fitted["features"]]] = fitted["coefficients"]
    return rows


def _tails(told: dict[str, Any]) -> Floats:
    from scipy.special import ndtr, stdtrit

    freedom = [[edge["df"] for edge in one["edges"]] for one in told["jitter"]]
    freedom.append([edge[2] for edge in told["cut_px"]])
    scores = np.linspace(-FARTHEST, FARTHEST, _STEPS + 1)
    tails: Floats = stdtrit(np.array(freedom)[..., None], ndtr(scores))
    return tails


def _mixture(fitted: dict[str, Any], most: int) -> Floats:
    """(most, 1 + 2 d) weights, means and spreads of normals with independent columns."""
    weights = np.array(fitted["weights"])
    spreads = np.sqrt(fitted["covariances"])
    rows = np.column_stack([weights / weights.sum(), fitted["means"], spreads])
    # Padding has the weight 0, and a spread by which a density can be divided.
    padded = np.ones((most, rows.shape[1]))
    padded[:, 0] = 0.0
    padded[: len(rows)] = rows
    return padded


def _further(mean: float, variance: float, most: int = 3) -> Floats:
    """(most,) the chances that a count is more than 0, 1, ... if it is at least that, of the
    negative binomial distribution with this mean and variance.
    """
    from scipy.stats import nbinom

    success = mean / variance
    at_least = nbinom.sf(np.arange(most + 1) - 1, mean * success / (1 - success), success)
    further: Floats = at_least[1:] / at_least[:-1]
    return further


def _padded(values: Floats, length: int, with_: float) -> Floats:
    return np.concatenate([values, np.full(length - len(values), with_)])


def _logit(shares: Floats) -> Floats:
    logits: Floats = np.log(shares / (1 - shares))
    return logits
