"""The infos of a vector environment, from columns over all worlds."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from care_sim.core.arrays import Mask


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
