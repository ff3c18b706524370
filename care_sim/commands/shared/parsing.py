"""The command line, parsed by tyro; a mistake becomes one line."""

import contextlib
import inspect
import io
import os
import re
import shutil
import sys
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import partial
from typing import Any, cast, get_args, get_type_hints

import docstring_parser
import tyro
from tyro.constructors import (
    MISSING_NONPROP,
    ConstructorRegistry,
    StructConstructorSpec,
    StructFieldSpec,
    StructTypeInfo,
)

from care_sim.base.causes import causes
from care_sim.base.errors import InvalidInput, unknown
from care_sim.commands.shared.help_text import Captured, grouped, wrapped
from care_sim.commands.shared.numbers import number_rule
from care_sim.commands.shared.own_defaults import settled_command

UNRECOGNIZED = "Unrecognized options"
"""How a complaint begins that is of options which a command lacks."""


_HOMES = re.compile("(?<![^=:])~[^/]*(?=/)")
"""The home folder at the beginning of a path, wherever a path may begin: a shell expands it only at
the beginning of a word.
"""
_HELP_ALL = "--help-all"
_HELPS = ("-h", "--help")
_HIDDEN: Any = tyro.conf.Suppress
"""Takes a type, and makes one of an option that no help shows."""


def _expanded(home: re.Match[str]) -> str:
    return os.path.expanduser(home[0])


def _options(asked: StructTypeInfo, brief: bool = False) -> StructConstructorSpec | None:
    """Fields of a command as tyro takes them, but the lines of their docstrings joined; with
    `brief` without the conditions.
    """
    if not (is_dataclass(asked.type) and asked.type.__module__.startswith("care_sim.")):
        return None
    types = get_type_hints(asked.type, include_extras=True)
    return StructConstructorSpec(
        asked.type,
        tuple(
            StructFieldSpec(
                field.name,
                _HIDDEN[types[field.name]]
                if brief and _is_condition(asked.type, field.name)
                else types[field.name],
                _default_of(field, asked.default),
                partial(_help_of, asked.type, field.name),
            )
            for field in fields(asked.type)
            if field.init
        ),
    )


def _registry(brief: bool) -> ConstructorRegistry:
    """How tyro reads options."""
    rules = ConstructorRegistry()
    rules.primitive_rule(number_rule)
    rules.struct_rule(partial(_options, brief=brief))
    return rules


_RULES = _registry(brief=False)
_BRIEF = _registry(brief=True)
"""Of a help that leaves the conditions out; nothing is played by it."""


def _is_condition(options: type, name: str) -> bool:
    """Whether a field is of the conditions that both loops and all studies share."""
    owner = next(one for one in options.__mro__ if name in inspect.get_annotations(one))
    return owner.__module__.startswith("care_sim.core.")


def _conditions(command: Any) -> list[str]:
    """The options of a command that are conditions, as they are written."""
    if not is_dataclass(command):
        return []
    names = []
    for field in fields(command):
        if is_dataclass(field.default):
            names += _conditions(type(field.default))
        elif _is_condition(cast(type, command), field.name):
            names.append(f"--{field.name.replace('_', '-')}")
    return names


def _tell_conditions(command: Any) -> None:
    """Print which options a help has left out."""
    if names := _conditions(command):
        told = f"Conditions, which {_HELP_ALL} explains: {', '.join(names)}."
        columns = shutil.get_terminal_size().columns
        print(textwrap.fill(told, columns, break_on_hyphens=False), end="\n\n")


def _default_of(field: Field[Any], options: Any) -> Any:
    """The value in `options`, where they are given, or else the field's default."""
    if options is not MISSING_NONPROP and options is not tyro.MISSING:
        return getattr(options, field.name)
    if field.default_factory is not MISSING:
        return field.default_factory()
    return MISSING_NONPROP if field.default is MISSING else field.default


def _help_of(options: type, name: str) -> str:
    """The docstring of a field, in one line: tyro would keep the breaks of the source."""
    for one in options.__mro__[:-1]:
        for described in docstring_parser.parse_from_object(one).params:
            if described.arg_name == name:
                return " ".join((described.description or "").split())
    return ""


