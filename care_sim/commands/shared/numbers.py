"""How the command line reads numbers."""

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

from tyro.constructors import PrimitiveConstructorSpec, PrimitiveTypeInfo

from care_sim.base.errors import shown


class _Reading(NamedTuple):
    """Convert the words after an option to a value.

    `metavar` and `nargs` are the words in the help and their number. `value_of` makes the value,
    and `is_value` recognises it.
    """

    metavar: str
    nargs: int | Literal["*"]
    value_of: Callable[[list[str]], Any]
    is_value: Callable[[Any], bool]


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"must be a whole number, got {shown(text)}") from None


def _real(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"must be a number, got {shown(text)}{_as_share(text)}") from None


def _as_share(text: str) -> str:
    """How a share in percent is written; nothing for another text."""
    try:
        share = float(text.removesuffix("%")) / 100
    except ValueError:
        return ""
    return f": write {share:g} for {text}" if 0 < share <= 1 else ""


def _whole_or_none(text: str) -> int | None:
    return None if text == "None" else _whole(text)


def _is_whole(value: Any) -> bool:
    return isinstance(value, int)


def _is_real(value: Any) -> bool:
    return isinstance(value, int | float)


_READINGS: dict[Any, _Reading] = {
    int: _Reading("INT", 1, lambda words: _whole(words[0]), _is_whole),
    float: _Reading("FLOAT", 1, lambda words: _real(words[0]), _is_real),
    int | None: _Reading(
        "{None}|INT",
        1,
        lambda words: _whole_or_none(words[0]),
        lambda value: value is None or _is_whole(value),
    ),
    tuple[int, ...]: _Reading(
        "[INT [INT ...]]",
        "*",
        lambda words: tuple(map(_whole, words)),
        lambda value: isinstance(value, tuple) and all(map(_is_whole, value)),
    ),
    tuple[float, ...]: _Reading(
        "[FLOAT [FLOAT ...]]",
        "*",
        lambda words: tuple(map(_real, words)),
        lambda value: isinstance(value, tuple) and all(map(_is_real, value)),
    ),
}
"""Types of options that hold numbers: tyro reads them the same, but complains in its own words."""


def number_rule(asked: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    """Return how tyro reads an option that holds numbers; None for an option of another type."""
    reading = _READINGS.get(asked.type)
    if reading is None:
        return None
    return PrimitiveConstructorSpec(
        nargs=reading.nargs,
        metavar=reading.metavar,
        instance_from_str=reading.value_of,
        is_instance=reading.is_value,
        str_from_instance=lambda value: list(
            map(str, value if isinstance(value, tuple) else [value])
        ),
    )
