"""The reward of many episodes: `care_sim.envs.reward` over columns."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Mask
from care_sim.envs.reward import BEGINNING, REWARD_WEIGHTS, earned_at, weighted
from care_sim.loops.record_columns import Records


class Courses(NamedTuple):
    """Columns (W,) of `care_sim.envs.reward.Course`."""

    in_view: Mask
    detected: Mask
    bound_m: Floats
    lost: Floats


class Rewards:
    """The rewards of `worlds` worlds. `weights` holds one of every term."""

    def __init__(self, weights: Mapping[str, float], worlds: int):
        self._weights = weights
        self._measured = bool(weights["gain"])
        self._courses = Courses(*(np.full(worlds, value) for value in BEGINNING))

    def begin(self, world: int) -> None:
        """Begin an episode in a world."""
        columns: Iterable[np.ndarray] = self._courses
        for column, value in zip(columns, BEGINNING, strict=True):
            column[world] = value

    @property
    def need_bound(self) -> Mask:
        """(W,) where the full-scan bound counts and is not known yet."""
        wanted: Mask = np.isnan(self._courses.bound_m) & self._measured
        return wanted

    def of(
        self, records: Records, detectable: Mask, over: Mask, who: Mask
    ) -> tuple[Floats, dict[str, Floats]]:
        """The rewards (W,) of the next keyframe in the worlds `who`, 0 in the others, and their
        terms; see `care_sim.envs.reward.EpisodeReward.of`.
        """
        table = np.zeros((len(REWARD_WEIGHTS), len(who)))
        _earn(who, self._courses, records, detectable, over, self._measured, table)
        earned = dict(zip(REWARD_WEIGHTS, table, strict=True))
        return weighted(self._weights, earned), earned


@compiled(brief=True)
def _earn(
    who: Mask,
    courses: Courses,
    records: Records,
    detectable: Mask,
    over: Mask,
    measured: bool,
    table: Floats,
) -> None:
    """Fill the `table` (5, W) with the terms of the worlds `who`, and lead their courses on."""
    for w in range(len(who)):
        if who[w]:
            before = courses.in_view[w], courses.detected[w], courses.bound_m[w], courses.lost[w]
            told = (
                records.in_view[w],
                records.detected[w],
                records.braking[w],
                records.distance_m[w],
                records.clearance_m[w],
                records.impact_speed_mps[w],
                detectable[w],
                over[w],
            )
            course, values = earned_at(before, told, measured)
            courses.in_view[w], courses.detected[w] = course[0], course[1]
            courses.bound_m[w], courses.lost[w] = course[2], course[3]
            for n in range(len(values)):
                table[n, w] = values[n]