def chosen_command(
    commands: Mapping[str, Callable[..., Any]],
    prog: str,
    about: str | None,
    arguments: Sequence[str],
) -> Callable[[], int]:
    """The command that the arguments name, with its options. Raises InvalidInput, in one line.

    `--help` names the conditions at its end alone, `--help-all` explains them, too.
    """
    arguments = [_HOMES.sub(_expanded, word) for word in arguments]
    if not arguments:
        raise InvalidInput(f"no command is given; those of {prog}: {', '.join(commands)}")
    named = arguments[0]
    known = named.replace("_", "-")
    if not named.startswith("-") and known not in commands:
        raise unknown("command", named, commands)
    if known in commands:
        commands = {**commands, known: settled_command(commands[known], arguments[1:])}
    complaint = io.StringIO()
    # Sixty conditions, each of several lines, would hide the few options that a command is about.
    brief = _HELP_ALL not in arguments and not {*_HELPS}.isdisjoint(arguments)
    arguments = [_HELPS[1] if one == _HELP_ALL else one for one in arguments]
    help_text = Captured(sys.stdout)
    try:
        with contextlib.redirect_stderr(complaint), contextlib.redirect_stdout(help_text):
            command: Callable[[], int] = tyro.extras.subcommand_cli_from_dict(
                dict(commands),
                prog=prog,
                description=about,
                args=arguments,
                registry=_BRIEF if brief else _RULES,
            )
            return command
    except SystemExit as end:
        # Help ends with 0, and is what was asked for.
        if end.code in (0, None):
            print(wrapped(grouped(help_text.getvalue())), end="")
            _tell_conditions(commands.get(named) if brief else None)
            raise
        if refusal := _refusal(end):
            raise refusal from None
    raise InvalidInput(_one_line(complaint.getvalue()))


def option_helps(command: type) -> dict[str, str]:
    """The options of a command as they are written, those that several commands share included,
    each with its help.
    """
    helps: dict[str, str] = {}
    types = get_type_hints(command, include_extras=True)
    for field in fields(command):
        if is_dataclass(field.default):
            helps |= option_helps(type(field.default))
            continue
        marks = get_args(types[field.name])
        if tyro.conf.Positional in marks:
            continue
        named = next((mark.name for mark in marks if _is_named(mark)), field.name)
        written = named.replace("_", "-")
        is_pair = isinstance(field.default, bool) and tyro.conf.FlagCreatePairsOff not in marks
        names = [written, f"no-{written}"] if is_pair else [written]
        helps |= dict.fromkeys([f"--{name}" for name in names], _help_of(command, field.name))
    return helps


def _is_named(mark: Any) -> bool:
    """Whether a mark of a field's type gives the option another name, as `tyro.conf.arg` does."""
    return isinstance(getattr(mark, "name", None), str)


def _refusal(end: BaseException | None) -> InvalidInput | None:
    """The InvalidInput of an options' class, which tyro takes for a mistake of its own kind."""
    return next((link for link in causes(end) if isinstance(link, InvalidInput)), None)


def _one_line(box: str) -> str:
    """The message that tyro draws as a box: its sections, without title and frame, and without the
    help that it adds.

    An option that is missing, unknown or without its value has no public event in tyro. The events
    of `tyro._errors` are private and may change in any release, as its first lines say. What cannot
    be read here still ends as one line.
    """
    lines = [line.strip(" │╭╮╰╯|+") for line in box.splitlines()][1:]
    # Rules of drawn lines, or of hyphens where the encoding has none, part the sections.
    sections = re.sub("─+|-{5,}", "\n", " ".join(lines)).splitlines()
    # An unknown option may be known to another command, which "in care-sim NAME" would tell.
    texts = [" ".join(section.split()).partition(" in care-sim ")[0] for section in sections]
    told = [
        text.removeprefix("Error parsing ").rstrip(".")
        for text in texts
        if text and not text.startswith(("For full helptext", "Argument helptext:"))
    ]
    # What tyro takes for near, `care_sim.commands.shared.hints` tells better.
    return told[0] if told[0].startswith(UNRECOGNIZED) else "; ".join(told)
