"""What a field of a dataclass may be: stated beside its default, checked when the dataclass is
made, and told by lists.

The kind follows from the default: a flag, text, a whole number, a number, or, where it is bounded,
a range of numbers (low, high). Numbers of any type become Python's own, so that equal
configurations are written alike.
"""

from dataclasses import Field, field, fields
from typing import Any

from care_sim.base.checks import check_flag, check_number, check_range, check_whole
from care_sim.base.errors import InvalidInput, shown

_BOUNDS = "bounds"
_ANY = (float("-inf"), float("inf"))


def bounded(default: Any, least: float, most: float) -> Any:
    """A field whose number, or both numbers of whose range, lie in [least, most]."""
    return field(default=default, metadata={_BOUNDS: (least, most)})


def allowed(one: Field[Any]) -> str:
    """The bounds of a field as people write them; nothing where it has none."""
    return "{:g} to {:g}".format(*one.metadata[_BOUNDS]) if _BOUNDS in one.metadata else ""


def check_fields(thing: Any, of: str = "") -> None:
    """Check the fields of a frozen dataclass, and make each number the type that it is declared as.

    Raises InvalidInput that names the field, with `of` behind its name.
    """
    for one in fields(thing):
        value = getattr(thing, one.name)
        settled = _settled(f"{one.name}{of}", value, one.default, one.metadata.get(_BOUNDS, _ANY))
        if settled is not value:
            object.__setattr__(thing, one.name, settled)


def _settled(name: str, value: Any, default: Any, bounds: tuple[float, float]) -> Any:
    """A value as the type of its field's default. Raises InvalidInput for what it cannot be."""
    # Flags come before whole numbers: in Python a bool is an int.
    if isinstance(default, bool):
        check_flag(name, value)
    elif isinstance(default, str):
        if not isinstance(value, str):
            raise InvalidInput(f"{name} must be a name, got {shown(value)}")
    elif isinstance(default, int):
        check_whole(name, value, *bounds)
        return int(value)
    elif isinstance(default, float):
        check_number(name, value, *bounds)
        return float(value)
    # Two numbers without bounds are a list that happens to hold two.
    elif bounds != _ANY and isinstance(default, tuple) and len(default) == 2:
        check_range(name, value, *bounds)
        return float(value[0]), float(value[1])
    return value
