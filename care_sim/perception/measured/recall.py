"""The recall of the measured detectors as a formula of returns.

Let n be the returns of the keyframe's own sweep, and m the average per gathered sweep. An object
has the effective returns

    e = m where it gains returns (m <= n), else n + fall / 0.45 * (m - n), at most `most`.

Where only keyframes are known, with p returns a keyframe (0.5 s) ago, m = 0.55 n + 0.45 p: the
average of ten equal sweeps. So a newcomer, with p = 0, has 0.55 n. Its latent score is

    y = slope * x + shift + exp(spread_slope * (x - spread_at)) * luck,    x = log(offset + e),

and it is reported with a score of s or more where y is above the cut of s; luck is a standard
normal. The numbers are those of `care_sim.perception.measured.tables`.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from care_sim.base.checks import check_known, check_number
from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats
from care_sim.core.types import CLASSES
from care_sim.perception.measured.tables import Recall, measurement

FIRST_HIT = 0.55
"""Weight of a return of this keyframe that was not there a keyframe ago. Ten equal sweeps, the
newest at the keyframe, have on average 0.55 of it. The data give 0.35 to 0.55.
"""


class Latent(NamedTuple):
    """The latent score of one object without luck, and the spread of its luck."""

    mean: float
    spread: float


@compiled()
def effective_returns(now: float, average: float, fall: float, most: float) -> float:
    """Effective returns of an object with `now` returns in this sweep and `average` per sweep."""
    returns = average
    if average > now:
        returns = now + fall / (1.0 - FIRST_HIT) * (average - now)
    return min(returns, most)


@compiled()
def latent_score(returns: float, label: int, table: Recall) -> Latent:
    """The latent score of an object of the class `label` with effective `returns`."""
    x = math.log(table.offset[label] + returns)
    mean = table.slope[label] * x + table.shift[label]
    return Latent(mean, math.exp(table.spread_slope[label] * (x - table.spread_at[label])))


@compiled()
def score_of(latent: float, label: int, table: Recall, most: float) -> float:
    """Return the score of a latent score with its luck, interpolated between the cuts of the class;
    -inf below all.
    """
    cuts, scores = table.cuts[label], table.scores
    if not latent > cuts[0]:
        return -math.inf
    place = 0
    while place + 2 < len(cuts) and cuts[place + 1] < latent and cuts[place + 2] < math.inf:
        place += 1
    # Beyond the last cut scores go on as between the last two.
    share = (latent - cuts[place]) / (cuts[place + 1] - cuts[place])
    score: float = scores[place] + share * (scores[place + 1] - scores[place])
    return min(score, most)


@compiled()
def _latent_scores(
    now: Floats, average: Floats, label: int, table: Recall
) -> tuple[Floats, Floats]:
    means, spreads = np.empty(len(now)), np.empty(len(now))
    for row in range(len(now)):
        returns = effective_returns(now[row], average[row], table.fall[label], table.most[label])
        means[row], spreads[row] = latent_score(returns, label, table)
    return means, spreads


def recall(
    detector: str,
    name: str,
    returns: ArrayLike,
    previous: ArrayLike | None = None,
    score: float | None = None,
    *,
    first_hit: float = FIRST_HIT,
    from_nothing: bool = False,
) -> Floats:
    """Return the share of objects that a measured `detector` reports with a `score` or more.

    `name` is the class. `returns` (n,) are the returns on each object in the keyframe's sweep of
    the detector's own sensor. `previous` (n,) are those a keyframe (0.5 s) ago, 0 for a newcomer;
    by default the returns are steady. For `pointrcnn` returns are rays of an HDL-64 that stop at
    the object's body, and `previous` is ignored. `score` is in the detector's own scale; the
    default is its `track_score`.

    An object without a return in either keyframe is not reported. With `from_nothing` it has the
    fitted share, which also covers returns of sweeps between keyframes.

    Raises InvalidInput for another detector or class, and for a score that is not in the table.
    """
    measured = measurement(detector)
    table = measured.recall
    check_known(f"class of detector {detector}", name, np.array(CLASSES)[table.known].tolist())
    check_number("first_hit", first_hit, 0, 1)
    label = CLASSES.index(name)
    now = np.atleast_1d(np.asarray(returns, float))
    earlier = now if previous is None or measured.sweeps == 1 else np.asarray(previous, float)
    now, earlier = (np.ascontiguousarray(each) for each in np.broadcast_arrays(now, earlier))
    if not (np.isfinite(now) & np.isfinite(earlier) & (now >= 0) & (earlier >= 0)).all():
        raise InvalidInput("returns and previous must be numbers of 0 or more")
    average = first_hit * now + (1 - first_hit) * earlier
    means, spreads = _latent_scores(now, average, label, table)
    shares = _above((means - cut_of(detector, name, score)) / spreads)
    return shares if from_nothing else np.where(now + earlier > 0, shares, 0.0)


def cut_of(detector: str, name: str, score: float | None = None) -> float:
    """Return the latent score above which an object of a class has at least `score`, by default the
    detector's `track_score`. Raises InvalidInput for a score that is not in its table.
    """
    measured = measurement(detector)
    cuts = measured.recall.cuts[CLASSES.index(name)]
    known = np.isfinite(cuts)
    scores = measured.recall.scores[known]
    wanted = measured.track_score if score is None else score
    check_number(f"score of {name}s of {detector}", wanted, float(scores[0]), float(scores[-1]))
    return float(np.interp(wanted, scores, cuts[known]))


def _above(margins: Floats) -> Floats:
    from scipy.special import ndtr

    return np.asarray(ndtr(margins))
