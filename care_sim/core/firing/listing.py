"""The kinds of hardware by name, and the text that names one: `tiles` or `tiles:4x8`."""

import re
from collections.abc import Callable

from care_sim.base.errors import InvalidInput, shown
from care_sim.core.cells.stack import Grid
from care_sim.core.firing.base import Energy, FreeCells, Hardware
from care_sim.core.firing.units import (
    AzimuthWindow,
    RingSegments,
    Tiles,
    VerticalWindow,
    WholeColumns,
    WholeRows,
)

HARDWARE: dict[str, type[Hardware]] = {
    kind.name: kind
    for kind in (
        FreeCells,
        Tiles,
        RingSegments,
        WholeRows,
        WholeColumns,
        VerticalWindow,
        AzimuthWindow,
        Energy,
    )
}
_NUMBER = re.compile(r"[0-9]{1,6}(\.[0-9]{1,6})?")


def form_of(kind: type[Hardware]) -> str:
    """How a kind is named: `tiles:ROWSxCOLUMNS`."""
    return ":".join([kind.name, *(["x".join(kind.numbers)] if kind.numbers else [])])


def settled(firing: str) -> str:
    """The text in full: `tiles:4x8` for `tiles`. Texts that mean the same become equal.

    Raises InvalidInput for what names no hardware.
    """
    kind, numbers = _parsed(firing)
    return ":".join([kind.name, *(["x".join(map(_text, numbers))] if numbers else [])])


def most_shots(firing: str) -> int:
    """How often the hardware of a text may fire a cell at a keyframe. Raises InvalidInput for what
    names no hardware.
    """
    kind, numbers = _parsed(firing)
    return int(numbers[0]) if kind is Energy else kind.most_shots


def hardware_of(firing: str, grid: Grid) -> Hardware:
    """The hardware that a text names, over a grid. Raises InvalidInput for what names none, and
    for units that do not divide the grid.
    """
    kind, numbers = _parsed(firing)
    make: Callable[..., Hardware] = kind
    return make(grid, *numbers)


def _parsed(firing: str) -> tuple[type[Hardware], tuple[float, ...]]:
    """The kind of hardware and its numbers. Raises InvalidInput for another text."""
    name, colon, behind = firing.partition(":") if isinstance(firing, str) else ("", "", "")
    kind = HARDWARE.get(name)
    if kind is not None and not colon:
        return kind, kind.usual
    given = behind.split("x")
    if kind is None or len(given) != len(kind.numbers) or not all(map(_NUMBER.fullmatch, given)):
        raise _unknown(firing)
    try:
        # They get the type of the usual numbers: counts are whole numbers.
        return kind, tuple(type(n)(text) for n, text in zip(kind.usual, given, strict=True))
    except ValueError as error:
        raise _unknown(firing) from error


def _text(number: float) -> str:
    # As many decimals as may be given, and no exponent, so that the text names the same again.
    return f"{number:.6f}".rstrip("0").rstrip(".")


def _unknown(firing: object) -> InvalidInput:
    forms = ", ".join(map(form_of, HARDWARE.values()))
    return InvalidInput(f"unknown firing {shown(firing)}; known: {forms}")
