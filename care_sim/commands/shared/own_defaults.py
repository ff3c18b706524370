"""Commands whose defaults hang on what else is asked for: those of a learner on its environment."""

from collections.abc import Mapping, Sequence
from dataclasses import field, fields, make_dataclass
from typing import Any, get_type_hints


def settled_command(command: Any, arguments: Sequence[str]) -> Any:
    """The command with the defaults that its `own_defaults` tells for these arguments; any other as
    it is.
    """
    tell = getattr(command, "own_defaults", None)
    return command if tell is None else with_defaults(command, tell(arguments))


def with_defaults(command: type, values: Mapping[str, Any]) -> type:
    """The class of a command with other defaults, the same in all else."""
    types = get_type_hints(command, include_extras=True)
    # Bounds stand in the metadata of a field.
    changed = [
        (one.name, types[one.name], field(default=values[one.name], metadata=one.metadata))
        for one in fields(command)
        if one.name in values
    ]
    named = {"__module__": command.__module__, "__doc__": command.__doc__}
    return make_dataclass(
        command.__name__, changed, bases=(command,), namespace=named, frozen=True, kw_only=True
    )
