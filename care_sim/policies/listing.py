"""Readable descriptions of policies: name, tags, summary, parameters, source."""

import inspect
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from textwrap import wrap

from care_sim.base.errors import InvalidInput, one_line
from care_sim.base.plugins import package_of
from care_sim.policies import BUILT_IN, POLICIES, maker, policy_names, tags_of
from care_sim.policies.makers import PolicyMaker, settable

TEXT_WIDTH = 80


def policy_paragraphs() -> Iterator[str]:
    """Return one paragraph per policy, then the entries that another policy of the same name
    hides.
    """
    for name in policy_names():
        yield _paragraph(name)
    for entry, winner in POLICIES.hidden_entries():
        yield _hidden(entry, f"that of {package_of(winner)}" if winner else "the built-in one")


def parameter_texts(make: PolicyMaker) -> list[str]:
    """Return the parameters as NAME=DEFAULT; a bare name is required."""
    return [
        parameter.name
        if parameter.default is parameter.empty
        else f"{parameter.name}={parameter.default!r}"
        for parameter in settable(make)
        if parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
    ]


def _paragraph(name: str) -> str:
    # One policy that cannot be loaded must not hide the others.
    try:
        make = maker(name)
    except InvalidInput as error:
        return _lines(f"{name} (broken)", f"{error} [{package_of(POLICIES.entry(name))}]")
    return _lines(
        f"{name} ({', '.join(tags_of(name))})",
        _summary(name, make),
        " ".join(parameter_texts(make)),
        getattr(make, "source", ""),
    )


def _summary(name: str, make: PolicyMaker) -> str:
    """Return a built-in policy's first paragraph of its docstring. For another policy, return its
    first line and its package.
    """
    if name in BUILT_IN:
        return (inspect.getdoc(make) or "").partition("\n\n")[0]
    said = (make.__doc__ or "").strip().partition("\n")[0]
    return f"{said} [{package_of(POLICIES.entry(name))}]".strip()


def _hidden(entry: EntryPoint, winner: str) -> str:
    return _lines(
        f"{entry.name} (hidden)", f"Not used: {winner} has its name. [{package_of(entry)}]"
    )


def _lines(title: str, *texts: str) -> str:
    said = map(one_line, texts)
    indented = (
        line
        for text in said
        for line in wrap(text, TEXT_WIDTH, initial_indent="    ", subsequent_indent="    ")
    )
    return "\n".join([one_line(title), *indented])
