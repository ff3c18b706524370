"""Arguments, seeds and infos of a vector environment. Some arguments may differ per world."""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from care_sim.base.checks import as_array, check_seed
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Mask
from care_sim.core.conditions import CAMERA_FAULTS, DEFAULTS
from care_sim.envs.closed_loop import ClosedLoopEnv

OF_EACH_WORLD = ("budget", *CAMERA_FAULTS, "camera_confidence")
"""Arguments that may be a list, of a value for each world: what an allocator has to cope with."""

Maker = partial[ClosedLoopEnv]


def makers_of(kind: type[ClosedLoopEnv], arguments: Mapping[str, Any], worlds: int) -> list[Maker]:
    """Return a maker of each world's single environment, from the `arguments` of their vector.
    Raises InvalidInput for a list of another length, and for one of what all worlds share.
    """
    for name, default in DEFAULTS.items():
        lists_itself = name in OF_EACH_WORLD or isinstance(default, tuple)
        if not lists_itself and _is_list(arguments.get(name)):
            raise InvalidInput(
                f"{name} takes one value for all worlds, got {shown(arguments[name])}; budget "
                "and the camera's faults alone may be a list, one for each"
            )
    given = {name: arguments[name] for name in OF_EACH_WORLD if name in arguments}
    lists = {name: [*value] for name, value in given.items() if _is_list(value)}
    for name, values in lists.items():
        if len(values) != worlds:
            raise InvalidInput(
                f"{name} must be one value, or a list of one for each of {worlds} worlds, got "
                f"{shown(given[name])}"
            )
    return [
        partial(kind, **{**arguments, **{name: values[world] for name, values in lists.items()}})
        for world in range(worlds)
    ]


def models_of(makers: Sequence[Maker]) -> list[ClosedLoopEnv]:
    """The environments, which nobody resets, that show what is fixed about each world: one for all
    whose arguments are alike, unless their detector may remember something.
    """
    made: dict[tuple[str, ...], ClosedLoopEnv] = {}
    models = []
    for make in makers:
        # As they are written: True equals 1, and yet is refused where 1 is taken.
        own = tuple(repr(make.keywords.get(name)) for name in OF_EACH_WORLD)
        if own not in made or made[own].setting.detector is not None:
            made[own] = make()
        models.append(made[own])
    return models


def autoreset_of(mode: AutoresetMode | str) -> AutoresetMode:
    """Return a mode that may be given by its name. Raises InvalidInput for another name."""
    if isinstance(mode, AutoresetMode):
        return mode
    allowed = [one.value for one in AutoresetMode]
    if mode not in allowed:
        raise InvalidInput(f"autoreset_mode must be one of {', '.join(allowed)}, got {shown(mode)}")
    return AutoresetMode(mode)


def _is_list(value: object) -> bool:
    return isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.ndim == 1)


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


def kept(columns: dict[str, Any], who: Mask) -> dict[str, Any]:
    """Return infos in the form of Gymnasium, from `columns` (W, ...) or dictionaries of them. Rows
    of the worlds `who` (W,) stay; other rows are 0 or None. Beside every name is a mask of these
    worlds, under the name with a leading underscore.
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
