"""The line that runs a command, told back from its options."""

import shlex
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any, get_args, get_type_hints

import tyro

from care_sim.commands.table import COMMANDS


def command_line(command: object) -> str:
    """The line as a shell takes it: what departs from the defaults; empty for what is no command
    of `care-sim`.
    """
    place = f"{type(command).__module__}:{type(command).__name__}"
    for name, each in COMMANDS.items():
        if place == f"care_sim.{each.options}":
            # Positional arguments come first: after an option with several values they would be
            # read as such values.
            words = sorted(_words(command), key=lambda option: option[0].startswith("--"))
            return shlex.join(
                ["care-sim", *name.split(), *(word for option in words for word in option)]
            )
    return ""


def _words(options: Any) -> Iterator[list[str]]:
    """An option and its values, each as it is written."""
    types = get_type_hints(type(options), include_extras=True)
    for field in fields(options):
        value = getattr(options, field.name)
        written = field.name.replace("_", "-")
        if is_dataclass(field.default):
            yield from _words(value)
        elif tyro.conf.Positional in get_args(types[field.name]):
            yield [str(value)]
        elif value == field.default:
            continue
        elif isinstance(value, bool):
            yield [f"--{written}" if value else f"--no-{written}"]
        elif isinstance(value, tuple):
            yield [f"--{written}", *map(str, value)]
        else:
            yield [f"--{written}", str(value)]
