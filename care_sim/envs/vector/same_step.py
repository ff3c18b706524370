"""What a vector environment tells in the mode "SameStep": of episodes that are over, and at once of
those that begin in their place.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.core.arrays import Mask

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
