"""Reads the options of a command with tyro; a mistake becomes one line."""

import inspect
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from difflib import get_close_matches
from functools import partial
from typing import Annotated, Any, NoReturn, Union, get_type_hints

import docstring_parser
import tyro
from tyro import _errors
from tyro.constructors import (
    MISSING_NONPROP,
    ConstructorRegistry,
    StructConstructorSpec,
    StructFieldSpec,
    StructTypeInfo,
)

from care_sim.base.errors import InvalidInput
from care_sim.commands.options.learning import Learner, Recipe
from care_sim.commands.table import COMMANDS
from care_sim.core.conditions import Conditions
from care_sim.training.hyperparameters import read_hyperparameters

_HOME = re.compile("(?<![^=:])~[^/]*(?=/)")
"""The home folder at the beginning of a path, wherever a path may begin: a shell expands it only at
the beginning of a word.
"""
_HELPS = ("-h", "--help")
_HELP_ALL = "--help-all"
_HIDDEN: Any = tyro.conf.Suppress
"""Takes a type, and makes one of an option that no help shows."""


def read_options(kind: Any, prog: str, arguments: Sequence[str]) -> Any:
    """The options that the arguments give, an instance of `kind`. Raises InvalidInput, in one line.

    `--help` names the conditions alone, `--help-all` explains them, too.
    """
    words = [_HOME.sub(lambda home: os.path.expanduser(home[0]), word) for word in arguments]
    # Sixty conditions, each of several lines, would hide the few options that a command is about.
    brief = _HELP_ALL not in words and not {*_HELPS}.isdisjoint(words)
    words = [_HELPS[1] if word == _HELP_ALL else word for word in words]
    with _errors.on_parse_error(partial(_refuse, kind)):
        return tyro.cli(
            kind,
            prog=prog,
            description=_description(kind, brief),
            args=words,
            registry=_registry(brief, _recipe(kind, words) if issubclass(kind, Learner) else {}),
        )


def _registry(brief: bool, defaults: Mapping[str, Any]) -> ConstructorRegistry:
    registry = ConstructorRegistry()
    registry.struct_rule(partial(_explained, brief=brief, defaults=defaults))
    return registry


def _recipe(kind: type[Learner], words: Sequence[str]) -> Mapping[str, Any]:
    """The defaults of a learner in the environment that the words name."""
    named, _ = tyro.cli(Recipe, args=words, return_unknown_args=True, add_help=False)
    # A file that is missing is named when the command runs, as that of any other option.
    if named.hyperparameters is not None and not named.hyperparameters.exists():
        return {}
    return read_hyperparameters(kind.kind, named.env, named.hyperparameters, named.drawn).values


def _description(kind: type, brief: bool) -> str:
    about = inspect.getdoc(kind) or ""
    conditions = [field.default for field in fields(kind) if isinstance(field.default, Conditions)]
    if not (brief and conditions):
        return about
    names = ", ".join(option_names(conditions[0]))
    return f"{about}\n\nConditions, which {_HELP_ALL} explains: {names}."


def _explained(
    asked: StructTypeInfo, brief: bool, defaults: Mapping[str, Any]
) -> StructConstructorSpec | None:
    """The fields of options as tyro takes them, a command's own first; with `brief` without help
    for the conditions. `defaults` replace those of the class.
    """
    if not (is_dataclass(asked.type) and asked.type.__module__.startswith("care_sim.")):
        return None
    types = get_type_hints(asked.type, include_extras=True)
    is_hidden = brief and issubclass(asked.type, Conditions)
    told = {} if is_hidden else _docstrings(asked.type)
    owners = [vars(owner).get("__annotations__", {}) for owner in asked.type.__mro__]
    own_first = sorted(
        (field for field in fields(asked.type) if field.init),
        key=lambda field: next(n for n, names in enumerate(owners) if field.name in names),
    )
    return StructConstructorSpec(
        asked.type,
        tuple(
            StructFieldSpec(
                field.name,
                _HIDDEN[types[field.name]] if is_hidden else types[field.name],
                defaults.get(field.name, _default_of(field, asked.default)),
                told.get(field.name, ""),
            )
            for field in own_first
        ),
    )


