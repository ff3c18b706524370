"""The command line, parsed by tyro; a mistake becomes one line."""

import contextlib
import io
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import tyro
from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from care_sim.base.errors import InvalidInput, shown

NUMBERS = ConstructorRegistry()
"""How numbers are read: as tyro reads them, with complaints in plain words."""


@NUMBERS.primitive_rule
def _whole_number(asked: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[int] | None:
    if asked.type is not int:
        return None
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="INT",
        instance_from_str=lambda given: _whole(given[0]),
        is_instance=lambda value: isinstance(value, int),
        str_from_instance=lambda value: [str(value)],
    )


@NUMBERS.primitive_rule
def _any_number(asked: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[float] | None:
    if asked.type is not float:
        return None
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="FLOAT",
        instance_from_str=lambda given: _real(given[0]),
        is_instance=lambda value: isinstance(value, int | float),
        str_from_instance=lambda value: [str(value)],
    )


@NUMBERS.primitive_rule
def _whole_number_or_none(asked: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[int | None] | None:
    if asked.type != int | None:
        return None
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="{None}|INT",
        instance_from_str=lambda given: None if given[0] == "None" else _whole(given[0]),
        is_instance=lambda value: value is None or isinstance(value, int),
        str_from_instance=lambda value: [str(value)],
    )


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"must be a whole number, got {shown(text)}") from None


def _real(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"must be a number, got {shown(text)}") from None


def chosen_command(
    commands: Mapping[str, Callable[..., Any]],
    prog: str,
    about: str | None,
    arguments: Sequence[str],
) -> Callable[[], int]:
    """The command that the arguments name, with its options. Raises InvalidInput, in one line."""
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            command: Callable[[], int] = tyro.extras.subcommand_cli_from_dict(
                dict(commands), prog=prog, description=about, args=arguments, registry=NUMBERS
            )
            return command
    except SystemExit as end:
        if end.code in (0, None):
            raise
        if refusal := _refusal(end):
            raise refusal from None
    raise InvalidInput(_one_line(complaint.getvalue()))


def _refusal(end: BaseException | None) -> InvalidInput | None:
    """What an options' class refused, of which tyro makes a mistake of its own."""
    while end is not None and not isinstance(end, InvalidInput):
        end = end.__cause__ or end.__context__
    return end


def _one_line(box: str) -> str:
    """The message that tyro draws as a box: sections between rules, without title, second guesses
    and help.

    tyro has no public way to its messages: `tyro._errors`, with an event per mistake, is private
    and may change in any release. What cannot be read here still ends as one line.
    """
    lines = [line.strip(" │╭╮╰╯|+") for line in box.splitlines()][1:]
    sections = re.sub("─+|-{5,}", "\n", " ".join(lines)).splitlines()
    texts = [" ".join(section.split()).partition(" in care-sim ")[0] for section in sections]
    return "; ".join(
        text.rstrip(".") for text in texts if text and not text.startswith("For full helptext")
    )
