"""The arguments of a vector environment; every world may have its own of some of them."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from care_sim.base.errors import InvalidInput, shown
from care_sim.core.conditions import CAMERA_FAULTS, DEFAULTS
from care_sim.envs.closed_loop import ClosedLoopEnv

OF_EACH_WORLD = ("budget", *CAMERA_FAULTS, "camera_confidence")
"""Arguments that may be a list, of a value for each world: what an allocator has to cope with."""

Maker = partial[ClosedLoopEnv]


def makers_of(kind: type[ClosedLoopEnv], arguments: Mapping[str, Any], worlds: int) -> list[Maker]:
    """What makes the single environment of each of so many worlds, from the `arguments` of their
    vector environment. Raises InvalidInput for a list of another length, and for one of what all
    worlds share.
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
    whose arguments are alike.
    """
    made: dict[tuple[str, ...], ClosedLoopEnv] = {}
    models = []
    for make in makers:
        # As they are written: True equals 1, and yet is refused where 1 is taken.
        own = tuple(repr(make.keywords.get(name)) for name in OF_EACH_WORLD)
        if own not in made:
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
