"""Bounds of B90: policies that are handed the truth. No car can have them, and no entry can be one.

`Bodies` knows every body, `ShownBodies` those alone that a camera box shows or a track holds. Both
spend their cells by marginal gain: the next cell goes to the object whose chance of being detected
it raises most, by the measured recall of `MAIN_DETECTOR`. So the first says how few cells could be
enough, and the second how much of it a perfect user of boxes and tracks could have.

Greedy gains are no proof of an optimum: luck that lasts and the coming keyframes are not foreseen.
"""

from typing import cast

import numpy as np

from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.belief import Belief
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES, Demand
from care_sim.evaluation.chances import measured_rule
from care_sim.evaluation.counts import PEOPLE
from care_sim.evaluation.sightings import RANGE_M
from care_sim.loops.film import Shot
from care_sim.loops.open_loop import OpenLoop
from care_sim.loops.truth import Truth
from care_sim.perception.measured.recall import FIRST_HIT
from care_sim.policies.base import PrivilegedPolicy
from care_sim.study.benchmark.budgets import MAIN_DETECTOR
from care_sim.study.benchmark.suite import BOUNDS_MODULE, Entry

BOUNDS = (
    Entry(f"{BOUNDS_MODULE}Bodies", label="bound: all bodies"),
    Entry(f"{BOUNDS_MODULE}ShownBodies", label="bound: boxes and tracks"),
)
"""They stand beside the published entries, without a rank."""
NEWCOMER_WEIGHT, PERSON_WEIGHT = 100.0, 4.0
"""Worth of a newcomer and of a person among objects of worth 1. A per cent of each weighs about
alike at the full scan's counts on streets: 60,000 objects kept, 18,000 people kept, 360 and 650
newcomers."""
_IS_PERSON = np.isin(CLASSES, PEOPLE)


class Bodies(PrivilegedPolicy):
    """Fires at all bodies within the range of scoring, by marginal gain."""

    name = "bound-bodies"
    source = "own: a bound that knows every body"
    is_pattern = True

    def __init__(self, rig: Rig, truth: Truth):
        super().__init__(rig, truth)
        self._chance = measured_rule(MAIN_DETECTOR, {})
        self.reset()

    def reset(self) -> None:
        """Forget who has been there."""
        self._met: set[int] = set()

    @property
    def _loop(self) -> OpenLoop:
        return cast(OpenLoop, self.truth.loop)

    def remember(self, belief: Belief) -> None:
        """Note who was within range before the coming keyframe."""
        past = self._loop.film.shots[: self._loop.index]
        if past:
            self._met.update(past[-1].annotations.objects[_within_range(past[-1])].tolist())

    def known(self, belief: Belief) -> Mask:
        """(n,) which annotated objects of the coming keyframe are fired at."""
        return np.ones(len(self._loop.shot.annotations), bool)

    def demand(self, belief: Belief) -> Demand:
        """The cells that return from known objects, the largest gain first."""
        shot = self._loop.shot
        seen = shot.annotations
        cells, gains = [np.empty(0, np.int64)], [np.empty(0)]
        for row in np.flatnonzero(self.known(belief) & self._counts()):
            number, label = int(seen.objects[row]), int(seen.classes[row])
            own = _cells_of(shot, number)
            cells.append(own)
            gains.append(self._worth(number, label) * self._gains(belief, number, label, len(own)))
        order = np.argsort(-np.concatenate(gains), kind="stable")
        return Demand(layers=[[np.concatenate(cells)[order]]])

    def _counts(self) -> Mask:
        """(n,) which annotated objects are within range, now or at the next keyframe: a detector
        that gathers sweeps is the surer of what enters the range.
        """
        loop = self._loop
        following = loop.film.shots[loop.index + 1 : loop.index + 2]
        entering = [shot.annotations.objects[_within_range(shot)] for shot in following]
        soon = np.isin(loop.shot.annotations.objects, np.concatenate([[], *entering]))
        return _within_range(loop.shot) | soon

    def _worth(self, number: int, label: int) -> float:
        is_newcomer = self._loop.index > 0 and number not in self._met
        return (NEWCOMER_WEIGHT if is_newcomer else 1.0) * (
            PERSON_WEIGHT if _IS_PERSON[label] else 1.0
        )

    def _gains(self, belief: Belief, number: int, label: int, most: int) -> Floats:
        """(most,) the gain of each further return on an object."""
        returns = np.arange(most + 1.0)
        average = FIRST_HIT * returns + (1 - FIRST_HIT) * self._returns_before(belief, number)
        return marginal_gains(self._chance(CLASSES[label], returns, average))

    def _returns_before(self, belief: Belief, number: int) -> int:
        """The returns on an object at the last keyframe."""
        if not self._loop.index:
            return 0
        before = _cells_of(self._loop.film.shots[self._loop.index - 1], number)
        return int(np.count_nonzero(belief.ranges.ravel()[before]))


class ShownBodies(Bodies):
    """As `Bodies`, for those objects alone that a camera box shows or a track holds."""

    name = "bound-shown"
    source = "own: a bound that knows the bodies of boxes and tracks"

    def known(self, belief: Belief) -> Mask:
        """See `Bodies`."""
        held = self._loop.true_objects(belief.tracks)
        told = np.concatenate([held, self._loop.true_detected_objects()])
        return np.isin(self._loop.shot.annotations.objects, told)


def marginal_gains(chances: Floats) -> Floats:
    """Return what each further return (n,) adds to `chances` (n + 1,) of 0, 1, 2 and more returns.
    No return adds more than the one before it. If a detector needs three returns, each adds a third
    of what the three add together.
    """
    from scipy.optimize import isotonic_regression

    # The least concave majorant has these slopes, and to take the largest first is best for it.
    gains: Floats = isotonic_regression(np.diff(chances), increasing=False).x
    return gains


def _within_range(shot: Shot) -> Mask:
    within: Mask = planar_ranges(shot.annotations.boxes) <= RANGE_M
    return within


def _cells_of(shot: Shot, number: int) -> Integers:
    """The cells that return from an object."""
    cloud = shot.cloud.to_shots()
    return np.unique(cloud.cells[cloud.objects == number])
