"""What a step of many worlds brings beside observations: resets, rewards and infos."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.base.checks import as_array, check_seed
from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats, Mask
from care_sim.envs.reward import BEGINNING, REWARD_WEIGHTS, earned_at, weighted
from care_sim.loops.records import Records


def seeds_of(seed: int | Sequence[int | None] | None, worlds: int) -> list[int | None]:
    """The seeds of so many worlds, of which the i-th is `seed + i` for a whole number. Raises
    InvalidInput for a list of another length, and for what is no seed.
    """
    if seed is None:
        return [None] * worlds
    if isinstance(seed, Iterable):
        # An array without an axis calls itself Iterable, too.
        if not getattr(seed, "ndim", 1):
            check_seed(seed)
        seeds = [*seed]
    else:
        check_seed(seed)
        seeds = [int(seed) + world for world in range(worlds)]
    if len(seeds) != worlds:
        raise InvalidInput(f"seed must be one for each of {worlds}, got {len(seeds)}")
    for one in seeds:
        if one is not None:
            check_seed(one)
    return seeds


def worlds_to_reset(options: dict[str, Any] | None, worlds: int) -> Mask:
    """(worlds,) those of the `reset_mask`, all without one. Raises InvalidInput for other options,
    and for a mask that is none or empty.
    """
    everybody = np.ones(worlds, np.bool_)
    if not options:
        return everybody
    if [*options] != ["reset_mask"]:
        raise InvalidInput(f"reset takes no options but reset_mask, got {shown(options)}")
    mask = as_array("reset_mask", options["reset_mask"])
    if mask.dtype != np.bool_ or mask.shape != everybody.shape or not mask.any():
        raise InvalidInput(f"reset_mask must be {worlds} flags, at least one of them True")
    return mask


Infos = dict[str, Any]


def last_rows(observation: Any, over: Mask) -> NDArray[np.object_]:
    """(W,) copies of the observations of the worlds that are `over`, None of the others."""
    rows = np.full(len(over), None, object)
    for world in np.flatnonzero(over).tolist():
        rows[world] = (
            {name: values[world].copy() for name, values in observation.items()}
            if isinstance(observation, Mapping)
            else observation[world].copy()
        )
    return rows


def same_step(infos: Infos, begun: Infos, last: NDArray[np.object_], over: Mask) -> Infos:
    """What a step tells whose `infos` are of all worlds, if in those that are `over`, with the
    `last` observations (W,), episodes begin that tell `begun`.
    """
    finals = {
        "final_obs": last,
        "_final_obs": over.copy(),
        "final_info": _part(infos, over),
        "_final_info": over.copy(),
    }
    return _joined(_part(infos, ~over), begun) | finals


def _part(infos: Infos, who: Mask) -> Infos:
    """What infos tell of the worlds `who` (W,), in the form of Gymnasium."""
    part = Infos()
    for name, column in _columns(infos):
        told = infos[f"_{name}"] & who
        if told.any():
            part[name] = _part(column, who) if isinstance(column, dict) else column.copy()
            part[f"_{name}"] = told
            if not isinstance(column, dict):
                part[name][~told] = None if column.dtype == object else 0
    return part


def _joined(infos: Infos, others: Infos) -> Infos:
    """What both tell, the `others` of other worlds."""
    joined = infos | {name: value for name, value in others.items() if name not in infos}
    for name, column in _columns(others):
        if name not in infos:
            continue
        told = others[f"_{name}"]
        if isinstance(column, dict):
            joined[name] = _joined(infos[name], column)
        else:
            joined[name] = infos[name].copy()
            joined[name][told] = column[told]
        joined[f"_{name}"] = infos[f"_{name}"] | told
    return joined


def _columns(infos: Infos) -> list[tuple[str, Any]]:
    return [(name, column) for name, column in infos.items() if f"_{name}" in infos]


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


def joined(parts: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The columns of the shares of worlds, one after the other, in arrays of their own."""
    return {
        name: joined([part[name] for part in parts])
        if isinstance(column, dict)
        else np.concatenate([part[name] for part in parts])
        for name, column in parts[0].items()
    }


def kept(columns: dict[str, Any], who: Mask) -> dict[str, Any]:
    """Infos in the form of Gymnasium: of `columns` (W, ...), or dictionaries of them, the rows of
    the worlds `who` (W,), 0 or None of the others; and beside every name, with a line before it, of
    whom it tells.
    """
    infos = dict[str, Any]()
    for name, column in columns.items():
        infos[name] = kept(column, who) if isinstance(column, dict) else _rows(column, who)
        infos[f"_{name}"] = who.copy()
    return infos


def _rows(column: np.ndarray, who: Mask) -> np.ndarray:
    if who.all():
        return column
    rows = column.copy()
    rows[~who] = None if rows.dtype == object else 0
    return rows