def _docstrings(kind: type) -> dict[str, str]:
    """The docstring of every field in one line, since a terminal breaks it elsewhere; those of
    subclasses win.
    """
    return {
        each.arg_name: " ".join((each.description or "").split())
        for owner in reversed(kind.__mro__[:-1])
        for each in docstring_parser.parse_from_object(owner).params
    }


def _default_of(field: Field[Any], options: Any) -> Any:
    """The value in `options`, if they are given, or else the field's default."""
    if options is not MISSING_NONPROP and options is not tyro.MISSING:
        return getattr(options, field.name)
    return MISSING_NONPROP if field.default is MISSING else field.default


def _refuse(kind: type, event: Any) -> NoReturn:
    """Raise InvalidInput for what tyro cannot read, in one line."""
    match event:
        case _errors.MissingArgs():
            missing = ", ".join(_name_of(each.arg) for each in event.missing_arguments)
            unknown = " ".join(event.unrecognized_tokens)
            told = f"missing: {missing}{f'; unknown: {unknown}' if unknown else ''}"
        case _errors.UnrecognizedArgs():
            hints = "".join(_near(word, kind) for word in event.tokens if word.startswith("--"))
            told = f"unrecognized options: {' '.join(event.tokens)}{hints}"
        case _errors.InvalidChoice():
            choices = ", ".join(event.choices)
            told = f"{_name_of(event.argument)} must be one of {choices}, got {event.value!r}"
        case _errors.BadValue():
            told = f"{_name_of(event.argument)} needs a value: {event.argument.lowered.metavar}"
        case _errors.InstantiationFailure() if event.argument is not None:
            reason = event.message.partition("\n")[0]
            told = f"{_name_of(event.argument)} takes {event.argument.lowered.metavar}: {reason}"
        case _:
            told = str(getattr(event, "message", type(event).__name__))
    raise InvalidInput(told) from None


def _name_of(argument: Any) -> str:
    """An option as it is written, or what help calls an argument without a name."""
    return str(argument.lowered.metavar if argument.is_positional() else argument.display_name())


def _near(word: str, kind: type) -> str:
    # Without the dashes, which make every option like every other.
    names = [name.removeprefix("--") for name in option_names(kind)]
    near = get_close_matches(word.partition("=")[0].removeprefix("--"), names)
    return f"; perhaps {' or '.join(f'--{name}' for name in near)}" if near else ""


def option_names(kind: Any) -> Iterator[str]:
    """The options of a class as they are written, conditions included."""
    for field in fields(kind):
        if is_dataclass(field.default):
            yield from option_names(field.default)
        else:
            yield f"--{field.name.replace('_', '-')}"


def print_completion(arguments: Sequence[str]) -> NoReturn:
    """Print a script by which a shell completes commands and options, as tyro writes it."""
    families: dict[str, list[Any]] = {}
    for name, command in COMMANDS.items():
        first, _, second = name.partition(" ")
        families.setdefault(first, []).append(_named(second or first, [command.options_class()]))
    kinds = [own[0] if len(own) == 1 else _named(first, own) for first, own in families.items()]
    any_command: Any = Union[tuple(kinds)]  # noqa: UP007 (annotated kinds have no operator)
    registry = _registry(brief=False, defaults={})
    tyro.cli(any_command, prog="care-sim", args=arguments, registry=registry)
    raise AssertionError("tyro exits once it has printed the script")


def _named(name: str, kinds: Sequence[Any]) -> Any:
    """One of several kinds of options, as a command of that name."""
    # Annotated kinds have no operator.
    return Annotated[Union[tuple(kinds)], tyro.conf.subcommand(name, prefix_name=False)]  # noqa: UP007
